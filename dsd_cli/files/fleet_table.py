"""The table of results of a fleet, and the journal that keeps its rows until all are there."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.arrow_arrays import arrow_column
from dsd_cli.files.whole import WholeFile, cannot_be_written, check_target

Row = Mapping[str, Any]
SUFFIXES = (".parquet", ".pq", ".csv")
#: The column that tells one log in one state with one config from another.
KEY = "key"
#: What the journal is called, after the table's name.
PART = ".part"
_BATCH = 2048
#: How a row begins in the journal.
_BEGIN = b'{"log": '


def check_table(path: str | Path, inputs: Collection[str | Path]) -> Path:
    """The path, if a table of results can be written there.

    Raises
    ------
    UsageError, DataError : another suffix, one of the inputs, a device, or a folder that cannot be written to.
    """
    target = Path(path)
    if target.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{path}: not known what to write", "end the name in .parquet or .csv")
    check_target(target, inputs)
    if target.exists() and not target.is_file():
        raise UsageError(f"{path}: results go into a file of their own")
    return target


class Journal:
    """Rows as JSON lines in `<table>.part`; each is on its way to the disk as soon as it is there.

    A run that was killed leaves it behind, and the next one goes on from it. Memory holds the place of each row only.

    Raises
    ------
    UsageError : another run is writing it, or a file of that name is none of ours.
    DataError : it cannot be written.
    """

    def __init__(self, table: Path) -> None:
        self.table, self.path = table, table.with_name(table.name + PART)
        self._places: dict[str, int] = {}
        if self.path.is_symlink() or (self.path.exists() and not self.path.is_file()):
            raise self._foreign()
        try:
            self._file = open(self.path, "a+b", opener=_no_link)  # noqa: SIM115 (open as long as the run)
        except OSError as error:
            raise cannot_be_written(self.path, error) from None
        try:
            _lock(self._file, self.path)
            self._read()
        except BaseException:
            self._file.close()
            raise

    def _read(self) -> None:
        """Places of the rows; what a killed run wrote by half is cut off."""
        self._file.seek(0)
        end = 0
        for line in self._file:
            if not line.startswith(_BEGIN[: len(line)]):
                raise self._foreign()
            if line.endswith(b"\n"):
                try:
                    self._places[str(json.loads(line)[KEY])] = end
                except (ValueError, TypeError, KeyError):
                    raise self._foreign() from None
                end += len(line)
        self._file.truncate(end)
        self._file.seek(0, os.SEEK_END)

    def _foreign(self) -> UsageError:
        why = "the rows of a run are kept under that name: rename it, or write to another file"
        return UsageError(f"{self.path}: is not of dsd fleet", why)

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, key: object) -> bool:
        return key in self._places

    def add(self, row: Row) -> None:
        """One more row."""
        place = self._file.seek(0, os.SEEK_END)
        try:
            self._file.write(json.dumps(row).encode() + b"\n")
            self._file.flush()
        except OSError as error:
            raise cannot_be_written(self.path, error) from None
        self._places[str(row[KEY])] = place

    def first(self) -> dict[str, Any]:
        """A row that is kept; nothing where there is none."""
        return next(self.rows(list(self._places)[:1]), {})

    def forget(self, keys: Collection[str]) -> None:
        """These rows are to be made again."""
        for key in keys:
            self._places.pop(key, None)

    def rows(self, keys: Sequence[str]) -> Iterator[dict[str, Any]]:
        """The rows of these keys, in that order."""
        for key in keys:
            self._file.seek(self._places[key])
            row: dict[str, Any] = json.loads(self._file.readline())
            yield row

    def finish(self, keys: Sequence[str], first: Sequence[str], part: Mapping[str, str] | None = None) -> None:
        """Write the table of these rows, columns `first` first, and take the journal away; `part` goes with it."""
        columns = columns_of(self.rows(keys), first)
        write_table(self.table, self.rows(keys), columns, part)
        self.path.unlink(missing_ok=True)
        self._file.close()

    def close(self) -> None:
        """A journal without rows goes; after `finish` nothing is left to do."""
        if not self._file.closed and not self._places:
            self.path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # what a full disk did not take: `add` has said so
            self._file.close()


def _no_link(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)


def _lock(file: Any, path: Path) -> None:
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise UsageError(f"{path}: another run is writing it", "wait for it, or write to another file") from None
    except OSError:  # a file system without locks
        return


def columns_of(rows: Iterable[Row], first: Sequence[str]) -> dict[str, Any]:
    """Column -> Arrow type, for everything that any row has; the order is the same whichever row comes first."""
    import pyarrow as pa

    kinds: dict[str, set[type]] = {name: set() for name in first}
    for row in rows:
        for name, value in row.items():
            kinds.setdefault(name, set()).update(() if value is None else (type(value),))
    of_a_log = sorted((name for name in kinds if "." in name), reverse=True)  # value.x before error.x
    for name in [*sorted(of_a_log, key=lambda name: name.partition(".")[2]), KEY]:
        kinds[name] = kinds.pop(name, set())
    return {
        name: pa.bool_()
        if found == {bool}
        else pa.int64()
        if found == {int}
        else pa.float64()
        if found and found <= {int, float}
        else pa.string()
        for name, found in kinds.items()
    }


def load_writers() -> None:
    """Import what writing a table takes."""
    import pyarrow.csv
    import pyarrow.parquet  # noqa: F401


def write_table(
    path: Path, rows: Iterator[Row], columns: Mapping[str, Any], metadata: Mapping[str, str] | None = None
) -> None:
    """The table, whole or not at all; Parquet takes `metadata`.

    Raises
    ------
    DataError : it cannot be written.
    """
    import pyarrow as pa
    import pyarrow.csv as pc
    import pyarrow.parquet as pq

    schema = pa.schema(list(columns.items()), metadata)
    out = WholeFile(path)
    try:
        writer = pc.CSVWriter if path.suffix.lower() == ".csv" else pq.ParquetWriter
        with writer(str(out.path), schema) as sink:
            while batch := list(islice(rows, _BATCH)):
                fitting = [_fitting(row, columns) for row in batch]
                arrays = [arrow_column([row.get(name) for row in fitting], kind) for name, kind in columns.items()]
                sink.write_batch(pa.RecordBatch.from_arrays(arrays, schema=schema))
        out.commit()
    except OSError as error:
        raise cannot_be_written(path, error) from None
    finally:
        out.abort()


def _fitting(row: Row, columns: Mapping[str, Any]) -> dict[str, Any]:
    """Text where the column is text because other rows have text in it; bytes of names that are no text, escaped."""
    return {
        name: str(value).encode("utf-8", "backslashreplace").decode()
        if value is not None and str(columns[name]) == "string"
        else value
        for name, value in row.items()
    }


def rows_file(path: str | Path) -> Path:
    """Where the rows of that table are: in the table, or in the journal beside it where there is no table yet."""
    table = Path(path)
    journal = table.with_name(table.name + PART)
    return journal if journal.is_file() and not table.is_file() else table


def read_rows(path: str | Path) -> list[dict[str, Any]]:
    """The rows of a table of results, or of its journal; see `rows_file`.

    Raises
    ------
    DataError : there is none, or it is not one of ours.
    """
    import pyarrow as pa

    table = rows_file(path)
    if table.exists() and not table.is_file():
        raise DataError(f"{path}: is no file", "name the table that dsd fleet has written")
    try:
        if table.name == Path(path).name + PART:
            with open(table, "rb") as file:
                lines = [json.loads(line) for line in file if line.endswith(b"\n")]
            return list({row[KEY]: row for row in lines}.values())
        names, found = _read_table(table)
    except FileNotFoundError:
        raise DataError(f"{path}: no such file", "dsd fleet detect, compare or diagnose writes it") from None
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError) as error:
        said = (str(error).splitlines() or [""])[0]
        raise DataError(f"{path}: cannot be read as a table of results ({said})") from None
    missing = [name for name in ("log", "status", "verdict", KEY) if name not in names]
    if missing:
        raise DataError(f"{path}: is no table of results of dsd fleet, it has no column {missing[0]}")
    rows: list[dict[str, Any]] = found().to_pylist()
    return rows


def _read_table(table: Path) -> tuple[list[str], Callable[[], Any]]:
    """Its columns, and what gives all of it: it may be a large file of another kind."""
    if table.suffix.lower() == ".csv":
        import pyarrow.csv as pc

        found = pc.read_csv(table, convert_options=pc.ConvertOptions(column_types=_texts()))
        return found.column_names, lambda: found
    import pyarrow.parquet as pq

    file = pq.ParquetFile(table)  # `read_table` imports pyarrow.dataset, which takes longer than to read
    return file.schema_arrow.names, file.read


def _texts() -> dict[str, Any]:
    import pyarrow as pa

    return dict.fromkeys(("log", "machine", "date", "config", "status", "reason", "verdict", KEY), pa.string())
