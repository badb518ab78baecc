"""CSV files in: a fast reader, and a slow second look that says where it failed."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files import csv_cells as cells
from dsd_cli.files import csv_dialect as dialects
from dsd_cli.files.arrow_arrays import as_float64, is_number_type, numbers
from dsd_cli.files.content import content_of, text_of
from dsd_cli.files.csv_cells import Written
from dsd_cli.files.csv_end import Head, behind_rows, with_ended_columns, without_copies_of_head
from dsd_cli.files.csv_factors import Scaling
from dsd_cli.files.csv_failed import headless, why_unread
from dsd_cli.files.csv_layout import CsvLayout, look
from dsd_cli.files.csv_rate import sample_time_of
from dsd_cli.files.csv_stamps import split_stamps
from dsd_cli.files.parquet_in import arrow_source, threaded
from dsd_cli.files.table_source import Batch, choose_columns, read_head, read_sidecar
from dsd_cli.files.turned_rows import said_of
from dsd_cli.signals.log import Array

HEAD_BYTES = 1 << 16
BLOCK_BYTES = 1 << 21
#: Bytes of text from which all columns are looked at.
PEEK_BYTES = 1 << 23
#: What the second column of stamps in two of them is called here.
_PARTS = "parts of a second"
#: What Arrow says of a cell that is no number: the place of its column, and what stands there.
_IN_COLUMN = re.compile("In CSV column #([0-9]+): .*'([^']*)'")
#: Bytes at the end of a file in which text behind the rows is looked for.
FOOTER_BYTES = 1 << 12


class CsvTable:
    """A CSV file; see `TableSource`."""

    def __init__(
        self,
        name: str,
        columns: Mapping[str, str],
        optional: Collection[str] = (),
        layout: CsvLayout | None = None,
    ) -> None:
        self.name = name
        self._content = content_of(name)  # None: of the file itself
        head = read_head(name, HEAD_BYTES) if self._content is None else self._content[:HEAD_BYTES]
        dialects.refuse_other_formats(name, head)
        lines = [dialects.decode(line) for line in head.splitlines()]
        if len(head) == HEAD_BYTES:
            lines = lines[:-1]  # the last one is cut
        if not lines:
            raise headless(name, head)
        layout = layout or CsvLayout()
        found = look(name, lines, layout)
        told = (line for line in lines[found.skip :] if not dialects.is_comment(line))
        rows = [dialects.fields_of(line, found.header.delimiter) for line in told]
        names = dialects.numbered(dialects.without_copies(found.header.names, rows), columns.values(), *rows[:1])
        header = found.header._replace(names=names)
        self._split = split_stamps(header.names, lines[found.skip :], header.delimiter)
        self.column_names: list[str] = [*header.names, *([self._split.name] if self._split else [])]
        self.columns = choose_columns(name, self.column_names, columns, optional)
        self._places = {canonical: self.column_names.index(column) for canonical, column in self.columns.items()}
        if self._split and (whole := [c for c, at in self._places.items() if at == len(header.names)]):
            self._places |= {whole[0]: self._split.at, _PARTS: self._split.at + 1}
        self._dialect = dialects.look_at_rows(lines, header, found.skip, list(self._places.values()), found.units)
        if layout.decimal is not None:
            how = {k: how for k, how in self._dialect.written.items() if how.digits or how.decimal == layout.decimal}
            self._dialect = self._dialect._replace(decimal=layout.decimal, written=how)
        if not self._dialect.first:
            raise DataError(f"{name}: has a header but no rows")
        self._encoding = dialects.encoding_of(b"\n".join(head.splitlines()[: len(lines)]))
        self.metadata = read_sidecar(name)
        self._scaling = Scaling(name, found.factors, names, layout.scaled)
        self._notes = [*said_of(self._content), *found.notes]
        if self._dialect.units is not None and found.units is None:
            self._notes.append(f"line {self._dialect.skip} is taken as units, not data")
        self.unreadable = 0
        self.sample_time = sample_time_of(lines, found)
        self._end = self._without_footer()
        self._head: Head | None = None  # which comes again among the rows, as they were read with it

    @property
    def warnings(self) -> list[str]:
        again = self._head.said("t" in self._places) if self._head else []
        return [*self._notes, *again, *self._scaling.said]

    @property
    def units(self) -> dict[str, str]:
        """Column -> what the row of units says, or every cell, or stamps in two columns; empty without such."""
        header, units = self._dialect.header, self._dialect.units
        beside = {header.names[at]: how.unit for at, how in self._dialect.written.items() if how.unit}
        beside |= {self._split.name: "s"} if self._split else {}
        return beside if units is None else dict(zip(header.names, units, strict=False)) | beside

    @property
    def delimiter(self) -> str:
        return self._dialect.header.delimiter

    def peek(self) -> dict[str, Any]:
        """Column -> Arrow array of about its first megabytes, of what Arrow takes it for; none without rows."""
        import pyarrow as pa

        names = dialects.by_number(self.column_names)
        try:
            batch = self._reader(everything=True).read_next_batch()
        except StopIteration:
            return {}
        except (pa.ArrowException, OSError, UnicodeError) as error:
            if not self._read_otherwise(error):
                raise self._explain(0, error) from None
            return self.peek()
        found = {at: batch.column(at) for at in range(batch.num_columns) if names.index(names[at]) == at and names[at]}
        for at, how in self._dialect.written.items():
            if at in found and pa.types.is_string(found[at].type):
                found[at] = _spelt(found[at], how)
        first = {at: cell for at, cell in enumerate(self._dialect.first) if cell.strip() not in cells.MISSING}
        words = [at for at in found.keys() & first.keys() if pa.types.is_string(found[at].type)]
        pointed = ((at, c) for at in words for c in found[at].to_pylist() if c and "." in c)
        if self._dialect.decimal == "," and any(self._with_thousands(at, cell) for at, cell in pointed):
            return self.peek()
        if any(cells.is_plain(first[at]) for at in words) and self._read_otherwise(None):
            return self.peek()
        for at in found.keys() & self._scaling.places:
            if is_number_type(found[at].type):
                found[at] = numbers(self._scaling.applied(at, as_float64(found[at])))
        if self._split and {at := self._split.at, at + 1} <= found.keys():
            together = self._split.whole(_values(found.pop(at), None), as_float64(found.pop(at + 1)))
            found = {len(names) - 1: pa.array(together), **found}
        return {names[at]: column for at, column in found.items()}

    def texts(self, column: str) -> list[str]:
        """All cells of a column, as they are written."""
        import pyarrow as pa

        kinds = {f"c{self.column_names.index(column)}": pa.string()}
        try:
            return [text for batch in self._reader(kinds=kinds) for text in batch.column(0).to_pylist()]
        except (pa.ArrowException, OSError, UnicodeError) as error:
            if not self._read_otherwise(error):
                raise self._explain(0, error) from None
            return self.texts(column)

    def batches(self) -> Iterator[Batch]:
        import pyarrow as pa

        rows = 0
        while True:
            try:
                for batch in self._batches(rows):
                    rows += batch.rows
                    yield batch
                return
            except (pa.ArrowException, OSError, ValueError) as error:  # the last of a stamp in words
                if not self._read_otherwise(error):
                    raise self._explain(rows, error) from None

    def _batches(self, after: int) -> Iterator[Batch]:
        """The rows after so many."""
        how, at = self._dialect.written, 0
        for whole in self._reader():
            again = self._head.begins if self._head and "t" not in self._places else []  # else stamps say it
            begins = [row for row in again if row >= after]
            end = at + whole.num_rows
            cuts = sorted({at, end, *(row for row in (after, *begins) if at < row < end)})
            for start, stop in pairwise(cuts):
                if start >= after:
                    rows = whole.slice(start - at, stop - start)
                    columns = {c: _values(rows.column(f"c{k}"), how.get(k)) for c, k in self._places.items()}
                    columns = {c: self._scaling.applied(self._places[c], x) for c, x in columns.items()}
                    if self._split and (parts := columns.pop(_PARTS, None)) is not None:
                        stamped = next(c for c, k in self._places.items() if k == self._split.at)
                        columns[stamped] = self._split.whole(columns[stamped], parts)
                    yield Batch(stop - start, columns, start in begins)
            at = end

    def _read_otherwise(self, error: Exception | None) -> bool:
        """Whether it may be read now: one byte far below its head may be none of Windows, all of them are of Latin."""
        if isinstance(error, UnicodeError) and self._encoding == "cp1252":
            self._encoding = "latin-1"
            return True
        if not self._head and self._leave_headers_out():
            return True
        wrong = _IN_COLUMN.search(str(error))
        return wrong is not None and self._with_thousands(int(wrong[1]), wrong[2])

    def _with_thousands(self, at: int, cell: str) -> bool:
        """Whether the point in a cell of a column stands between thousands, as decimals are commas: now it does there.

        Every group behind one has three digits in all of the column, else it cannot be read so either.
        """
        if self._dialect.decimal != "," or at in self._dialect.written or not cells.is_large(cell):
            return False
        self._dialect = self._dialect._replace(written={**self._dialect.written, at: cells.THOUSANDS})
        name = self.column_names[at]
        self._notes.append(f'"{name}": decimals are commas here, so that a point stands between thousands ({cell})')
        return True

    def _leave_headers_out(self) -> bool:
        """Whether columns end early, its header comes again, or comments stand among its rows: it is read without."""
        content, skip = text_of(self.name)[: self._end], self._dialect.skip
        ended = with_ended_columns(content, skip, self.delimiter, len(self._dialect.header.names))
        if ended and ended[0] != self._content:  # else that text is what could not be read
            self._content, self._end, self._notes = ended[0], None, [*self._notes, ended[1]]
            return True
        if found := without_copies_of_head(content, skip):
            (self._content, self._head), self._end = found, None
        return found is not None

    def _explain(self, rows: int, error: Exception) -> DataError:
        return why_unread(self.name, self._content, self._dialect, self._places, rows, error)

    def _reader(self, everything: bool = False, kinds: Mapping[str, Any] | None = None) -> Any:
        """Arrow's, of the columns that are needed; of everything in large blocks, where it finds out what they hold.

        kinds : of other columns than these, by their places (`c0`).
        """
        import pyarrow as pa
        import pyarrow.csv as pc

        header, skip, first, decimal, _, written = self._dialect
        types = {f"c{at}": pa.string() if at in written else pa.float64() for at in self._places.values()}
        stamp = first[at] if (at := self._places.get("t")) is not None and at < len(first) else ""
        if cells.ISO_TIME.match(stamp) and not cells.TWO_ZONES.search(stamp):
            types[f"c{at}"] = pa.timestamp("ns", "UTC" if cells.has_zone(stamp) else None)
        elif cells.is_stamp(stamp):
            types[f"c{at}"] = pa.string()
        types = dict(kinds or types)
        source, skip, delimiter = self._source(header.delimiter, skip)
        return pc.open_csv(
            source,
            read_options=pc.ReadOptions(
                use_threads=threaded(),
                block_size=PEEK_BYTES if everything else BLOCK_BYTES,
                skip_rows=skip,
                column_names=[f"c{i}" for i in range(len(header.names))],
                encoding=self._encoding if everything or pa.string() in types.values() else "utf8",
            ),
            parse_options=pc.ParseOptions(delimiter=delimiter),
            convert_options=pc.ConvertOptions(
                include_columns=None if everything else list(types),
                column_types=None if everything else types,
                null_values=sorted(cells.MISSING),
                decimal_point=decimal,
            ),
        )

    def _without_footer(self) -> int | None:
        """Where the rows end, byte, if there is text behind them; None: at the end of the file."""
        if self._content is not None:
            size, tail = len(self._content), self._content[-FOOTER_BYTES:]
        else:
            size = Path(self.name).stat().st_size
            with open(self.name, "rb") as file:
                file.seek(max(size - FOOTER_BYTES, 0))
                tail = file.read(FOOTER_BYTES)
        lines = tail.splitlines(keepends=True)[1 if size > FOOTER_BYTES else self._dialect.skip :]
        header = self._dialect.header
        cut, said = behind_rows(lines, header.delimiter, len(header.names), self._dialect.first)
        self._notes += said
        return size - cut if cut else None

    def _source(self, delimiter: str, skip: int) -> tuple[Any, int, str]:
        """What Arrow reads, how many of its lines come before the data, and what separates fields."""
        import pyarrow as pa

        if delimiter == " ":  # any number of blanks, which Arrow does not know
            content = Path(self.name).read_bytes() if self._content is None else self._content
            rows = (b"\t".join(line.split()) for line in content[: self._end].splitlines()[skip:])
            return pa.BufferReader(b"\n".join(row for row in rows if row)), 0, "\t"
        if self._content is not None:
            return pa.BufferReader(pa.py_buffer(self._content)[: self._end]), skip, delimiter
        if self._end is None:
            return arrow_source(self.name), skip, delimiter
        return pa.BufferReader(pa.memory_map(self.name).read_buffer(self._end)), skip, delimiter


def _values(column: Any, how: Written | None) -> Array:
    """A column as float64; texts are numbers written so, or stamps."""
    import pyarrow as pa

    if not pa.types.is_string(column.type):
        return as_float64(column)
    read = cells.seconds if how is None else how.value
    return np.array([np.nan if text is None else read(text) for text in column.to_pylist()])


def _spelt(column: Any, how: Written) -> Any:
    """Texts as an Arrow array of numbers; as they are where one is written in another way."""
    try:
        return numbers(_values(column, how))
    except ValueError:
        return column
