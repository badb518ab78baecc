"""Parquet in: batches of float64 with memory that does not grow with the file."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

from dsd_cli.errors import DataError
from dsd_cli.files.arrow_arrays import as_float64, is_number_type
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

    @property
    def rows(self) -> int:
        """In the file."""
        return int(self._file.metadata.num_rows)

    def peek(self, rows: int) -> dict[str, Any]:
        """Column -> Arrow array of its first rows; columns of records are left out."""
        import pyarrow as pa

        flat = [field.name for field in self._file.schema_arrow if not pa.types.is_nested(field.type)]
        try:
            batch = next(self._file.iter_batches(rows, columns=flat, use_threads=threaded()))
        except (pa.ArrowException, OSError) as error:
            raise DataError(f"{self.name}: is damaged ({_first_line(error)})", "write it again") from None
        return dict(zip(batch.schema.names, batch.columns, strict=True))

    def batches(self) -> Iterator[Batch]:
        import pyarrow as pa

        try:
            columns = list(dict.fromkeys(self.columns.values()))
            for batch in self._file.iter_batches(BATCH_ROWS, columns=columns, use_threads=threaded()):
                values = {c: as_float64(batch.column(name)) for c, name in self.columns.items()}
                yield Batch(batch.num_rows, values)
        except (pa.ArrowException, OSError) as error:
            raise DataError(f"{self.name}: is damaged ({_first_line(error)})", "write it again") from None


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
