"""Columns as lines of CSV: a number is the shortest text that reads as it, NaN is nan, and nothing is quoted.

Arrow searches that text for every float and copies every cell twice, which took longer than to label the rows. Most
stamps are decimals and have it at hand, all else comes from short lists: `_csv_text.c` puts them together. Other
floats, and all where there was no compiler, are Arrow's, to the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsd_cli.files.arrow_arrays import numbers, texts
from dsd_cli.files.columns_out import Coded, Kind, Rounded, Share, arrow_batch, coded_texts, share_places, share_table
from dsd_cli.signals.compiled import compiled_module

#: Rows at a time.
ROWS = 1 << 16
#: Bytes that are handed out at a time: to write 3 MB at once takes Linux three times as long as in pieces.
PIECE = 1 << 18
#: A column for `_csv_text.c`: see `lines` there.
_Column = tuple[int, Any, Any, Any, Any]

#: The compiled module, or None where the build had no compiler.
COMPILED = compiled_module("dsd_cli.files._csv_text")


class CsvText:
    """Turns rows of these columns into lines."""

    def __init__(self, columns: Mapping[str, Kind], compiled: Any = COMPILED) -> None:
        self._columns, self._compiled = dict(columns), compiled
        self._room = bytearray()  # the same for all rows: new memory is cleared first, which takes time

    def lines(self, arrays: Mapping[str, ArrayLike]) -> Iterator[memoryview]:
        """Their text piece by piece, which the next call overwrites; every array of shape (n,)."""
        given = {name: np.asarray(arrays[name]) for name in self._columns}
        rows = next(iter(given.values())).size
        for begin in range(0, rows, ROWS):
            part = {name: values[begin : begin + ROWS] for name, values in given.items()}
            text = _by_arrow(self._columns, part) if self._compiled is None else self._joined(part)
            for at in range(0, len(text), PIECE):
                yield text[at : at + PIECE]

    def _joined(self, arrays: Mapping[str, NDArray[Any]]) -> memoryview:
        rows = next(iter(arrays.values())).size
        made = [_column(self._compiled, kind, arrays[name]) for name, kind in self._columns.items()]
        if (size := self._compiled.lines(rows, made, self._room)) < 0:
            self._room = bytearray(-size)
            size = self._compiled.lines(rows, made, self._room)
        return memoryview(self._room)[:size]


def _by_arrow(columns: Mapping[str, Kind], arrays: Mapping[str, NDArray[Any]]) -> memoryview:
    return memoryview(_written(arrow_batch(columns, arrays, as_text=True)))


def _written(batch: Any) -> Any:
    """What Arrow writes of a record batch, without a header."""
    import pyarrow as pa
    import pyarrow.csv as pc

    text = pa.BufferOutputStream()
    # with Arrow's own 1024 rows at a time the columns' start-up is a tenth of the writing
    options = pc.WriteOptions(include_header=False, quoting_style="none", batch_size=4096)
    pc.write_csv(batch, text, options)
    return text.getvalue()


def _column(compiled: Any, kind: Kind, values: NDArray[Any]) -> _Column:
    match kind:
        case Coded():
            return _listed(values, coded_texts(kind))
        case Share():
            return _listed(share_places(values), share_table())
        case "bool":
            return _listed(values, _booleans())
        case Rounded():
            return _numbers(compiled, values, kind.places)
        case "float64" | "int16" | "int32":
            return _numbers(compiled, values, None)
    raise AssertionError(f"{kind}: no column of ours in CSV")


def _listed(places: NDArray[Any], table: Any) -> _Column:
    return -1, np.ascontiguousarray(places, dtype=np.int32), b"", *table.buffers()[1:]


def _numbers(compiled: Any, values: NDArray[Any], places: int | None) -> _Column:
    values = np.ascontiguousarray(values, dtype=np.float64)
    marks = np.empty(values.size, dtype=np.uint8)
    found = compiled.marks(values, -1 if places is None else places, marks)
    others = values[marks == 0]
    if not others.size:
        return found, values, marks, np.zeros(1, dtype=np.int32), b""
    found_texts = _searched(others if places is None else Rounded.rounded(others, places))
    return max(found, 0), values, marks, *found_texts


def _searched(values: NDArray[np.float64]) -> tuple[Any, Any]:
    """What Arrow writes, a text a line: where each line ends, and the lines.

    Not by `cast`: that is in pyarrow.compute, whose import (0.03 s) is a tenth of a short run.
    """
    import pyarrow as pa

    text = _written(pa.RecordBatch.from_arrays([numbers(values)], ["values"]))
    ends = np.zeros(values.size + 1, np.int32)
    ends[1:] = np.flatnonzero(np.frombuffer(text, np.uint8) == ord("\n")) + 1
    return ends, text


@cache
def _booleans() -> Any:
    return texts(["false", "true"])
