"""CSV in as it is written: stdin, or a file that grows; each complete line is parsed at once."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files import csv_dialect as dialects
from dsd_cli.files.csv_body import Body
from dsd_cli.files.csv_cells import is_number, plain_number, seconds
from dsd_cli.files.csv_described import Row
from dsd_cli.files.csv_factors import Scaling, factors_in
from dsd_cli.files.csv_layout import CsvLayout
from dsd_cli.files.csv_said import key_of, kind_of, labelled
from dsd_cli.files.formats.known import format_of
from dsd_cli.files.table_source import Batch, choose_columns, read_sidecar

CHUNK = 1 << 16
POLL = 0.05  # s
#: Bytes before the place of reading that tell a file that was begun anew.
TAIL = 256
#: Bytes of a line that are looked at; there is no such log, but there are files without a line end.
LONGEST_LINE = 1 << 20


class LineStream:
    """A live CSV; see `TableSource`. A batch holds the lines that were complete when it was read.

    Parameters
    ----------
    source : a binary stream with a file descriptor (ends at its end), or the path of a file to follow: what is
        appended is read, a half-written last line waits for its end, and a file that was replaced or cut begins anew
        with a header. Following ends when `stop()` is true or nothing came for `idle_timeout` s.
    head : bytes already taken from the stream.
    name : of the stream, for messages.
    layout : where the rows are, as [csv] says; nothing is looked for in what can be read only once.

    Raises
    ------
    DataError : no header, or a needed column is missing. Lines that cannot be read are NaN rows and counted.
    """

    def __init__(
        self,
        source: BinaryIO | Path,
        columns: Mapping[str, str],
        optional: Collection[str] = (),
        *,
        head: bytes = b"",
        name: str = "<stdin>",
        stop: Callable[[], bool] | None = None,
        idle_timeout: float | None = None,
        layout: CsvLayout | None = None,
    ) -> None:
        self._path = source if isinstance(source, Path) else None
        self.name = str(source) if self._path is not None else name
        self._stream = source  # kept, for a stream that nobody holds closes its descriptor
        self._wanted = columns
        self._optional = optional
        self._stop = stop
        self._idle_timeout = idle_timeout
        self._layout = layout or CsvLayout()
        self._half = head
        self._tail = b""  # what was read last
        self._fd = os.open(self._path, os.O_RDONLY) if self._path is not None else source.fileno()  # type: ignore[union-attr]
        self._header: dialects.Header | None = None
        self._comment = ""
        self._line = 0
        self._rows = 0
        self.column_names: list[str] = []
        self.columns: dict[str, str] = {}
        self.metadata = read_sidecar(self._path) if self._path is not None else {}
        self._notes: list[str] = []
        self._above: list[Row] = []  # lines that say something of the channels, or may do so
        self._scaling = Scaling(self.name, None, ())
        self.unreadable = 0
        self._events = self._read()
        self._waiting = self._until_header()

    @property
    def warnings(self) -> list[str]:
        return [*self._notes, *self._scaling.said]

    def batches(self) -> Iterator[Batch]:
        restart = False
        try:
            while True:
                batch = self._parse(self._waiting, restart)
                if batch is not None:
                    restart = False
                    yield batch
                try:
                    lines = next(self._events)
                except StopIteration:
                    break
                if lines is None:
                    restart, self._header = True, None
                self._waiting = lines or []
        finally:
            self.close()
        if not self._rows and self._path is None:
            raise DataError(f"{self.name}: has a header but no rows")

    def close(self) -> None:
        """Give the file back; stdin stays open."""
        if self._path is not None and self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def _until_header(self) -> list[bytes]:
        """Read up to the header; returns the lines after it that came along."""
        for lines in self._events:
            for at, line in enumerate(lines or []):
                if self._take_header(line):
                    return (lines or [])[at + 1 :] if not self._header_is_data else (lines or [])[at:]
        raise DataError(f"{self.name}: is empty" if not self._line else f"{self.name}: has no header and no rows")

    @property
    def _header_is_data(self) -> bool:
        return self._header is not None and self._header.line_is_data

    def _take_header(self, raw: bytes) -> bool:
        self._line += 1
        if self._line == 1:
            dialects.refuse_other_formats(self.name, raw)
            if (kind := format_of(self.name, raw)) is not None:
                raise DataError(f"{self.name}: is {kind.kind}, which is no stream of rows", "write it to a file first")
        line = dialects.decode(raw)
        told = self._layout
        if self._line == 1:
            self._above = []
        if self._line <= max((told.header or 1) - 1, told.skip_rows or 0):
            self._above += [Row(self._line - 1, dialects.fields_of(line, by), False) for by in dialects.DELIMITERS]
            return False
        if dialects.is_comment(line) and told.header != self._line:
            self._comment = line if line.strip() else self._comment
            return False
        header = dialects.live_header(self.name, self._comment, line, told.delimiter, told.header == 0)
        self._header = header._replace(names=dialects.numbered(header.names, self._wanted.values()))
        self.column_names = self._header.names
        self.columns = choose_columns(self.name, self.column_names, self._wanted, self._optional)
        self._places = [(c, self.column_names.index(column)) for c, column in self.columns.items()]
        self._line -= self._header.line_is_data
        width = len(self.column_names)
        self._body = Body(self._header.delimiter, width, tuple(range(width)), self._line)
        self._ahead, self._has_units = True, False
        self._scaling = Scaling(self.name, None, ())
        return True

    def _parse(self, lines: list[bytes], restart: bool) -> Batch | None:
        rows: list[list[float]] = []
        for raw in lines:
            if self._header is None and (not self._take_header(raw) or not self._header_is_data):
                continue
            assert self._header is not None
            self._line += 1
            line = dialects.decode(raw)
            if dialects.is_comment(line) or self._line == self._layout.units_row:
                continue
            fields = dialects.fields_of(line, self._header.delimiter)
            for cells in self._samples(fields) if self._ahead else (fields,):
                rows.append(self._row(cells, line))
        if not rows:
            return None
        self._rows += len(rows)
        table = np.array(rows, dtype=np.float64).T
        columns = {c: self._scaling.applied(at, table[i].copy()) for i, (c, at) in enumerate(self._places)}
        return Batch(len(rows), columns, restart)

    def _samples(self, fields: list[str]) -> list[list[str]]:
        """What is a sample of a line ahead of the first one, and of those before that waited for it.

        A row of factors is none, unless its first word comes again, as that of a mode does.

        Raises
        ------
        DataError : its cells are numbers as only a file may have them.
        """
        waiting = [row.cells for row in self._above if row.at >= self._body.start]
        again = bool(waiting) and key_of(waiting[-1]) == key_of(fields)
        kind = kind_of(fields) if len(fields) == self._body.fields else ""
        if (labelled(fields) or kind == "type") and not again:
            self._above.append(Row(self._line - 1, fields, False))
            return []
        if not self._has_units and dialects.is_units_row(fields, [at for _, at in self._places]):
            self._has_units = True
            self._notes.append(f"line {self._line} is taken as units, not data")
            return []
        self._ahead = False
        above = [row for row in self._above if not again or row.at < self._body.start]
        self._scaling = Scaling(self.name, factors_in(above, self._body), self.column_names, self._layout.scaled)
        if kind == "factor" and not again:
            self._notes.append(f"line {self._line} is taken as a sample: if it is of factors, write it to a file first")
        self._refuse_spelt(fields)
        return [*(waiting if again else []), fields]

    def _row(self, fields: list[str], line: str) -> list[float]:
        """The values of a line, NaN throughout if it cannot be read."""
        try:
            if len(fields) != len(self.column_names):
                raise ValueError
            return [(seconds if c == "t" else plain_number)(fields[at]) for c, at in self._places]
        except ValueError:
            if not self.unreadable:
                self._notes.append(f'line {self._line} cannot be read: "{line.strip()[:60]}"')
            self.unreadable += 1
            return [np.nan] * len(self._places)

    def _refuse_spelt(self, fields: list[str]) -> None:
        for c, at in self._places:
            cell = fields[at].strip() if at < len(fields) else ""
            if c != "t" and is_number(cell) and not _is_plain(cell):
                what = f'column "{self.column_names[at]}" is written as "{cell[:40]}"'
                remedy = "write it to a file first, or digits with a decimal sign alone"
                raise DataError(f"{self.name}, line {self._line}: {what}, which is no number in a stream", remedy)

    def _read(self) -> Iterator[list[bytes] | None]:
        """Complete lines as they come; None where the file begins anew."""
        quiet_since = time.monotonic()
        head, self._half = self._half, b""
        if lines := self._lines(head):
            yield lines
        while True:
            anew = self._path is not None and self._was_cut()
            chunk = b"" if anew else os.read(self._fd, CHUNK)
            if chunk:
                quiet_since = time.monotonic()
                self._tail = (self._tail + chunk)[-TAIL:]
                if lines := self._lines(chunk):
                    yield lines
            elif self._path is None:
                if self._half:
                    last, self._half = self._half, b""
                    yield last.split(b"\n")
                return
            elif anew or self._was_replaced():
                self._half = self._tail = b""
                self._line = 0
                yield None
            else:
                quiet = time.monotonic() - quiet_since
                if (self._stop and self._stop()) or (self._idle_timeout is not None and quiet > self._idle_timeout):
                    return
                time.sleep(POLL)

    def _lines(self, chunk: bytes) -> list[bytes]:
        """The lines that are complete with this chunk; the rest waits.

        Of a line without end only the beginning is kept, which is then one that cannot be read.
        """
        *lines, rest = chunk.split(b"\n")
        if lines:
            lines[0] = self._half + lines[0]
            self._half = b""
            if b"\r" in chunk or b"\r" in lines[0]:  # ends a line too, as it does in a file
                lines = [part for line in lines for part in line.removesuffix(b"\r").split(b"\r")]
        if len(self._half) < LONGEST_LINE:
            self._half += rest
        return lines

    def _was_cut(self) -> bool:
        """Whether the file is shorter than what was read of it, or holds something else there; then to its begin.

        A file that was cut and has grown past its old size since is recognised by the bytes before the place of
        reading.
        """
        at = os.lseek(self._fd, 0, os.SEEK_CUR)
        if os.pread(self._fd, len(self._tail), at - len(self._tail)) == self._tail:
            return False
        os.lseek(self._fd, 0, os.SEEK_SET)
        return True

    def _was_replaced(self) -> bool:
        """Whether another file has taken the name; then that one is read."""
        assert self._path is not None
        try:
            named, held = os.stat(self._path), os.fstat(self._fd)
            if (named.st_ino, named.st_dev) == (held.st_ino, held.st_dev):
                return False
            fd = os.open(self._path, os.O_RDONLY)
        except FileNotFoundError:
            return False
        os.close(self._fd)
        self._fd = fd
        return True


def _is_plain(cell: str) -> bool:
    try:
        plain_number(cell)
    except ValueError:
        return False
    return True
