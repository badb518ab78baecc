"""CSV files in: a fast reader, and a slow second look that says where it failed."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from itertools import islice
from typing import Any

from dsd_cli.errors import DataError
from dsd_cli.files import csv_dialect as dialects
from dsd_cli.files.arrow_arrays import as_float64
from dsd_cli.files.parquet_in import arrow_source, threaded
from dsd_cli.files.table_source import Batch, choose_columns, read_head, read_sidecar

HEAD_BYTES = 1 << 16
BLOCK_BYTES = 1 << 21


class CsvTable:
    """A CSV file; see `TableSource`."""

    def __init__(self, name: str, columns: Mapping[str, str], optional: Collection[str] = ()) -> None:
        self.name = name
        head = read_head(name, HEAD_BYTES)
        dialects.refuse_other_formats(name, head)
        lines = [dialects.decode(line) for line in head.splitlines()]
        if len(head) == HEAD_BYTES:
            lines = lines[:-1]  # the last one is cut
        if not lines:
            raise DataError(f"{name}: is empty" if not head else f"{name}: line 1 is too long for a header")
        header, skip = dialects.find_header(name, lines)
        self.column_names: list[str] = header.names
        self.columns = choose_columns(name, header.names, columns, optional)
        self._places = {canonical: header.names.index(column) for canonical, column in self.columns.items()}
        self._dialect = dialects.look_at_rows(lines, header, skip, list(self._places.values()))
        if not self._dialect.first:
            raise DataError(f"{name}: has a header but no rows")
        self.metadata = read_sidecar(name)
        self.warnings: list[str] = []
        if self._dialect.units is not None:
            self.warnings.append(f"line {self._dialect.skip} is taken as units, not data")
        self.unreadable = 0

    @property
    def units(self) -> dict[str, str]:
        """Column -> what the row of units says; empty without such a row."""
        header, units = self._dialect.header, self._dialect.units
        return {} if units is None else dict(zip(header.names, units, strict=False))

    def batches(self) -> Iterator[Batch]:
        import pyarrow as pa

        rows = 0
        try:
            for batch in self._reader():
                if batch.num_rows:
                    yield Batch(
                        batch.num_rows, {c: as_float64(batch.column(f"c{at}")) for c, at in self._places.items()}
                    )
                    rows += batch.num_rows
        except (pa.ArrowException, OSError) as error:
            raise self._explain(rows, error) from None

    def _reader(self) -> Any:
        import pyarrow as pa
        import pyarrow.csv as pc

        header, skip, first, decimal, _ = self._dialect
        types = {f"c{at}": pa.float64() for at in self._places.values()}
        at = self._places.get("t")
        if at is not None and at < len(first) and dialects.ISO_TIME.match(first[at]):
            types[f"c{at}"] = pa.timestamp("ns", "UTC" if dialects.has_zone(first[at]) else None)
        return pc.open_csv(
            arrow_source(self.name),
            read_options=pc.ReadOptions(
                use_threads=threaded(),
                block_size=BLOCK_BYTES,
                skip_rows=skip,
                column_names=[f"c{i}" for i in range(len(header.names))],
            ),
            parse_options=pc.ParseOptions(delimiter=header.delimiter),
            convert_options=pc.ConvertOptions(
                include_columns=list(types),
                column_types=types,
                null_values=sorted(dialects.MISSING),
                decimal_point=decimal,
            ),
        )

    def _explain(self, rows: int, error: Exception) -> DataError:
        """The first line at or after `rows` rows that cannot be read, found by reading it again, slowly."""
        header = self._dialect.header
        start = self._dialect.skip + rows  # blank lines only make the true place later
        end = "\n" if b"\n" in read_head(self.name, HEAD_BYTES) else "\r"
        with open(self.name, encoding="latin-1", newline=end) as file:  # bytes as they are
            for at, raw in enumerate(islice(file, start, None), start=start + 1):
                where = f"{self.name}, line {at}"
                line = dialects.decode(raw.rstrip("\r\n").encode("latin-1"))
                if not line.strip():
                    continue
                if stray := _stray(line):
                    return DataError(f"{where}: {stray}", "mend or delete the line")
                fields = dialects.split(line, header.delimiter)
                if len(fields) != len(header.names):
                    return DataError(
                        f"{where}: {len(fields)} fields where the header has {len(header.names)}",
                        "mend or delete the line",
                    )
                for canonical, at in self._places.items():
                    if problem := self._problem(canonical, fields[at]):
                        return DataError(f'{where}, column "{header.names[at]}": {problem[0]}', problem[1])
        return DataError(f"{self.name}: cannot be read ({str(error).splitlines()[0]})")

    def _problem(self, canonical: str, text: str) -> tuple[str, str] | None:
        found = text.strip()[:40]
        try:
            (dialects.seconds if canonical == "t" else dialects.number)(text)
        except ValueError:
            return f'"{found}" is not a number', "mend it, or leave it empty where a value is missing"
        if dialects.DECIMAL_COMMA.fullmatch(text) and self._dialect.decimal == ".":
            return f'"{found}" has a decimal comma, the rows before have points', "write all numbers alike"
        if "." in text and self._dialect.decimal == "," and dialects.is_number(text):
            return f'"{found}" has a decimal point, the rows before have commas', "write all numbers alike"
        return None


def _stray(line: str) -> str:
    """What in a line makes it none, part of another, or more than one; empty if nothing does."""
    if "\0" in line:
        return "zero bytes, as a power cut leaves them"
    if line.count('"') % 2:
        return "a quote that is not closed"
    return "a carriage return inside the line" if "\r" in line else ""
