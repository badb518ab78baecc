"""CSV in as it is written: stdin, or a file that grows; each complete line is parsed at once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files import csv_dialect as dialects
from dsd_cli.files.csv_body import BODY, FEW, Body, are_of_counts
from dsd_cli.files.csv_cells import is_number
from dsd_cli.files.csv_described import Row
from dsd_cli.files.csv_end import Head
from dsd_cli.files.csv_factors import Scaling, factors_in
from dsd_cli.files.csv_layout import CsvLayout
from dsd_cli.files.csv_said import key_of, kind_of, labelled
from dsd_cli.files.formats.known import format_of
from dsd_cli.files.growing_lines import GrowingLines
from dsd_cli.files.live_cells import LiveCells
from dsd_cli.files.table_source import Batch, choose_columns, read_sidecar

#: Lines that a preamble has at most.
_PREAMBLE = 100
_SAMPLE = "line {} is taken as a sample: if it is of factors, write it to a file first"


class LineStream:
    """A live CSV; see `TableSource`. A batch holds the lines that were complete when it was read.

    Parameters
    ----------
    source : a binary stream with a file descriptor (ends at its end), or the path of a file to follow: what is
        appended is read, a half-written last line waits for its end, and a file that was replaced or cut begins anew
        with a header. Following ends when `stop()` is true or nothing came for `idle_timeout` s.
    head : bytes already taken from the stream.
    name : of the stream, for messages.
    layout : where the rows are, as [csv] says; else the first line that names the needed columns is the header.

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
        self._wanted = columns
        self._optional = optional
        self._layout = layout or CsvLayout()
        self._source = GrowingLines(source, head, stop, idle_timeout)
        self._header: dialects.Header | None = None
        self._restart = False  # what comes next is another recording
        self._comment, self._line, self._rows, self._widest = "", 0, 0, 0
        self._refused: DataError | None = None  # what the widest line lacks that could be the header
        self.column_names: list[str] = []
        self.columns: dict[str, str] = {}
        self.metadata = read_sidecar(self._path) if self._path is not None else {}
        self._notes: list[str] = []
        self._head = Head([])
        self._begin: list[str] = []  # the first samples
        self._top: list[bytes] = []  # header and what is above it
        self._above: list[Row] = []  # lines that say something of the channels, or may do so
        self._scaling = Scaling(self.name, None, ())
        self._cells = LiveCells()
        self.unreadable = 0
        self._events = self._source.read()
        self._waiting = self._until_header()

    @property
    def warnings(self) -> list[str]:
        return [
            *(*self._notes, *self._head.said("t" in self.columns)),
            *(*self._scaling.said, *self._cells.said(self.column_names)),
        ]

    def batches(self) -> Iterator[Batch]:
        try:
            while True:
                yield from self._parse(self._waiting)
                try:
                    lines = next(self._events)
                except StopIteration:
                    break
                if lines is None:
                    self._restart, self._header, self._line = True, None, 0
                self._waiting = lines or []
        finally:
            self.close()
        if not self._rows and self._path is None:
            raise DataError(f"{self.name}: has a header but no rows")

    def close(self) -> None:
        """Give the file back; stdin stays open."""
        self._source.close()

    def _until_header(self) -> list[bytes]:
        """Read up to the header; returns the lines after it that came along."""
        for lines in self._events:
            self._line = 0 if lines is None else self._line
            for at, line in enumerate(lines or []):
                if self._take_header(line):
                    return (lines or [])[at + 1 :] if not self._header_is_data else (lines or [])[at:]
        raise self._refused or DataError(f"{self.name}: {'has no header and no rows' if self._line else 'is empty'}")

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
            self._above, self._top = [], []
        self._top.append(raw)
        if self._line <= max((told.header or 1) - 1, told.skip_rows or 0):
            self._above += [Row(self._line - 1, dialects.fields_of(line, by), False) for by in dialects.DELIMITERS]
            return False
        if dialects.is_comment(line) and told.header != self._line:
            self._comment = line if line.strip() else self._comment
            return False
        try:
            header = dialects.live_header(self.name, self._comment, line, told.delimiter, told.header == 0)
        except DataError as error:
            raise self._refused or error from None  # rows begin here: that was the header
        self._header = header._replace(names=dialects.numbered(header.names, self._wanted.values()))
        self.column_names = self._header.names
        try:
            self._place_columns()
        except DataError as error:
            if told.header is not None or told.skip_rows or self._line > _PREAMBLE:
                raise
            self._refused = error if len(header.names) > self._widest else self._refused
            self._header, self._widest = None, max(len(header.names), self._widest)  # a preamble, if named further down
            self._above.append(Row(self._line - 1, header.names, False))
            return False
        if self._refused is not None:
            self._notes.append(f"line {self._line} is taken as the header, what is above it is left out")
        self._line, self._refused = self._line - self._header.line_is_data, None
        del self._top[self._line :]
        width = len(self.column_names)
        self._body = Body(self._header.delimiter, width, tuple(range(width)), self._line)
        self._ahead, self._has_units = True, False
        self._scaling = Scaling(self.name, None, ())
        return True

    def _place_columns(self) -> None:
        """Where the channels are: those of the first header, by each that comes after it.

        Raises
        ------
        DataError : the first one lacks a needed column. Below a later one that does, no line can be read.
        """
        first = not self.columns
        wanted, optional = (self._wanted, self._optional) if first else ({c: self._wanted[c] for c in self.columns}, ())
        try:
            self.columns = choose_columns(self.name, self.column_names, wanted, optional)
        except DataError as error:
            if first:
                raise
            self._notes.append(f"line {self._line} is a header with which no line below can be read: {error.message}")
            self._places = []
            return
        self._places = [(c, self.column_names.index(column)) for c, column in self.columns.items()]

    def _is_header(self, cells: list[str]) -> bool:
        """Whether these are names, those that are needed or most of them as above, of other columns or in another
        order."""
        names = [cell.strip(' "') for cell in cells]
        known = 2 * len(set(names) & set(self.column_names)) > len(names)
        return (known or set(self.columns.values()) <= set(names)) and not any(map(is_number, names))

    def _parse(self, lines: list[bytes]) -> Iterator[Batch]:
        rows: list[list[float]] = []
        for raw in lines:
            if self._header is None and (not self._take_header(raw) or not self._header_is_data):
                continue
            assert self._header is not None
            self._line += 1
            if not self._ahead and self._head.comes_again(raw, self._line, self._rows + len(rows)):
                if "t" not in self.columns:
                    yield from self._batch(rows)
                    rows, self._restart = [], True
                continue
            line = dialects.decode(raw)
            if dialects.is_comment(line) or self._line == self._layout.units_row:
                self._top += [raw] if self._ahead else []
                continue
            fields = dialects.fields_of(line, self._header.delimiter)
            if not self._ahead and self._is_header(fields):
                yield from self._batch(rows)
                rows, self._restart = [], self._restart or "t" not in self.columns
                self._notes.append(f"line {self._line} is a header of other columns: what is below it is read by it")
                self._line, self._top, self._above = self._line - 1, [], []
                self._take_header(raw)
                continue
            samples = self._samples(fields) if self._ahead else [fields]
            self._top += [] if samples else [raw]
            if samples and len(self._begin) < BODY:
                self._note_factors(line)
            rows += [self._row(cells, line) for cells in samples]
        yield from self._batch(rows)

    def _batch(self, rows: list[list[float]]) -> Iterator[Batch]:
        if not rows:
            return
        self._rows += len(rows)
        table = np.array(rows, dtype=np.float64).T
        columns = {c: x.copy() for c, x in zip(self.columns, table, strict=True)}
        columns |= {c: self._scaling.applied(at, columns[c]) for c, at in self._places}
        restart, self._restart = self._restart, False
        yield Batch(len(rows), columns, restart)

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
        self._head = Head(self._top[: self._body.start] if again else self._top)
        self._scaling = Scaling(self.name, factors_in(above, self._body), self.column_names, self._layout.scaled)
        self._begin = []
        if kind == "factor" and not again:
            self._notes.append(_SAMPLE.format(self._line))
        if not self._rows and any(map(str.strip, fields[self._body.fields :])):
            what = f"line {self._line} has {len(fields)} fields where the header names {self._body.fields}"
            raise DataError(f"{self.name}: {what}", "write it to a file first, or name all columns")
        if not self._rows:
            self._refuse_spelt(fields)
        return [*(waiting if again else []), fields]

    def _note_factors(self, line: str) -> None:
        """Say it where the first sample is what a file takes for factors, for the rows behind it are of counts."""
        self._begin.append(line)
        ahead = self._line - len(self._begin) + 1
        enough = len(self._begin) in (FEW // 2 + 2, BODY) and _SAMPLE.format(ahead) not in self._notes
        if enough and are_of_counts(self._begin, self._body.delimiter, self._body.fields):
            self._notes.append(_SAMPLE.format(ahead))

    def _row(self, fields: list[str], line: str) -> list[float]:
        """The values of a line, NaN throughout if it cannot be read."""
        try:
            if len(fields) != len(self.column_names) or not self._places:
                raise ValueError
            row = [self._cells.read(at, fields[at], c == "t") for c, at in self._places]
        except ValueError:
            if not self.unreadable:
                self._notes.append(f'line {self._line} cannot be read: "{line.strip()[:60]}"')
            self.unreadable += 1
            return [np.nan] * len(self.columns)
        self._cells.count(row)
        return row

    def _refuse_spelt(self, fields: list[str]) -> None:
        for c, at in self._places:
            cell = fields[at].strip() if at < len(fields) else ""
            if c != "t" and is_number(cell) and not self._is_read(at, cell):
                what = f'column "{self.column_names[at]}" is written as "{cell[:40]}"'
                remedy = "write it to a file first, or numbers without a unit"
                raise DataError(f"{self.name}, line {self._line}: {what}, which is no number in a stream", remedy)

    def _is_read(self, at: int, cell: str) -> bool:
        try:
            self._cells.read(at, cell)
        except ValueError:
            return False
        return True
