"""A table whose columns have the offsets and factors of [signals], once, where a log is read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.files.wrapped import WrappedTable

#: Metadata of a log that was written with its factors in: it must not get them again.
FACTORS = "signals_factors"


def scaled(table: TableSource, factors: Mapping[str, float], offsets: Mapping[str, float] | None = None) -> TableSource:
    """The table with each channel less its offset, times its factor; itself, bit by bit, where no channel has any.

    Raises
    ------
    DataError : the log was written by this tool with such factors in it already.
    """
    mine, off = applied(table, factors, offsets)
    if not mine and not off:
        return table
    if table.metadata.get(FACTORS):
        raise DataError(
            f"{table.name}: the factors of [signals] are in it already ({table.metadata[FACTORS]})",
            "leave signals.u_sign and the keys of its scales and offsets out for this log",
        )
    return _ScaledTable(table, mine, off)


def applied(
    table: TableSource, factors: Mapping[str, float], offsets: Mapping[str, float] | None = None
) -> tuple[dict[str, float], dict[str, float]]:
    """(factors that are not 1, offsets) of the channels that the table has."""
    mine = {channel: factor for channel, factor in factors.items() if channel in table.columns and factor != 1.0}
    return mine, {channel: offset for channel, offset in (offsets or {}).items() if channel in table.columns}


def factors_text(factors: Mapping[str, float], offsets: Mapping[str, float] | None = None) -> str:
    """For the metadata: `u - 1.65, u x -1, position x 0.0174533`."""
    zeros = [f"{channel} - {offset:.12g}" for channel, offset in (offsets or {}).items()]
    return ", ".join([*zeros, *(f"{channel} x {factor:.12g}" for channel, factor in factors.items())])


class _ScaledTable(WrappedTable):
    """With channels less their offsets, multiplied."""

    def __init__(self, table: TableSource, factors: Mapping[str, float], offsets: Mapping[str, float]) -> None:
        super().__init__(table)
        self._factors = factors
        self._offsets = offsets

    def batches(self) -> Iterator[Batch]:
        for batch in self._table.batches():
            with np.errstate(over="ignore"):  # what overflows is not finite, and dropped as such
                columns = batch.columns
                columns = {**columns, **{c: columns[c] - off for c, off in self._offsets.items() if c in columns}}
                columns = {**columns, **{c: columns[c] * f for c, f in self._factors.items() if c in columns}}
            yield batch._replace(columns=columns)
