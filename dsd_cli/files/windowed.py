"""A table of which only the rows of a stretch of time are read, or only those outside of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.files.wrapped import ClockedTable
from dsd_cli.signals.log import Array


class Window(NamedTuple):
    """From `start` to `end`, both in it, s as the log's stamps count; `outside` is all the rest."""

    start: float = -math.inf
    end: float = math.inf
    outside: bool = False

    def __bool__(self) -> bool:
        return self.outside or self.start > -math.inf or self.end < math.inf

    def __str__(self) -> str:
        since, until = self.start > -math.inf, self.end < math.inf
        if since and until:
            part = f"from {self.start:g} s to {self.end:g} s"
        else:
            part = f"from {self.start:g} s on" if since else f"up to {self.end:g} s"
        return f"{'without its part ' * self.outside}{part}"

    @property
    def rest(self) -> Window:
        """All that is not in it."""
        return self._replace(outside=not self.outside)

    def holds(self, t: Array) -> Array:
        """Which stamps (s) are in it; one that is not finite is left to whoever drops such rows."""
        inside = ~((t < self.start) | (t > self.end))
        return np.asarray((~inside | ~np.isfinite(t)) if self.outside else inside)


def windowed(table: TableSource, window: Window, time_scale: float, sample_time: float | None) -> TableSource:
    """The table with the rows of a window alone; the table itself where there is none.

    Parameters
    ----------
    time_scale : s per unit of the stamps. sample_time : s from row to row, where there are no stamps.
    """
    return _Windowed(table, window, time_scale, sample_time) if window else table


class _Windowed(ClockedTable):
    """With the rows of a window alone."""

    def __init__(self, table: TableSource, window: Window, time_scale: float, sample_time: float | None) -> None:
        super().__init__(table, time_scale, sample_time)
        self._window = window

    def batches(self) -> Iterator[Batch]:
        """Rows of the window.

        Raises
        ------
        DataError : there are none.
        """
        passed, restart, first, last, rows = 0, False, math.inf, -math.inf, 0
        for batch, t in self.timed():
            rows += batch.rows
            finite = t[np.isfinite(t)]
            first, last = min(first, finite.min(initial=math.inf)), max(last, finite.max(initial=-math.inf))
            keep = self._window.holds(t)
            kept, restart = int(keep.sum()), restart or batch.restart
            if kept:
                yield Batch(kept, {name: x[keep] for name, x in batch.columns.items()}, restart)
                passed, restart = passed + kept, False
        if rows and not passed:
            hint = f"it goes from {first:g} s to {last:g} s, and --from and --to count as its stamps do"
            raise DataError(f"{self.name}: no row {self._window}", hint)
