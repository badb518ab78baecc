"""Tables in: the columns a command needs from a CSV or Parquet file or from stdin, in batches of float64."""

from __future__ import annotations

import json
import os
import stat
import sys
from collections.abc import Collection, Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import BinaryIO, NamedTuple, Protocol

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.signals.log import Array, Hold

PARQUET_MAGIC = b"PAR1"
STDIN = "-"
#: What the file with the metadata of a CSV file is called, after that one's name.
SIDECAR = ".meta.json"
#: Bytes; ours hold a config.
LARGEST_SIDECAR = 1 << 24


class Batch(NamedTuple):
    """`rows` rows: canonical name -> float64, shape (rows,), NaN where a value is missing.

    `restart`: the file was begun anew, so these rows are another recording.
    """

    rows: int
    columns: dict[str, Array]
    restart: bool = False


class TableSource(Protocol):
    """A table that is being read.

    Attributes
    ----------
    name : for messages.
    column_names : every column of the file, needed or not.
    columns : canonical name -> column, for those that are read (optional ones only if they are there).
    metadata : provenance that came with the file.
    warnings : one sentence each.
    unreadable : rows given as NaN because their line could not be read (live streams only).
    """

    name: str
    metadata: dict[str, str]

    @property
    def column_names(self) -> list[str]: ...
    @property
    def columns(self) -> dict[str, str]: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def unreadable(self) -> int: ...

    def batches(self) -> Iterator[Batch]: ...


def open_table(
    path: str | Path,
    columns: Mapping[str, str],
    optional: Collection[str] = (),
    *,
    follow: bool = False,
    u_hold: Hold = "held",
) -> TableSource:
    """Open a log.

    Parameters
    ----------
    path : a CSV or Parquet file, or one of another tool (`formats`), told apart by content; "-" for stdin.
    columns : canonical name -> name of the column in the file.
    optional : canonical names that may be missing.
    follow : keep reading what is appended to the CSV file; ends only when the caller stops.
    u_hold : how u lives between its samples, which matters where it is joined with channels of another rate.

    Raises
    ------
    DataError : the file cannot be read, is not a table, or lacks a column.
    """
    from dsd_cli.files.csv_in import CsvTable
    from dsd_cli.files.formats.known import HEAD_BYTES, format_of, is_bag
    from dsd_cli.files.line_stream import LineStream
    from dsd_cli.files.parquet_in import ParquetTable

    if str(path) == STDIN:
        stdin: BinaryIO = sys.stdin.buffer
        head = _first_bytes(stdin)
        if head == PARQUET_MAGIC:
            return ParquetTable("<stdin>", columns, optional, content=head + stdin.read())
        return LineStream(stdin, columns, optional, head=head)
    if is_stream(path):
        stream = _opened(path)
        head = _first_bytes(stream)
        if head == PARQUET_MAGIC:
            return ParquetTable(str(path), columns, optional, content=head + stream.read())
        return LineStream(stream, columns, optional, head=head, name=str(path))
    head = b"" if is_bag(path) else read_head(path, HEAD_BYTES)
    if follow:
        return LineStream(Path(path), columns, optional)
    if head.startswith(PARQUET_MAGIC):
        return ParquetTable(str(path), columns, optional)
    other = format_of(path, head)
    if other is None:
        return CsvTable(str(path), columns, optional)
    from dsd_cli.files.formats.table import ContainerTable

    return ContainerTable(path, other, columns, optional, u_hold)


def is_stream(path: str | Path) -> bool:
    """Whether what it gives can be read only once: stdin, a FIFO, `<(command)`, a terminal."""
    if str(path) == STDIN:
        return True
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode) or stat.S_ISSOCK(mode)


def _opened(path: str | Path) -> BinaryIO:
    if str(path) in ("/dev/stdin", "/dev/fd/0"):  # which as a socket could not be opened once more
        return sys.stdin.buffer
    try:
        return open(path, "rb", buffering=0)
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from None


def _first_bytes(stream: BinaryIO) -> bytes:
    """The first four bytes, or fewer at the end; waits for no more than these."""
    head = b""
    while len(head) < len(PARQUET_MAGIC) and (more := os.read(stream.fileno(), len(PARQUET_MAGIC) - len(head))):
        head += more
    return head


def read_head(path: str | Path, size: int) -> bytes:
    """The first bytes of a file; one line for whatever keeps it from being read."""
    try:
        with open(path, "rb") as file:
            return file.read(size)
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise DataError(f"{path}: is a directory", "give a log file") from None
    except PermissionError:
        raise DataError(f"{path}: permission denied") from None
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None


def choose_columns(
    source: str, column_names: list[str], columns: Mapping[str, str], optional: Collection[str]
) -> dict[str, str]:
    """Canonical name -> column for those that are there.

    Raises
    ------
    DataError : a needed column is missing, or there are several of that name.
    """
    chosen = {}
    for canonical, name in columns.items():
        if name in column_names:
            if column_names.count(name) > 1:
                raise DataError(f'{source}: {column_names.count(name)} columns are called "{name}"', "rename one")
            chosen[canonical] = name
        elif canonical not in optional:
            raise DataError(
                f'{source}: no column "{name}"; it has {_listed(column_names)}', _hint(canonical, name, column_names)
            )
    return chosen


def _listed(names: list[str], limit: int = 12) -> str:
    more = f" and {len(names) - limit} more" if len(names) > limit else ""
    return ", ".join(name or '""' for name in names[:limit]) + more


def _hint(canonical: str, name: str, column_names: list[str]) -> str:
    key = "time" if canonical == "t" else canonical
    if canonical in column_names:
        return f'set [signals] {key} = "{canonical}"'
    column_names = [column for column in column_names if not column.startswith("true_")]
    if "/" in name:  # group/channel: that they share the group says nothing
        name = name.rpartition("/")[2]
        folded = {column.rpartition("/")[2].casefold(): column for column in column_names}
    else:
        folded = {column.casefold(): column for column in column_names}
    close = get_close_matches(name.casefold(), list(folded), n=1, cutoff=0.5) or [
        column for column in folded if column.startswith((name.casefold() + "_", name.casefold() + " "))
    ]
    return f'set [signals] {key} = "{folded[close[0]] if close else "..."}"'


def sidecar(path: str | Path) -> Path:
    """Where the metadata of a CSV file is kept."""
    return Path(f"{path}{SIDECAR}")


def read_sidecar(path: str | Path) -> dict[str, str]:
    """Metadata of a CSV file; empty when there is none or it is not ours."""
    beside = sidecar(path)
    try:
        if not beside.is_file() or beside.stat().st_size > LARGEST_SIDECAR:
            return {}
        found = json.loads(beside.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return {str(key): str(value) for key, value in found.items()} if isinstance(found, dict) else {}


def dropped_with_unreadable(dropped: Mapping[str, int], unreadable: int) -> dict[str, int]:
    """Counts of the cleaner, with the unreadable lines under their own name.

    Such a line is NaN in every column, so the cleaner counted it under the first one.
    """
    counts = dict(dropped)
    if unreadable:
        first = next((reason for reason in counts if reason.startswith("not finite")), None)
        if first is not None:
            counts[first] -= min(unreadable, counts[first])
        counts = {"unreadable line": unreadable, **{reason: count for reason, count in counts.items() if count}}
    return counts


def missing(rows: int) -> Array:
    """A column without any value."""
    return np.full(rows, np.nan)
