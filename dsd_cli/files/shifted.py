"""A table whose u is moved in time by `signals.u_shift`, where it was logged later or earlier than it acted."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.files.wrapped import ClockedTable
from dsd_cli.signals.log import Array, Hold

#: A sample of u lasts until the next one, but not over a hole of more than so many steps: then for one step.
HOLE = 10.0


class Shift(NamedTuple):
    """`seconds` are put on the stamps of u: below 0 where it was logged too late. hold : see `Log.u_hold`."""

    seconds: float = 0.0
    hold: Hold = "held"


def shifted(table: TableSource, shift: Shift, time_scale: float, sample_time: float | None) -> TableSource:
    """The table with u as it was `shift.seconds` before each row; the table itself, bit by bit, where that is 0.

    A held u is the sample that is valid in the middle of the time in which the row's own u would be: what a shift has
    beyond whole samples is rounded. A sampled u is interpolated. No u is NaN: the rows at the edges of a recording.

    Parameters
    ----------
    time_scale : s per unit of the stamps. sample_time : s from row to row, where there are no stamps.
    """
    return _Shifted(table, shift, time_scale, sample_time) if shift.seconds else table


class _Shifted(ClockedTable):
    """With u moved in time. A row waits for the rows that hold its u: a live stream lags by a shift below 0."""

    def __init__(self, table: TableSource, shift: Shift, time_scale: float, sample_time: float | None) -> None:
        super().__init__(table, time_scale, sample_time)
        self._shift = shift

    def batches(self) -> Iterator[Batch]:
        """The same rows.

        Raises
        ------
        DataError : none of them has a u now.
        """
        some, found = False, False
        for rows in self._moved():
            some, found = True, found or bool(np.isfinite(rows.columns["u"]).any())
            yield rows
        if some and not found:
            hint = "is it in s, and shorter than the log?"
            raise DataError(f"{self.name}: no row has a u with signals.u_shift = {self._shift.seconds:g}", hint)

    def _moved(self) -> Iterator[Batch]:
        recording = _Recording(self._shift)
        for batch, t in self.timed():
            for part, stamps, another in _recordings(batch, t, recording.last):
                if another:
                    yield from recording.taken(final=True)
                    recording = _Recording(self._shift)
                recording.add(part, stamps)
                yield from recording.taken(final=False)
        yield from recording.taken(final=True)


def _recordings(batch: Batch, t: Array, last: float) -> Iterator[tuple[Batch, Array, bool]]:
    """(rows of one recording, their stamps, whether another one than before begins): the stamps go back, or the file.

    last : stamp before these rows.
    """
    finite = np.flatnonzero(np.isfinite(t))
    back = finite[1:][np.diff(t[finite]) < 0.0].tolist()
    if finite.size and t[finite[0]] < last:
        back.insert(0, int(finite[0]))
    edges = [0, *(at for at in back if at > 0), batch.rows]
    for first, end in pairwise(edges):
        begins = batch.restart if first == 0 else False
        part = Batch(end - first, {name: x[first:end] for name, x in batch.columns.items()}, begins)
        yield part, t[first:end], begins or first in back


class _Recording:
    """Rows whose stamps never go back: those that wait, and what of those before holds their u."""

    def __init__(self, shift: Shift) -> None:
        self._shift = shift
        self._rows: list[Batch] = []
        self._at = np.zeros(0, dtype=np.int64)  # which sample each waiting row is; -1: its stamp is no number
        self._t, self._u = np.zeros(0), np.zeros(0)
        self.last = -math.inf

    def add(self, rows: Batch, t: Array) -> None:
        """Rows with their stamps, s, shape (n,). Of rows with one stamp the first is the sample."""
        finite = np.isfinite(t)
        latest = np.maximum.accumulate(np.where(finite, t, -np.inf))
        new = finite & (t > np.concatenate([[self.last], np.maximum(latest[:-1], self.last)]))
        at = self._t.size - 1 + np.cumsum(new)
        self._at = np.concatenate([self._at, np.where(finite, at, -1)])
        self._t, self._u = np.concatenate([self._t, t[new]]), np.concatenate([self._u, rows.columns["u"][new]])
        if new.any():
            self.last = float(self._t[-1])
        self._rows.append(rows)

    def taken(self, final: bool) -> Iterator[Batch]:
        """The rows whose u is known; `final`: no more will come, so all."""
        u, known = self._moved()
        ready = self._at.size if final else self._ready(known)
        if ready == 0:
            return
        rows = _joined(self._rows)
        at = self._at[:ready]
        moved = np.where(at >= 0, u[np.maximum(at, 0)] if u.size else np.nan, np.nan)
        columns = {name: x[:ready] for name, x in rows.columns.items()}
        yield Batch(ready, {**columns, "u": moved}, rows.restart)
        rest = {name: x[ready:] for name, x in rows.columns.items()}
        self._rows = [Batch(rows.rows - ready, rest)] if ready < rows.rows else []
        self._forget(ready)

    def _moved(self) -> tuple[Array, int]:
        """(u of each sample at hand, moved; how many of the first ones no later row can change)."""
        t, u = self._t, self._u
        steps = np.diff(t)
        if steps.size == 0:
            return np.full(t.size, np.nan), 0
        step = np.minimum(np.concatenate([[np.inf], steps]), np.concatenate([steps, [np.inf]]))
        held = self._shift.hold == "held"
        when = t - self._shift.seconds + (0.5 * step if held else 0.0)
        found = np.searchsorted(t, when, side="right") - 1
        j = np.clip(found, 0, t.size - 1)
        lasts = np.concatenate([steps, [0.0]])[j]
        bridged = (lasts > 0.0) & (lasts <= HOLE * step)
        if held:
            valid = bridged | (when - t[j] < step)
            moved = u[j]
        else:
            after = np.minimum(j + 1, t.size - 1)
            share = np.where(bridged, (when - t[j]) / np.where(lasts > 0.0, lasts, 1.0), 0.0)
            valid = bridged | (when == t[j])
            moved = np.where(share > 0.0, u[j] + share * (u[after] - u[j]), u[j])
        open_ones = np.flatnonzero(when[:-1] >= t[-1])
        return np.where(valid & (found >= 0), moved, np.nan), int(open_ones[0]) if open_ones.size else t.size - 1

    def _ready(self, known: int) -> int:
        """How many of the waiting rows belong to the first `known` samples (or to none, before such a row)."""
        waits = np.flatnonzero(self._at >= known)
        return int(waits[0]) if waits.size else self._at.size

    def _forget(self, ready: int) -> None:
        """Samples that no waiting or later row asks for."""
        self._at = self._at[ready:]
        waiting = self._at[self._at >= 0]
        first = int(waiting[0]) if waiting.size else self._t.size
        if first == 0 or self._t.size == 0:
            return
        since = self._t[min(first, self._t.size - 1)] - max(self._shift.seconds, 0.0)
        gone = min(max(int(np.searchsorted(self._t, since)) - 2, 0), first - 1)
        if gone > 0:
            self._t, self._u = self._t[gone:], self._u[gone:]
            self._at = np.where(self._at >= 0, self._at - gone, -1)


def _joined(rows: list[Batch]) -> Batch:
    if len(rows) == 1:
        return rows[0]
    columns = {name: np.concatenate([one.columns[name] for one in rows]) for name in rows[0].columns}
    return Batch(sum(one.rows for one in rows), columns, rows[0].restart)
