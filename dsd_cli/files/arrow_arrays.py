"""Arrow arrays to NumPy and back, by their buffers.

Arrow's own ways (`pa.array`, `to_numpy`, `fill_null`) import numpy.ma, and pandas wherever that is installed, the first
time that a process takes one of them: half of a short run.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsd_cli.files.table_source import missing
from dsd_cli.signals.log import Array

Scalar = str | float | int | bool | None
_PER_SECOND = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}


def as_float64(column: Any) -> Array:
    """An Arrow array as float64: nulls are NaN, times are seconds; no copy where it is one already."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_dictionary(kind):
        column, kind = column.dictionary_decode(), kind.value_type
    if pa.types.is_null(kind) or not len(column):
        return missing(len(column))
    if pa.types.is_decimal(kind):
        column = column.cast(pa.float64())
    values: Array = _seconds(column) if hasattr(kind, "unit") else _values(column).astype(np.float64, copy=False)
    return np.where(_bits(column, 0), values, np.nan) if column.null_count else values


def _values(column: Any) -> NDArray[Any]:
    """Numbers and booleans, shape (rows,), without a copy; where one is missing, anything may stand."""
    import pyarrow as pa

    if pa.types.is_boolean(column.type):
        return _bits(column, 1)
    dtype = np.dtype(column.type.to_pandas_dtype())
    return np.frombuffer(column.buffers()[1], dtype, len(column), column.offset * dtype.itemsize)


def _bits(column: Any, buffer: int) -> NDArray[np.bool_]:
    """The bits of a buffer, shape (rows,): 0 has those of values that are there, 1 those of booleans."""
    packed = np.frombuffer(column.buffers()[buffer], np.uint8)
    return np.unpackbits(packed, count=column.offset + len(column), bitorder="little")[column.offset :].view(np.bool_)


def _seconds(column: Any) -> Array:
    """Times as s: whole seconds and the rest apart, for nanoseconds since 1970 do not fit a float64."""
    import pyarrow as pa

    per_second = _PER_SECOND[column.type.unit]
    ticks = _values(column.view(pa.int32() if pa.types.is_time32(column.type) else pa.int64()))
    whole, rest = np.divmod(ticks, per_second)
    seconds: Array = whole + rest / per_second
    return seconds


def is_number_type(kind: Any) -> bool:
    """Whether a column of this Arrow type can be read as numbers."""
    import pyarrow as pa

    value = kind.value_type if pa.types.is_dictionary(kind) else kind
    number = (pa.types.is_integer, pa.types.is_floating, pa.types.is_decimal, pa.types.is_boolean, pa.types.is_null)
    time = (pa.types.is_timestamp, pa.types.is_duration, pa.types.is_time)
    return any(check(value) for check in (*number, *time))


def texts_of(column: Any) -> list[str | None] | None:
    """The texts of an Arrow array, bytes that are no UTF-8 replaced; None: it holds something else."""
    import pyarrow as pa

    if pa.types.is_dictionary(column.type):
        column = column.dictionary_decode()
    if not (pa.types.is_string(column.type) or pa.types.is_large_string(column.type)):
        return None
    try:
        return list(column.to_pylist())
    except UnicodeDecodeError:
        return [None if raw is None else raw.decode("utf-8", "replace") for raw in column.cast(pa.binary()).to_pylist()]


def records_of(schema: Any) -> dict[str, tuple[str, ...]]:
    """`column/field`, ... -> the way to it, of the numbers in columns of records, to any depth."""
    import pyarrow as pa

    found: dict[str, tuple[str, ...]] = {}

    def collect(kind: Any, way: tuple[str, ...]) -> None:
        for field in kind:
            if pa.types.is_struct(field.type):
                collect(field.type, (*way, field.name))
            elif way and is_number_type(field.type):
                found["/".join((*way, field.name))] = (*way, field.name)

    collect(schema, ())
    return found


def in_record(column: Any, way: Sequence[str]) -> Any:
    """What lies there in an array of records; null where a record around it is."""
    for name in way:
        column = column.flatten()[column.type.get_field_index(name)]
    return column


def numbers(values: NDArray[Any], there: NDArray[np.bool_] | None = None) -> Any:
    """Numbers or booleans as an Arrow array; null where not `there`."""
    import pyarrow as pa

    data = np.packbits(values, bitorder="little") if values.dtype == np.bool_ else np.ascontiguousarray(values)
    kind = pa.bool_() if values.dtype == np.bool_ else pa.from_numpy_dtype(values.dtype)
    return pa.Array.from_buffers(kind, values.size, [_validity(there), pa.py_buffer(data)])


def texts(values: Sequence[str], there: NDArray[np.bool_] | None = None) -> Any:
    """Texts as an Arrow array; null where not `there`."""
    import pyarrow as pa

    parts = [value.encode() for value in values]
    ends = np.cumsum([0, *map(len, parts)], dtype=np.int32)
    data = [_validity(there), pa.py_buffer(ends), pa.py_buffer(b"".join(parts))]
    return pa.Array.from_buffers(pa.string(), len(parts), data)


def arrow_column(values: Sequence[Scalar], kind: Any) -> Any:
    """`pa.array(values, kind)` for texts, numbers and booleans; None is null."""
    import pyarrow as pa

    there = np.array([value is not None for value in values], dtype=bool)
    if pa.types.is_string(kind):
        return texts(["" if value is None else str(value) for value in values], there)
    dtype = np.dtype(kind.to_pandas_dtype())
    return numbers(np.array([0 if value is None else value for value in values], dtype=dtype), there)


def _validity(there: NDArray[np.bool_] | None) -> Any:
    import pyarrow as pa

    return None if there is None or there.all() else pa.py_buffer(np.packbits(there, bitorder="little"))
