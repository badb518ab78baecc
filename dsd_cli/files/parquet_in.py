"""Parquet in: batches of float64 with memory that does not grow with the file."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.table_source import Batch, choose_columns, missing
from dsd_cli.signals.log import Array

BATCH_ROWS = 1 << 17
PER_SECOND = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}
_OWN_KEYS = {"ARROW:schema", "pandas"}


class ParquetTable:
    """A Parquet file, or the content of one; see `TableSource`."""

    def __init__(
        self, name: str, columns: Mapping[str, str], optional: Collection[str] = (), content: bytes | None = None
    ) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        self.name = name
        try:
            # with pre_buffer the memory grows with the file
            self._file = pq.ParquetFile(
                arrow_source(name) if content is None else pa.BufferReader(content),
                pre_buffer=False,
                buffer_size=1 << 20,
            )
        except (pa.ArrowException, OSError) as error:
            raise DataError(f"{name}: not a readable Parquet file ({_first_line(error)})", "write it again") from None
        schema = self._file.schema_arrow
        self.column_names: list[str] = list(schema.names)
        self.columns = choose_columns(name, self.column_names, columns, optional)
        self.metadata = key_values(self._file.metadata.metadata)
        self.warnings: list[str] = []
        self.unreadable = 0
        for column in self.columns.values():
            _check_type(name, column, schema.field(column).type)
        if self._file.metadata.num_rows == 0:
            raise DataError(f"{name}: has no rows")

    def batches(self) -> Iterator[Batch]:
        import pyarrow as pa

        try:
            for batch in self._file.iter_batches(BATCH_ROWS, columns=list(dict.fromkeys(self.columns.values()))):
                values = {c: as_float64(batch.column(name)) for c, name in self.columns.items()}
                yield Batch(batch.num_rows, values)
        except (pa.ArrowException, OSError) as error:
            raise DataError(f"{self.name}: is damaged ({_first_line(error)})", "write it again") from None


def arrow_source(name: str) -> Any:
    """What Arrow opens: the name, or the open file where the name is no text."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return open(name, "rb")
    return name


def as_float64(column: Any) -> Array:
    """An Arrow array as float64: nulls are NaN, times are seconds; no copy where it is one already."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_dictionary(kind):
        column, kind = column.dictionary_decode(), kind.value_type
    if pa.types.is_null(kind):
        return missing(len(column))
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time(kind):
        return _seconds(column)
    if not pa.types.is_float64(column.type):
        if pa.types.is_boolean(column.type):
            column = column.cast(pa.int8())
        import pyarrow.compute as pc  # 40 ms, and only needed for other types

        column = pc.cast(column, pa.float64(), safe=False)
    return column.to_numpy(zero_copy_only=False)


def _seconds(column: Any) -> Array:
    """Times as s: whole seconds and the rest apart, for nanoseconds since 1970 do not fit a float64."""
    import pyarrow as pa

    per_second = PER_SECOND[column.type.unit]
    ticks = column.cast(pa.int32() if pa.types.is_time32(column.type) else pa.int64())
    whole, rest = np.divmod(ticks.fill_null(0).to_numpy(zero_copy_only=False), per_second)
    stamps: Array = whole + rest / per_second
    if column.null_count:
        stamps[column.is_null().to_numpy(zero_copy_only=False)] = np.nan
    return stamps


def is_number_type(kind: Any) -> bool:
    """Whether a column of this Arrow type can be read as numbers."""
    import pyarrow as pa

    value = kind.value_type if pa.types.is_dictionary(kind) else kind
    number = (pa.types.is_integer, pa.types.is_floating, pa.types.is_decimal, pa.types.is_boolean, pa.types.is_null)
    time = (pa.types.is_timestamp, pa.types.is_duration, pa.types.is_time)
    return any(check(value) for check in (*number, *time))


def _check_type(source: str, column: str, kind: Any) -> None:
    import pyarrow as pa

    if not is_number_type(kind):
        value = kind.value_type if pa.types.is_dictionary(kind) else kind
        raise DataError(f'{source}: column "{column}" holds {value}, not numbers', "convert it to float64")


def key_values(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Key-value metadata as text, without what Arrow and pandas keep there for themselves."""
    decoded = {k.decode("utf-8", "replace"): v.decode("utf-8", "replace") for k, v in (metadata or {}).items()}
    return {key: value for key, value in decoded.items() if key not in _OWN_KEYS}


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0].strip().rstrip(".")
