"""Tables in: the columns a command needs from a CSV or Parquet file or from stdin, in batches of float64."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import BinaryIO

from dsd_cli.errors import DataError
from dsd_cli.files.csv_layout import CsvLayout
from dsd_cli.files.table_source import TableSource, read_head, read_sidecar
from dsd_cli.signals.log import Hold

PARQUET_MAGIC = b"PAR1"
STDIN = "-"


def open_table(
    path: str | Path,
    columns: Mapping[str, str],
    optional: Collection[str] = (),
    *,
    u_hold: Hold = "held",
    layout: CsvLayout | None = None,
) -> TableSource:
    """Open a log.

    Parameters
    ----------
    path : a CSV or Parquet file, or one of another tool (`formats`), known by its content; "-" for stdin.
    columns : canonical name -> name of the column in the file.
    optional : canonical names that may be missing.
    layout : where the rows of a text file are; None: it is found.
    u_hold : how u lives between its samples, which matters where it is joined with channels of another rate.

    Raises
    ------
    DataError : the file cannot be read, is not a table, or lacks a column.
    """
    if str(path) == STDIN:
        return _of_stream(sys.stdin.buffer, "<stdin>", columns, optional, layout)
    if is_stream(path):
        return _of_stream(_opened(path), str(path), columns, optional, layout)
    from dsd_cli.files.formats.known import HEAD_BYTES, LONG, format_of, is_bag
    from dsd_cli.files.own_clocks import on_one_clock

    head = b"" if is_bag(path) else read_head(path, HEAD_BYTES)
    other = None if head.startswith(PARQUET_MAGIC) else format_of(path, head)
    if other is None:
        try:
            return on_one_clock(_of_columns(str(path), head, columns, optional, layout), u_hold)
        except DataError:
            if not _is_long(path):
                raise
            other = LONG
    from dsd_cli.files.formats.table import ContainerTable

    scaled = layout.scaled if layout else None
    return on_one_clock(ContainerTable(path, other, columns, optional, u_hold, scaled), u_hold)


def _of_columns(
    path: str, head: bytes, columns: Mapping[str, str], optional: Collection[str], layout: CsvLayout | None
) -> TableSource:
    if head.startswith(PARQUET_MAGIC):
        from dsd_cli.files.parquet_in import ParquetTable

        return ParquetTable(path, columns, optional)
    from dsd_cli.files.csv_in import CsvTable

    return CsvTable(path, columns, optional, layout)


def _is_long(path: str | Path) -> bool:
    from dsd_cli.files.formats.long_form import long_form, opened

    try:
        return long_form(opened(str(path), {})) is not None
    except DataError:
        return False


def _of_stream(
    stream: BinaryIO, name: str, columns: Mapping[str, str], optional: Collection[str], layout: CsvLayout | None
) -> TableSource:
    """What can be read only once."""
    head = _first_bytes(stream)
    if head == PARQUET_MAGIC:
        from dsd_cli.files.parquet_in import ParquetTable

        return ParquetTable(name, columns, optional, content=head + stream.read())
    from dsd_cli.files.line_stream import LineStream

    return LineStream(stream, columns, optional, head=head, name=name, layout=layout)


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


def metadata_of(path: str | Path) -> dict[str, str]:
    """Metadata of a CSV or Parquet file, without reading its rows; empty for a stream, or what cannot be read."""
    if is_stream(path):
        return {}
    try:
        with open(path, "rb") as file:
            parquet = file.read(len(PARQUET_MAGIC)) == PARQUET_MAGIC
    except (OSError, ValueError):
        return {}
    if not parquet:
        return read_sidecar(path)
    import pyarrow as pa
    import pyarrow.parquet as pq

    from dsd_cli.files.parquet_in import key_values

    try:
        return key_values(pq.read_metadata(path).metadata)
    except (pa.ArrowException, OSError):
        return {}


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
