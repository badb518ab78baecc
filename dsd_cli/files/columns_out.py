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


@dataclass(frozen=True)
class Rounded:
    """A column of numbers: float32 in Parquet; in CSV so many decimals."""

    places: int

    @staticmethod
    def rounded(values: Array, places: int) -> Array:
        """Halves to even; what is not finite stays, and no zero is negative."""
        with np.errstate(over="ignore"):
            scaled = values * 10.0**places
        return np.where(np.isfinite(scaled), np.rint(scaled) / 10.0**places + 0.0, values)


#: How a column is stored: a NumPy dtype's name ("float64", "int16", "int32", "bool"), or one of the above.
Kind = str | Coded | Share | Rounded


def _arrow_type(kind: Kind, as_text: bool) -> Any:
    import pyarrow as pa

    match kind:
        case Coded():
            return pa.dictionary(pa.int32(), pa.string() if as_text else pa.float64())
        case Share():
            return pa.dictionary(pa.int32(), pa.string()) if as_text else pa.float32()
        case Rounded():
            return pa.float64() if as_text else pa.float32()
    return pa.from_numpy_dtype(np.dtype(kind))


def arrow_schema(columns: Mapping[str, Kind], as_text: bool) -> Any:
    import pyarrow as pa

    return pa.schema([(name, _arrow_type(kind, as_text)) for name, kind in columns.items()])


def arrow_batch(columns: Mapping[str, Kind], arrays: Mapping[str, ArrayLike], as_text: bool) -> Any:
    """The columns as an Arrow record batch; coded values as text where every value costs its formatting."""
    import pyarrow as pa

    parts = [_arrow_array(kind, np.asarray(arrays[name]), as_text) for name, kind in columns.items()]
    return pa.RecordBatch.from_arrays(parts, schema=arrow_schema(columns, as_text))


def _arrow_array(kind: Kind, values: NDArray[Any], as_text: bool) -> Any:
    import pyarrow as pa

    match kind:
        case Coded():
            listed = coded_texts(kind) if as_text else numbers(np.asarray(kind.values, dtype=float))
            return pa.DictionaryArray.from_arrays(numbers(np.ascontiguousarray(values, dtype=np.int32)), listed)
        case Share() if as_text:
            return pa.DictionaryArray.from_arrays(numbers(share_places(values)), share_table())
        case Rounded() if as_text:
            return numbers(kind.rounded(np.asarray(values, dtype=float), kind.places))
    return numbers(np.ascontiguousarray(values, dtype=kind if isinstance(kind, str) else np.float32))


def coded_texts(kind: Coded) -> Any:
    """The text of every value."""
    return texts([repr(value) for value in np.asarray(kind.values, dtype=float).tolist()])


def share_places(shares: NDArray[Any]) -> NDArray[np.int32]:
    """Where in `share_table` each stands."""
    places = np.rint(np.clip(shares.astype(np.float32), 0, 1) * np.float32(SHARE_STEPS))
    return np.where(np.isnan(places), SHARE_STEPS + 1, places).astype(np.int32)


@cache
def share_table() -> Any:
    """The text of every step of a share, and of no share at all."""
    return texts([*(repr(step / SHARE_STEPS) for step in range(SHARE_STEPS + 1)), "nan"])
