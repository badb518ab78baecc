"""Why a text file cannot be read, in one line: it is read again, slowly, up to the line that cannot be."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from io import BytesIO, TextIOWrapper
from itertools import islice
from shlex import quote

from dsd_cli.errors import DataError
from dsd_cli.files import csv_cells as cells
from dsd_cli.files import csv_dialect as dialects
from dsd_cli.files.csv_cells import Written
from dsd_cli.files.csv_dialect import Dialect
from dsd_cli.files.table_source import read_head

#: Rows that are looked at for their kinds, and those that each of two kinds has at least.
LOOKED_AT, FEW = 20_000, 10
_KIND = re.compile(r"[^\W\d]\w*")


def headless(name: str, head: bytes) -> DataError:
    """Why a file has no first line."""
    if not head:
        return DataError(f"{name}: is empty")
    return DataError(f"{name}: line 1 is too long for a header", "is it text, with a line for each sample?")


def why_unread(
    name: str, content: bytes | None, dialect: Dialect, places: Mapping[str, int], rows: int, error: Exception
) -> DataError:
    """The first line at or after `rows` rows that cannot be read, found by reading it again, slowly."""
    header = dialect.header
    start = dialect.skip + rows  # blank lines only make the true place later
    end = "\n" if b"\n" in read_head(name, 1 << 16) else "\r"
    source = open(name, "rb") if content is None else BytesIO(content)  # noqa: SIM115 (below)
    with TextIOWrapper(source, encoding="latin-1", newline=end) as file:  # bytes as they are
        for at, raw in enumerate(islice(file, start, None), start=start + 1):
            where = f"{name}, line {at}"
            line = dialects.decode(raw.rstrip("\r\n").encode("latin-1"))
            if not line.strip():
                continue
            if stray := _stray(line):
                return DataError(f"{where}: {stray}", "mend or delete the line")
            fields = dialects.fields_of(line, header.delimiter)
            if len(fields) != len(header.names):
                if kinds := _kinds(name, content, header.delimiter):
                    return kinds
                return DataError(
                    f"{where}: {len(fields)} fields where the header has {len(header.names)}",
                    "mend or delete the line",
                )
            for canonical, at in places.items():
                if problem := _problem(canonical, fields[at], dialect, dialect.written.get(at)):
                    return DataError(f'{where}, column "{header.names[at]}": {problem[0]}', problem[1])
    return DataError(f"{name}: cannot be read ({str(error).splitlines()[0]})")


def _kinds(name: str, content: bytes | None, delimiter: str) -> DataError | None:
    """Of rows that begin with the word for their kind, each as wide as its kind: how the largest is cut out; None: not
    so. Its names are those of a row that says them behind that word, as FMT of an autopilot's log does."""
    with open(name, "rb") if content is None else BytesIO(content) as file:
        lines = [dialects.decode(line.rstrip(b"\r\n")) for line in islice(file, LOOKED_AT)]
    rows = [[cell.strip() for cell in dialects.fields_of(line, delimiter)] for line in lines]
    kinds = Counter(row[0] for row in rows if _KIND.fullmatch(row[0]))
    widths = {(row[0], len(row)) for row in rows if kinds[row[0]] >= FEW}
    own = len({kind for kind, _ in widths}) == len(widths) and len({width for _, width in widths}) > 1
    if not own or min(width for _, width in widths) < 2 or sum(kinds.values()) < sum(map(any, rows)):
        return None
    kind = kinds.most_common(1)[0][0]
    fields = max(width for one, width in widths if one == kind) - 1
    said = (row[-fields:] for row in rows if kind in row[1:-fields] and all(map(_KIND.fullmatch, row[-fields:])))
    names = delimiter.join(["kind", *next(said, [str(k + 2) for k in range(fields)])])
    how = f"cut out the one with the motion: (echo '{names}'; grep '^{kind}{delimiter}' {quote(name)}) > {kind}.csv"
    return DataError(f"{name}: has rows of {len(kinds)} kinds, each with columns of its own: {', '.join(kinds)}", how)


def _problem(canonical: str, text: str, dialect: Dialect, how: Written | None) -> tuple[str, str] | None:
    found = text.strip()[:40]
    pointed = "." in text and dialect.decimal == "," and cells.is_number(text)
    try:
        (how.value if how else cells.seconds if canonical == "t" else cells.plain_number)(text)
    except ValueError:
        if pointed and how == cells.THOUSANDS:
            return f'"{found}" has a decimal point, the rows before have commas', "write all numbers alike"
        if how and cells.is_number(text):
            return f'"{found}" is not written as the rows before, {how}', "write all numbers alike"
        return f'"{found}" is not a number', "mend it, or leave it empty where a value is missing"
    if cells.DECIMAL_COMMA.fullmatch(text) and dialect.decimal == ".":
        return f'"{found}" has a decimal comma, the rows before have points', "write all numbers alike"
    if pointed and how is None:
        return f'"{found}" has a decimal point, the rows before have commas', "write all numbers alike"
    return None


def _stray(line: str) -> str:
    """What in a line makes it none, part of another, or more than one; empty if nothing does."""
    if "\0" in line:
        return "zero bytes, as a power cut leaves them"
    if line.count('"') % 2:
        return "a quote that is not closed"
    return "a carriage return inside the line" if "\r" in line else ""
