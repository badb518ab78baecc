"""A table whose position goes on where it wraps after a turn, undone row by row: a file and a live stream alike."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.files.wrapped import WrappedTable
from dsd_cli.signals.log import Array

#: A step of more than this share of all that the position went through, and of this many of the largest changes of a
#: step before it, is a wrap if its size is that of a turn, as near as so many of the longest steps.
WRAP_SHARE, WRAP_CHANGES, NEAR_STEPS = 0.5, 20.0, 2.0
#: Turns of the column as it is, beside a whole and a half one in rad: degrees, and counters of so many bits or counts.
TURNS = (180.0, 360.0, *(2.0**k for k in range(8, 33)), 1e3, 4e3, 1e4, 1e5, 1e6)


def unwrapped(table: TableSource, factor: float) -> TableSource:
    """The table with a position that does not wrap, in the unit of its column; the table itself without a position.

    Parameters
    ----------
    factor : what the column is multiplied by to be in rad.
    """
    return _Unwrapped(table, factor) if "position" in table.columns else table


class _Unwrapped(WrappedTable):
    """With wraps undone. What a row says depends on the rows before it alone."""

    def __init__(self, table: TableSource, factor: float) -> None:
        super().__init__(table)
        self._turns = np.array(sorted({*TURNS, 2.0 * np.pi / abs(factor), np.pi / abs(factor)}))
        self._wraps = 0

    @property
    def warnings(self) -> list[str]:
        if not self._wraps:
            return self._table.warnings
        times = "once" if self._wraps == 1 else f"{self._wraps:,} times"
        return [*self._table.warnings, f"the position wraps after a turn ({times}): undone"]

    def batches(self) -> Iterator[Batch]:
        undo = _Undo(self._turns)
        for batch in self._table.batches():
            if batch.restart:
                undo = _Undo(self._turns)
            before = undo.wraps
            position = undo.continued(batch.columns["position"])
            self._wraps += undo.wraps - before
            yield batch._replace(columns={**batch.columns, "position": position})


class _Undo:
    """What is known of one recording so far, in the unit of the column. wraps : how many were undone."""

    def __init__(self, turns: Array) -> None:
        self._turns = turns
        self.wraps = 0
        self._offset = 0.0
        self._last: float | None = None
        self._step = np.nan  # the last one; nan: there is none, or it was a wrap
        self._fast, self._change = 0.0, 0.0  # the longest that was none, and the largest from one to the next
        self._low, self._high = np.inf, -np.inf

    def continued(self, q: Array) -> Array:
        """The next rows, shape (n,), with what was undone so far."""
        finite = np.flatnonzero(np.isfinite(q))
        if finite.size == 0:
            return q
        x = q[finite]
        steps = np.diff(x, prepend=np.nan if self._last is None else self._last)
        doubtful = np.flatnonzero(np.abs(steps) > WRAP_CHANGES * self._change)
        offsets = self._offsets(x, steps, doubtful)
        self._last, self._low = float(x[-1]), min(self._low, float(x.min()))
        self._high = max(self._high, float(x.max()))
        if not self.wraps:
            return q
        found = q.copy()
        found[finite] = x + offsets
        return found

    def _offsets(self, x: Array, steps: Array, doubtful: np.ndarray) -> Array:
        """What each of the rows x lies off, shape (n,); `doubtful` : those whose step may be a wrap."""
        sizes, changes, offsets = np.abs(steps), np.abs(np.diff(steps, prepend=self._step)), np.zeros(x.size)
        sizes[doubtful] = changes[doubtful] = changes[np.minimum(doubtful + 1, x.size - 1)] = 0.0
        longest, largest = np.fmax.accumulate(sizes), np.fmax.accumulate(changes)
        span = np.maximum(np.maximum.accumulate(x), self._high) - np.minimum(np.minimum.accumulate(x), self._low)
        last = -2
        for k in doubtful.tolist():
            step, before = float(steps[k]), self._step if k == 0 else float(steps[k - 1])
            known = last != k - 1 and np.isfinite(before)
            jump = step - before if known else step
            fast, change = max(self._fast, float(longest[k])), max(self._change, float(largest[k]))
            size = self._turn(jump, fast)
            far = abs(step) > WRAP_SHARE * span[k] and abs(step) > WRAP_CHANGES * (change or fast)
            if far and size:
                if fast > 0.0:
                    offsets[k], last = -np.sign(step) * size, k
                    self.wraps += 1
            elif not far or not fast:
                self._fast = max(self._fast, abs(step))
                self._change = max(self._change, abs(jump) if known else 0.0)
        self._fast, self._change = max(self._fast, float(longest[-1])), max(self._change, float(largest[-1]))
        self._step = np.nan if last == x.size - 1 else float(steps[-1])
        offsets = self._offset + np.cumsum(offsets)
        self._offset = float(offsets[-1])
        return offsets

    def _turn(self, step: float, fast: float) -> float:
        """The turn that is as long as this step, and of which the axis goes less than a half at once; 0 if none is."""
        near = float(self._turns[np.argmin(np.abs(self._turns - abs(step)))])
        return near if abs(near - abs(step)) <= NEAR_STEPS * fast + 1e-6 * near and near > 2.0 * fast else 0.0
