"""A table whose d_hat was made by another observer (`[observer] filter` and `u`), as that of this package has it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dsd_cli.files.table_source import D_HAT_SOURCE, Batch, TableSource
from dsd_cli.files.wrapped import ClockedTable
from dsd_cli.plant.maker import Maker, Remade, remade
from dsd_cli.signals.log import D_HAT_MAKER


class Made(NamedTuple):
    """How a logged d_hat was made. time_constant : s; sign : of d_hat against eq. 13."""

    maker: Maker = Maker()
    time_constant: float = 0.0
    sign: int = 1


def as_observed(table: TableSource, made: Made, time_scale: float, sample_time: float | None) -> TableSource:
    """The table with d_hat as the observer of this package makes it; the table itself, bit by bit, where it does.

    The same holds where d_hat is not read, and where `dsd` itself has made it. What averages two intervals says so in
    the metadata, as a d_hat from position does.

    Parameters
    ----------
    time_scale : s per unit of the stamps. sample_time : s from row to row, where there are no stamps.
    """
    own = table.metadata.get(D_HAT_SOURCE) in ("velocity", "position")
    if made.maker.as_here or own or "d_hat" not in table.columns:
        return table
    return _Remade(table, made, time_scale, sample_time)


class _Remade(ClockedTable):
    """Each row as it comes: the ones before it are all that is needed."""

    def __init__(self, table: TableSource, made: Made, time_scale: float, sample_time: float | None) -> None:
        super().__init__(table, time_scale, sample_time)
        self._made = made
        self.metadata = {**table.metadata, D_HAT_MAKER: str(made.maker)}
        if made.maker.intervals == 2:
            self.metadata[D_HAT_SOURCE] = "position"

    def batches(self) -> Iterator[Batch]:
        """The same rows. One with a value that is no number, or with the stamp of the one before, is passed over; a
        stamp that goes back begins anew."""
        state = Remade()
        for batch, t in self.timed():
            if batch.restart:
                state = Remade()
            u, d_hat = batch.columns["u"], batch.columns["d_hat"]
            kept = np.flatnonzero(np.isfinite(t) & np.isfinite(u) & np.isfinite(d_hat))
            new = np.diff(t[kept], prepend=state.t) != 0.0
            kept = kept[new]
            found, sign = d_hat.copy(), self._made.sign
            here, state = remade(
                t[kept], u[kept], sign * d_hat[kept], self._made.maker, self._made.time_constant, state
            )
            found[kept] = sign * here
            yield batch._replace(columns={**batch.columns, "d_hat": found})
