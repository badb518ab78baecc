"""Parquet in: batches of float64 with memory that does not grow with the file."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.arrow_arrays import as_float64, in_record, is_number_type, numbers, records_of, texts_of
from dsd_cli.files.formats.messages import LONGEST_ARRAY
from dsd_cli.files.table_source import Batch, choose_columns

BATCH_ROWS = 1 << 17
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
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            raise DataError(f"{name}: not a readable Parquet file ({_first_line(error)})", "write it again") from None
        schema = self._file.schema_arrow
        self._members, self._records = self._lists(), records_of(schema)
        self._home = {name: column for name, (column, *_) in (self._members | self._records).items()}
        nested = set(self._home.values())
        self.column_names: list[str] = [*(name for name in schema.names if name not in nested), *self._home]
        self.columns = choose_columns(name, self.column_names, columns, optional)
        self.metadata = key_values(self._file.metadata.metadata)
        self.warnings: list[str] = []
        self.unreadable = 0
        for column in self.columns.values():
            if column not in self._home:
                _check_type(name, column, schema.field(column).type)
        if self._file.metadata.num_rows == 0:
            raise DataError(f"{name}: has no rows")

    @property
    def rows(self) -> int:
        """In the file."""
        return int(self._file.metadata.num_rows)

    def peek(self, rows: int) -> dict[str, Any]:
        """Column -> Arrow array of its first rows."""
        import pyarrow as pa

        flat = [field.name for field in self._file.schema_arrow if not pa.types.is_nested(field.type)]
        try:
            batch = next(self._file.iter_batches(rows, columns=self._read_of([*flat, *self._home]), **_as_usual()))
            found = {name: batch.column(name) for name in flat}
            return found | {name: self._column(batch, name) for name in self._home}
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            raise DataError(f"{self.name}: is damaged ({_first_line(error)})", "write it again") from None

    def texts(self, column: str) -> list[str]:
        """All cells of a column, as they are written."""
        import pyarrow as pa

        try:
            parts = [batch.column(0) for batch in self._file.iter_batches(BATCH_ROWS, columns=[column], **_as_usual())]
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            raise DataError(f"{self.name}: is damaged ({_first_line(error)})", "write it again") from None
        return ["" if text is None else str(text) for part in parts for text in texts_of(part) or part.to_pylist()]

    def _lists(self) -> dict[str, tuple[str, int]]:
        """`column/1`, ... -> column and place in it, of columns of lists of numbers, as long as the first row's are."""
        import pyarrow as pa

        lists = [
            field.name
            for field in self._file.schema_arrow
            if _is_list(field.type) and is_number_type(field.type.value_type)
        ]
        if not lists or not self._file.metadata.num_rows:
            return {}
        try:
            first = next(self._file.iter_batches(1, columns=lists, **_as_usual()))
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            raise DataError(f"{self.name}: is damaged ({_first_line(error)})", "write it again") from None
        sizes = {name: len(first.column(name)[0].as_py() or ()) for name in lists}
        return {f"{name}/{k + 1}": (name, k) for name, n in sizes.items() if n <= LONGEST_ARRAY for k in range(n)}

    def _read_of(self, columns: Collection[str]) -> list[str]:
        """The columns of the file that hold these."""
        return list(dict.fromkeys(self._home.get(name, name) for name in columns))

    def _column(self, batch: Any, name: str) -> Any:
        """A column as an Arrow array; of lists the member, NaN where a list is shorter or not there."""
        if name in self._records:
            column, *way = self._records[name]
            return in_record(batch.column(column), way)
        if name not in self._members:
            return batch.column(name)
        import pyarrow.compute as pc

        column, at = self._members[name]
        lists = batch.column(column)
        lengths = np.nan_to_num(as_float64(pc.list_value_length(lists))).astype(np.int64)
        there = lengths > at
        values = np.full(lengths.size, np.nan)
        values[there] = as_float64(lists.flatten())[(np.cumsum(lengths) - lengths + at)[there]]
        return numbers(values)

    def batches(self) -> Iterator[Batch]:
        import pyarrow as pa

        try:
            columns = self._read_of(self.columns.values())
            for batch in self._file.iter_batches(BATCH_ROWS, columns=columns, **_as_usual()):
                values = {c: as_float64(self._column(batch, name)) for c, name in self.columns.items()}
                yield Batch(batch.num_rows, values)
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            raise DataError(f"{self.name}: is damaged ({_first_line(error)})", "write it again") from None


def _as_usual() -> dict[str, bool]:
    return {"use_threads": threaded()}


def _is_list(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind))


def threaded() -> bool:
    """Whether Arrow may decode in threads of its own: not where the environment gives it one core."""
    import pyarrow as pa

    return bool(pa.cpu_count() > 1)


def arrow_source(name: str) -> Any:
    """What Arrow opens: the name, or the open file where the name is no text."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return open(name, "rb")
    return name


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
