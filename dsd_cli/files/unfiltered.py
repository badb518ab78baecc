"""A table whose u was logged behind a low-pass of first order (`signals.u_filter`), with that undone."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.files.wrapped import ClockedTable
from dsd_cli.signals.log import Array


def unfiltered(table: TableSource, time_constant: float, time_scale: float, sample_time: float | None) -> TableSource:
    """The table with u as it was in front of the filter; the table itself, bit by bit, where `time_constant` is 0.

    A u that is held from sample to sample leaves u_f[k] = a u_f[k-1] + (1 - a) u[k] behind 1 / (time_constant s + 1),
    with a = exp(-(t[k] - t[k-1]) / time_constant); that is solved for u[k]. What u was before the first row nobody
    knows: it counts as constant there.

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
        step = np.diff(t, prepend=last[0])
        share = np.exp(-np.where(step > 0.0, step, np.inf) / self._time_constant)
        before = np.concatenate([[last[1]], u[:-1]])
        return np.where(share > 0.0, (u - share * before) / (1.0 - share), u), (float(t[-1]), float(u[-1]))
