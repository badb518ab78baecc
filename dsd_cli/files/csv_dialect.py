"""What a CSV file looks like: where its header is, what separates its columns, how it writes numbers."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.signals.log import Array

DELIMITERS = (",", ";", "\t")
#: What loggers write where there is no value; "nan" and "inf" are numbers to both parsers.
MISSING = frozenset(
    f"{pad}{token}"
    for pad in ("", " ")
    for token in (
        "", "NA", "N/A", "n/a", "na", "#N/A", "null", "NULL", "Null", "None", "none", "-", "--", "?",
        "-nan", "-NaN", "-nan(ind)", "nan(ind)", "1.#QNAN", "-1.#IND", "1.#INF", "-1.#INF",
    )
)  # fmt: skip
COMMENT = ("#", "%")
#: What tables for the eye rule off their header with: `--- ---`, `|---|:--:|`, `+----+`.
RULER = re.compile(r"[\s|:+]*(?:[-=]{3,}[\s|:+]*)+")
DECIMAL_COMMA = re.compile(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*")
ISO_TIME = re.compile(r"\s*\d{4}-\d\d-\d\d[ T]\d\d:\d\d")
SPOKEN_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "min": 60.0, "hr": 3600.0}
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
#: `0.004 sec`; [31.12.2024, 12/31/2024, 31-Dec-2024 or 2 days] 23:59:59.999 [PM].
SPOKEN_TIME = re.compile(
    r"\s*(?:([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s?(s|sec|ms|msec|us|min|hr)"
    r"|(?:(\d{1,2}\.\d{1,2}\.\d{4})[ T]|(\d{1,2}/\d{1,2}/\d{4}) |(\d{1,2}-[A-Za-z]{3}-\d{4}) )?"
    r"(?:(\d+) days? )?(\d{1,3}):(\d\d):(\d\d(?:[.,]\d+)?) ?([AaPp][Mm])?)\s*"
)
_OTHER_FORMATS = {
    b"version https://git-lfs.github.com/spec/v1": (
        "is a pointer of Git LFS, the file itself was not fetched",
        "git lfs pull",
    ),
    b"SQLite format 3\0": ("is an SQLite database", "write its table as CSV: sqlite3 -header -csv FILE 'select * ..'"),
    b"WPILOG": ("is a data log of WPILib", "AdvantageScope exports it as CSV or MCAP"),
    b"Obj\x01": ("is an Avro file", "write it as Parquet or CSV"),
    b"\x1f\x8b": ("is gzip-compressed", "unpack it first"),
    b"PK\x03\x04": ("is a zip archive or a spreadsheet", "export it as CSV"),
    b"\xff\xfe": ("is UTF-16 text", "save it as UTF-8"),
    b"\xfe\xff": ("is UTF-16 text", "save it as UTF-8"),
}


_KNOWN = "export it as one of CSV, Parquet, Arrow, MAT, HDF5, NetCDF, NumPy, MDF, TDMS, MCAP, ROS bag, JSON"


class Header(NamedTuple):
    """Column names, what separates them, and whether the line after the comments was data already."""

    names: list[str]
    delimiter: str
    line_is_data: bool = False


class Dialect(NamedTuple):
    """`header` and what was seen of the data: `skip` lines come before it, `first` is its first row ([] if none)."""

    header: Header
    skip: int
    first: list[str]
    decimal: str
    units: list[str] | None


def refuse_other_formats(source: str, head: bytes) -> None:
    """One line for what is no CSV at all."""
    for magic, (found, remedy) in _OTHER_FORMATS.items():
        if head.startswith(magic):
            raise DataError(f"{source}: {found}", remedy)
    if b"\0" in head and head.rstrip(b"\0").count(b"\0"):  # zeros at the end alone were lines once, see `_explain`
        raise DataError(f"{source}: is neither CSV nor Parquet, nor of another known format", _KNOWN)


def decode(line: bytes) -> str:
    try:
        return line.decode("utf-8-sig")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def split(line: str, delimiter: str) -> list[str]:
    if '"' not in line:
        return line.split(delimiter)
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:  # a carriage return outside quotes, or a field of more than 128 KiB
        return line.split(delimiter)


def fields_of(line: str, delimiter: str) -> list[str]:
    """The fields of a line; of blanks any number separates."""
    if delimiter != " ":
        return split(line, delimiter)
    return line.split() if '"' not in line else [cell for cell in split(line.strip(), " ") if cell]


def is_comment(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith(COMMENT) or RULER.fullmatch(line) is not None


def uncommented(line: str) -> str:
    """What a comment says: `%time,field.x` and `# t u q` are headers of many tools."""
    return "" if RULER.fullmatch(line) else line.strip().lstrip("".join(COMMENT)).lstrip()


def number(text: str) -> float:
    """The value of a field, NaN for a missing one; a decimal comma is understood.

    Raises
    ------
    ValueError : it is not a number.
    """
    try:
        if "_" in text or not text.isascii():  # 1_000 is a number to Python, and to nobody who writes logs
            raise ValueError
        return float(text)
    except ValueError:
        if text.strip() in MISSING:
            return math.nan
        if DECIMAL_COMMA.fullmatch(text):
            return float(text.replace(",", "."))
        raise


def seconds(text: str) -> float:
    """A time stamp: a number, or a date and time (taken as UTC without a zone) as seconds since 1970.

    Dates are ISO 8601, 31.12.2024, 12/31/2024 or 31-Dec-2024; hours with minutes and seconds alone, and `0.004 sec`,
    are durations.

    Raises
    ------
    ValueError : it is none of these.
    """
    if ISO_TIME.match(text):
        stamp = datetime.fromisoformat(text.strip())
        return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    if (found := SPOKEN_TIME.fullmatch(text)) is None:
        return number(text)
    value, unit, dotted, slashed, spelt, days, hours, minutes, rest, half = found.groups()
    if unit:
        return number(value) * SPOKEN_UNITS[unit.lower()]
    day = 86400.0 * int(days or 0)
    if date := dotted or slashed or spelt:
        parts = [MONTHS.index(one.lower()) + 1 if one.isalpha() else int(one) for one in re.split(r"[./-]", date)]
        year, month, of_month = (parts[2], parts[0], parts[1]) if slashed else (parts[2], parts[1], parts[0])
        day = datetime(year, month, of_month, tzinfo=UTC).timestamp()
    hour = int(hours) % 12 + 12 * (half.lower() == "pm") if half else int(hours)
    return day + 3600.0 * hour + 60.0 * int(minutes) + number(rest)


def has_zone(text: str) -> bool:
    """Whether a time stamp says its time zone; what looks like one and is no time (23:59:60) does not."""
    try:
        return datetime.fromisoformat(text.strip()).tzinfo is not None
    except ValueError:
        return False


def is_number(text: str) -> bool:
    try:
        seconds(text)
    except ValueError:
        return False
    return True


def stamps_in(texts: Sequence[str | None]) -> Array | None:
    """Stamps in words as s, and numbers; None: they are something else."""
    there = [text for text in texts[:20] if text is not None and text.strip() not in MISSING]
    if not there or not all(map(is_number, there)):
        return None
    try:
        return np.array([math.nan if text is None else seconds(text) for text in texts])
    except ValueError:
        return None


def read_header(source: str, comment: str, line: str, below: str | None = None) -> Header:
    """The header is `line`, or, when that is a row already, the comment before it.

    `below`: the line after it; None: a stream, it has not come yet.

    Raises
    ------
    DataError : there are no names.
    """
    header = Header(*_names(line))
    names, delimiter = _names(uncommented(comment))
    one_column = len(names) == 1 and not names[0].split()[1:]  # of several words it is a sentence
    fits = len(names) == len(split(line, delimiter)) and not any(map(is_number, names))
    under = None if below is None else split(below, header.delimiter)
    if fits and (one_column or len(names) > 1) and _is_row(header.names, under):
        return Header(names, delimiter, line_is_data=True)
    if not all(map(is_number, header.names)):
        return header
    raise DataError(f"{source}: has no header, its first line is numbers", "say so: [csv] header = 0")


def _is_row(cells: Sequence[str], under: Sequence[str] | None) -> bool:
    """Whether most of it are numbers, and its words are words in the next row too (`frame_id` of rostopic).

    Before there is a next row, one that begins with a word is none, as a row begins with its stamp, unless it has
    a fraction: columns that are called by numbers are called by whole ones.
    """
    words = [at for at, cell in enumerate(cells) if not is_number(cell)]
    if 2 * len(words) >= len(cells):
        return False
    if under is None:
        return 0 not in words or any("." in cell and is_number(cell) for cell in cells)
    return not any(at < len(under) and under[at].strip() not in MISSING and is_number(under[at]) for at in words)


def live_header(source: str, comment: str, line: str, delimiter: str | None, bare: bool) -> Header:
    """As `read_header`, of a line of a stream; `bare`: there is no header, its columns have numbers for names.

    Raises
    ------
    DataError : there are no names, and nobody said so.
    """
    if not bare and delimiter is None:
        return read_header(source, comment, line)
    names, delimiter = _names(line, delimiter)
    return Header([str(k + 1) for k in range(len(names))] if bare else names, delimiter, line_is_data=bare)


def _names(line: str, delimiter: str | None = None) -> tuple[list[str], str]:
    delimiter = delimiter or max(DELIMITERS, key=lambda candidate: len(split(line, candidate)))
    return [name.strip().strip('"').strip() for name in fields_of(line, delimiter)], delimiter


def is_units_row(fields: Sequence[str], needed: Iterable[int]) -> bool:
    """Text in every needed column, as in "s;V;Nm" under the header."""
    shown = [fields[i].strip() for i in needed if i < len(fields)]
    return bool(shown) and all(text and text not in MISSING and not is_number(text) for text in shown)


def find_header(source: str, lines: Sequence[str]) -> tuple[Header, int]:
    """The header of a file that begins with these lines, and how many lines come before the data.

    Raises
    ------
    DataError : nothing but comments, or no names.
    """
    comment = ""
    for count, line in enumerate(lines):
        if is_comment(line):
            comment = line if uncommented(line) else comment
            continue
        below = next((other for other in lines[count + 1 :] if not is_comment(other)), "")
        header = read_header(source, comment, line, below)
        return header, count + (not header.line_is_data)
    raise DataError(f"{source}: is empty" if not any(lines) else f"{source}: has no header and no rows")


def numbered(names: Sequence[str], wanted: Iterable[str]) -> list[str]:
    """The names, but for columns that are wanted by their number, from 1, where no column has that for a name."""
    found = list(names)
    for text in wanted:
        if text not in found and text.isascii() and text.isdigit() and 0 < int(text) <= len(found):
            found[int(text) - 1] = text
    return found


def look_at_rows(
    lines: Sequence[str], header: Header, skip: int, needed: Sequence[int], units: list[str] | None = None
) -> Dialect:
    """Units row and decimal sign, from the first lines; `needed`: places of the columns that are read.

    `units`: those that are known already.
    """
    told = [(at, line) for at, line in enumerate(lines[skip:], start=skip) if not is_comment(line)]
    rows = [(at, fields_of(line, header.delimiter)) for at, line in told]
    if units is None and len(rows) > 1 and is_units_row(rows[0][1], needed) and not is_units_row(rows[1][1], needed):
        units = [text.strip() for text in rows[0][1]]
        skip = rows[0][0] + 1
        rows = rows[1:]
    whole = (fields for at, fields in rows if lines[at].count('"') % 2 == 0)  # behind a stray quote a comma is none
    cells = (fields[i] for fields in whole for i in needed if i < len(fields))
    decimal = "," if any("," in cell and DECIMAL_COMMA.fullmatch(cell) for cell in cells) else "."
    return Dialect(header, skip, rows[0][1] if rows else [], decimal, units)
