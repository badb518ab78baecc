"""How label and log columns are stored, and arrays as Arrow record batches of these kinds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsd_cli.files.arrow_arrays import numbers, texts
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class Coded:
    """A column that takes few values: what is written are places in `values` (never negative), shape (rows,)."""

    values: Array


@dataclass(frozen=True)
class Share:
    """A column in [0, 1]: float32 in Parquet; in CSV four decimals, which are looked up and so cost a sixth."""


SHARE_STEPS = 10_000

#: How a column is stored: a NumPy dtype's name ("float64", "float32", "int16", "int32", "bool"), or one of the above.
Kind = str | Coded | Share


def _arrow_type(kind: Kind, as_text: bool) -> Any:
    import pyarrow as pa

    if isinstance(kind, Coded):
        return pa.dictionary(pa.int32(), pa.string() if as_text else pa.float64())
    if isinstance(kind, Share):
        return pa.dictionary(pa.int32(), pa.string()) if as_text else pa.float32()
    return pa.from_numpy_dtype(np.dtype(kind))


def arrow_schema(columns: Mapping[str, Kind], as_text: bool) -> Any:
    import pyarrow as pa

    return pa.schema([(name, _arrow_type(kind, as_text)) for name, kind in columns.items()])


def arrow_batch(columns: Mapping[str, Kind], arrays: Mapping[str, ArrayLike], as_text: bool) -> Any:
    """The columns as an Arrow record batch; coded values as text where every value costs its formatting."""
    import pyarrow as pa

    parts = []
    for name, kind in columns.items():
        if isinstance(kind, Coded):
            codes = np.ascontiguousarray(arrays[name], dtype=np.int32)
            values = np.asarray(kind.values, dtype=float)
            listed = texts([repr(value) for value in values.tolist()]) if as_text else numbers(values)
            parts.append(pa.DictionaryArray.from_arrays(numbers(codes), listed))
        elif isinstance(kind, Share) and as_text:
            parts.append(_share_texts(np.asarray(arrays[name], dtype=np.float32)))
        else:
            dtype = np.float32 if isinstance(kind, Share) else kind
            parts.append(numbers(np.ascontiguousarray(arrays[name], dtype=dtype)))
    return pa.RecordBatch.from_arrays(parts, schema=arrow_schema(columns, as_text))


def _share_texts(shares: NDArray[np.float32]) -> Any:
    import pyarrow as pa

    places = np.rint(np.clip(shares, 0, 1) * np.float32(SHARE_STEPS))
    codes = np.where(np.isnan(places), SHARE_STEPS + 1, places).astype(np.int32)
    return pa.DictionaryArray.from_arrays(numbers(codes), _share_table())


@cache
def _share_table() -> Any:
    """The text of every step of a share, and of no share at all."""
    return texts([*(repr(step / SHARE_STEPS) for step in range(SHARE_STEPS + 1)), "nan"])
