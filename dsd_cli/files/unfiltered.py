"""A table whose u was logged behind a low-pass of first order (`signals.u_filter`), with that undone."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.files.wrapped import ClockedTable
from dsd_cli.signals.log import Array
from dsd_cli.signals.low_pass import in_front


def unfiltered(table: TableSource, time_constant: float, time_scale: float, sample_time: float | None) -> TableSource:
    """The table with u as it was in front of the filter; the table itself, bit by bit, where `time_constant` is 0.

    By `signals.low_pass.in_front`: a u that is held from sample to sample.

    Parameters
    ----------
    time_constant : s. time_scale : s per unit of the stamps. sample_time : s from row to row, where there are none.
    """
    return _Unfiltered(table, time_constant, time_scale, sample_time) if time_constant else table


class _Unfiltered(ClockedTable):
    """Each row as it comes, for only the one before it is needed."""

    def __init__(self, table: TableSource, time_constant: float, time_scale: float, sample_time: float | None) -> None:
        super().__init__(table, time_scale, sample_time)
        self._time_constant = time_constant

    def batches(self) -> Iterator[Batch]:
        """The same rows."""
        last = (math.nan, math.nan)  # stamp and u of the last sample, as logged
        for batch, t in self.timed():
            if batch.restart:
                last = (math.nan, math.nan)
            u = batch.columns["u"]
            kept = np.flatnonzero(np.isfinite(t) & np.isfinite(u))
            moved = u.copy()
            moved[kept], last = self._undone(t[kept], u[kept], last)
            yield batch._replace(columns={**batch.columns, "u": moved})

    def _undone(self, t: Array, u: Array, last: tuple[float, float]) -> tuple[Array, tuple[float, float]]:
        """(u in front of the filter, stamp and logged u of the last of these samples); stamps that go back begin anew,
        and one that comes again is not read."""
        if t.size == 0:
            return u, last
        return in_front(t, u, self._time_constant, last), (float(t[-1]), float(u[-1]))
