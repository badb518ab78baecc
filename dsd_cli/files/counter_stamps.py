"""A table whose stamps are those of a counter of 16 or 32 bits, as `micros()` of a board is: they go on where it wraps.

Read as they are, every wrap would begin another recording.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.files.wrapped import WrappedTable
from dsd_cli.signals.log import Array

#: What such a counter goes up to. Over a wrap it goes on by so many of the steps before at most, else it begins anew.
TURNS, STEPS = (2.0**16, 2.0**32), 3.0


def counted_on(table: TableSource) -> TableSource:
    """The table with the stamps of a counter as if it had more bits; bit by bit the same where none wraps."""
    return _CountedOn(table) if "t" in table.columns else table


class _CountedOn(WrappedTable):
    def __init__(self, table: TableSource) -> None:
        super().__init__(table)
        self._wraps = dict.fromkeys(TURNS, 0)
        self._begin()

    def _begin(self) -> None:
        self._before: Array = np.empty(0)
        self._passed = 0.0

    @property
    def warnings(self) -> list[str]:
        """Those of the table, and how often the counter went round."""
        said = [
            f"the stamps are of a counter of {np.log2(turn):.0f} bits, which wraps {count} time(s): they go on there"
            for turn, count in self._wraps.items()
            if count
        ]
        return [*self._table.warnings, *said]

    def batches(self) -> Iterator[Batch]:
        for batch in self._table.batches():
            if batch.restart:
                self._begin()
            if "t" not in batch.columns:
                yield batch
                continue
            t = batch.columns["t"]
            passed = self._passed + self._wrapped(t)
            self._before = np.concatenate([self._before, t[-2:]])[-2:]
            self._passed = float(passed[-1]) if passed.size else self._passed
            yield batch._replace(columns={**batch.columns, "t": t + passed}) if passed.any() else batch

    def _wrapped(self, t: Array) -> Array:
        """What the wraps in these rows add to each stamp, shape (n,)."""
        x = np.concatenate([self._before, t])
        added = np.zeros(x.size)
        for at in np.flatnonzero(np.diff(x) < 0.0) + 1:
            step = x[at - 1] - x[at - 2] if at > 1 else 0.0
            if at < self._before.size or not (x[at - 1].is_integer() and x[at].is_integer()):
                continue
            for turn in TURNS:
                lowest = 0.0 if x[at] >= 0.0 else -0.5 * turn  # unsigned, or signed
                if lowest <= x[at] and x[at - 1] < turn + lowest and 0.0 < x[at] + turn - x[at - 1] <= STEPS * step:
                    added[at:] += turn
                    self._wraps[turn] += 1
        return added[self._before.size :]
