"""A table that hands on what another one says of itself, for those that change only its rows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.signals.log import Array


class WrappedTable:
    """See `TableSource`; a live stream may change what it says while it is read."""

    def __init__(self, table: TableSource) -> None:
        self._table = table
        self.name, self.metadata = table.name, table.metadata

    @property
    def column_names(self) -> list[str]:
        return self._table.column_names

    @property
    def columns(self) -> dict[str, str]:
        return self._table.columns

    @property
    def warnings(self) -> list[str]:
        return self._table.warnings

    @property
    def unreadable(self) -> int:
        return self._table.unreadable


class ClockedTable(WrappedTable):
    """One that looks at the time of each row.

    Parameters
    ----------
    time_scale : s per unit of the stamps. sample_time : s from row to row, where there are no stamps.
    """

    def __init__(self, table: TableSource, time_scale: float, sample_time: float | None) -> None:
        super().__init__(table)
        self._time_scale, self._sample_time = time_scale, sample_time or 0.0

    def timed(self) -> Iterator[tuple[Batch, Array]]:
        """The rows of the table, and their stamps, s, shape (rows,)."""
        before = 0
        for batch in self._table.batches():
            if "t" in batch.columns:
                yield batch, np.asarray(batch.columns["t"] * self._time_scale)
            else:
                yield batch, np.asarray((before + np.arange(batch.rows)) * self._sample_time)
            before += batch.rows
