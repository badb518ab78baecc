"""A table whose columns are multiplied by the factors of [signals], once, where a log is read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.files.wrapped import WrappedTable

#: Metadata of a log that was written with its factors in: it must not get them again.
FACTORS = "signals_factors"


def scaled(table: TableSource, factors: Mapping[str, float]) -> TableSource:
    """The table with each channel times its factor; the table itself, bit by bit, where none of its channels has one.

    Raises
    ------
    DataError : the log was written by this tool with such factors in it already.
    """
    mine = {channel: factor for channel, factor in factors.items() if channel in table.columns and factor != 1.0}
    if not mine:
        return table
    if table.metadata.get(FACTORS):
        raise DataError(
            f"{table.name}: the factors of [signals] are in it already ({table.metadata[FACTORS]})",
            "leave signals.u_sign, u_scale, velocity_scale and position_scale out for this log",
        )
    return _ScaledTable(table, mine)


def factors_text(factors: Mapping[str, float]) -> str:
    """For the metadata: `u x -1, position x 0.0174533`."""
    return ", ".join(f"{channel} x {factor:.12g}" for channel, factor in factors.items())


class _ScaledTable(WrappedTable):
    """With channels multiplied."""

    def __init__(self, table: TableSource, factors: Mapping[str, float]) -> None:
        super().__init__(table)
        self._factors = factors

    def batches(self) -> Iterator[Batch]:
        for batch in self._table.batches():
            with np.errstate(over="ignore"):  # what overflows is not finite, and dropped as such
                changed = {c: batch.columns[c] * f for c, f in self._factors.items() if c in batch.columns}
            yield batch._replace(columns={**batch.columns, **changed})
