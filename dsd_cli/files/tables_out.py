"""Tables out: CSV or Parquet, whole or not at all."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from types import TracebackType
from typing import Any, Protocol

from numpy.typing import ArrayLike

from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.columns_out import Coded, Kind, Rounded, Share, arrow_batch, arrow_schema
from dsd_cli.files.csv_text import CsvText
from dsd_cli.files.table_source import sidecar
from dsd_cli.files.tables_in import STDIN as STDOUT
from dsd_cli.files.whole import WholeFile, cannot_be_written, check_target, is_same

__all__ = ["Coded", "FileWriter", "Kind", "Rounded", "Share", "TableWriter", "check_output", "open_writer"]

#: Rows of a Parquet row group; they are held until it is full.
GROUP_ROWS = 1 << 18
#: Batches that wait for the writing thread.
QUEUED = 2


class TableWriter(Protocol):
    """Takes batches of columns; nothing is visible before `commit`, except on stdout."""

    def write(self, columns: Mapping[str, ArrayLike]) -> None:
        """Append rows. The arrays belong to the writer from here on: do not change them."""

    def commit(self) -> None: ...

    def abort(self) -> None: ...

    def __enter__(self) -> TableWriter: ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Commit when all went well, abort on any exception."""


def open_writer(
    path: str | Path,
    columns: Mapping[str, Kind],
    metadata: Mapping[str, str] | None = None,
    inputs: Sequence[str | Path] = (),
) -> TableWriter:
    """A writer for `.csv`, `.parquet` or `.pq`, or CSV on stdout for "-".

    Parameters
    ----------
    metadata : key-value metadata of a Parquet file, `<file>.meta.json` next to a CSV file; not on stdout.
    inputs : files that must not be written over.

    Raises
    ------
    UsageError : another suffix, or `path` is one of the inputs.
    DataError : the folder is not there or cannot be written to.
    """
    if str(path) == STDOUT:
        return _Stdout(columns)
    return FileWriter(check_output(path, inputs), columns, metadata or {})


def check_output(path: str | Path, inputs: Sequence[str | Path] = ()) -> Path:
    """The path, if it can be an output; see `open_writer`."""
    target = Path(path)
    if target.suffix.lower() not in (".csv", ".parquet", ".pq"):
        raise UsageError(f"{path}: not known what to write", "end the name in .csv or .parquet")
    check_target(target, inputs)
    if target.suffix.lower() != ".csv" and target.exists() and not target.is_file():
        raise UsageError(f"{path}: a Parquet file cannot go into a FIFO or a device", "end the name in .csv")
    if target.suffix.lower() == ".csv" and any(is_same(sidecar(target), source) for source in inputs):
        raise UsageError(f"{sidecar(target)}: is the input", "write to another file")
    if target.suffix.lower() == ".csv" and sidecar(target).exists() and not sidecar(target).is_file():
        raise UsageError(f"{sidecar(target)}: is no file, and belongs to what is written", "write to another file")
    return target


class FileWriter:
    """Writes in a thread of its own, to a temporary file next to the target that takes its name at `commit`."""

    def __init__(self, target: Path, columns: Mapping[str, Kind], metadata: Mapping[str, str]) -> None:
        self._target = target
        self._columns = dict(columns)
        self._metadata = dict(metadata)
        self._is_csv = target.suffix.lower() == ".csv"
        # a signal may interrupt anything that is written in Python with its lock held: these two are not
        self._queue: SimpleQueue[Any] = SimpleQueue()
        self._room: SimpleQueue[None] = SimpleQueue()
        for _ in range(QUEUED):
            self._room.put(None)
        self._error: BaseException | None = None
        self._out = WholeFile(target)
        self._thread = Thread(target=self._run, name="writer", daemon=True)
        try:
            self._file = _opened(self._out.path)
            self._thread.start()
        except OSError as error:
            self._out.abort()
            raise cannot_be_written(target, error) from None

    def write(self, columns: Mapping[str, ArrayLike]) -> None:
        self._raise()
        self._room.get()
        self._queue.put(columns)

    def commit(self) -> None:
        try:
            self._close()
            self._raise()
            self._take_names()
        except OSError as error:
            raise cannot_be_written(self._target, error) from None
        finally:
            self.abort()

    def _take_names(self) -> None:
        """Metadata that is not of this data would be worse than none: at no time do the two stand side by side."""
        beside = None
        try:
            if self._is_csv and self._out.replaces:
                if self._metadata:
                    import json

                    beside = WholeFile(sidecar(self._out.target))
                    beside.path.write_bytes((json.dumps(self._metadata, indent=1) + "\n").encode())
                sidecar(self._out.target).unlink(missing_ok=True)
            self._out.commit()
            if beside is not None:
                beside.commit()
        finally:
            if beside is not None:
                beside.abort()

    def abort(self) -> None:
        """Leave nothing, however far it got; after `commit` it does nothing."""
        try:
            self._close()
        finally:
            self._out.abort()

    def __enter__(self) -> FileWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if kind is not None:
            self.abort()
        else:
            self.commit()

    def _close(self) -> None:
        """End the thread, then close what it writes to; whatever interrupts this, the next call goes on with it."""
        while self._thread.is_alive():
            self._queue.put(None)
            self._thread.join(0.1)
        if not self._file.closed:
            self._file.close()

    def _raise(self) -> None:
        if self._error is not None:
            self.abort()
            if isinstance(self._error, BrokenPipeError):
                raise self._error
            if isinstance(self._error, OSError):
                raise cannot_be_written(self._target, self._error) from self._error
            raise DataError(f"{self._target}: cannot be written ({self._error})") from self._error

    def _run(self) -> None:
        """Write what is queued until None comes; after a failure only empty the queue, so that nobody waits for it."""
        columns: Any = ...
        try:
            with self._sink() as sink:
                while (columns := self._next()) is not None:
                    sink(columns)
        except BaseException as error:
            self._error = error
            while columns is not None:
                columns = self._next()

    def _next(self) -> Any:
        columns = self._queue.get()
        self._room.put(None)
        return columns

    @contextlib.contextmanager
    def _sink(self) -> Iterator[Callable[[Mapping[str, ArrayLike]], Any]]:
        """A function that writes batches of columns."""
        if self._is_csv:
            self._file.write(_csv_header(self._columns))
            text = CsvText(self._columns)
            yield lambda columns: [self._file.write(part) for part in text.lines(columns)]
            return
        with self._parquet() as writer:
            groups = _Groups(writer, self._columns)
            yield groups.add
            groups.write()

    @contextlib.contextmanager
    def _parquet(self) -> Iterator[Any]:
        """Arrow's writer."""
        import pyarrow.parquet as pq

        # few-valued columns get a dictionary; hashing every float, only to find that none repeats, is most of the cost
        few = [name for name, kind in self._columns.items() if isinstance(kind, Coded) or str(kind).startswith("int")]
        schema = arrow_schema(self._columns, as_text=False).with_metadata(self._metadata or None)
        with pq.ParquetWriter(
            self._file, schema, use_dictionary=few or False, compression="snappy", store_schema=False
        ) as writer:
            if self._metadata:
                writer.add_key_value_metadata(self._metadata)
            yield writer


class _Groups:
    """Rows held until they are a row group."""

    def __init__(self, writer: Any, columns: Mapping[str, Kind]) -> None:
        self._writer, self._columns = writer, columns
        self._held: list[Any] = []

    def add(self, columns: Mapping[str, ArrayLike]) -> None:
        self._held.append(arrow_batch(self._columns, columns, as_text=False))
        if sum(part.num_rows for part in self._held) >= GROUP_ROWS:
            self.write()

    def write(self) -> None:
        import pyarrow as pa

        if self._held:
            table = pa.Table.from_batches(self._held).replace_schema_metadata(self._writer.schema.metadata)
            self._writer.write_table(table, GROUP_ROWS)
            self._held = []


def _opened(path: Path) -> Any:
    """Arrow's own file, which unlike Python's is written without the GIL; it cannot take a name that is no text."""
    import pyarrow as pa

    try:
        str(path).encode()
    except UnicodeEncodeError:
        return pa.PythonFile(open(path, "wb"), mode="w")
    return pa.OSFile(str(path), "wb")


class _Stdout:
    """CSV on stdout, flushed with every batch; a closed pipe surfaces as BrokenPipeError."""

    def __init__(self, columns: Mapping[str, Kind]) -> None:
        self._text = CsvText(columns)
        self._put(_csv_header(columns))

    def write(self, columns: Mapping[str, ArrayLike]) -> None:
        for text in self._text.lines(columns):
            sys.stdout.buffer.write(text)
        sys.stdout.buffer.flush()

    def _put(self, content: Any) -> None:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()

    def commit(self) -> None:
        sys.stdout.buffer.flush()

    def abort(self) -> None:
        """What was written cannot be taken back."""

    def __enter__(self) -> _Stdout:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if kind is None:
            self.commit()


def _csv_header(columns: Mapping[str, Kind]) -> bytes:
    quoted = ('"' + name.replace('"', '""') + '"' if any(c in name for c in ',"\n\r') else name for name in columns)
    return (",".join(quoted) + "\n").encode()
