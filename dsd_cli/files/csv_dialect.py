"""What a CSV file looks like: where its header is, what separates its columns, how it writes numbers."""

from __future__ import annotations

import csv
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

from dsd_cli.errors import DataError
from dsd_cli.files.csv_cells import DECIMAL_COMMA, MISSING, Written, decimal_signs, is_number, written
from dsd_cli.files.recognise import is_time

DELIMITERS = (",", ";", "\t")
COMMENT = ("#", "%")
#: What tables for the eye rule off their header with: `--- ---`, `|---|:--:|`, `+----+`; and `sep=;` for spreadsheets.
RULER = re.compile(r"[\s|:+]*(?:[-=]{3,}[\s|:+]*)+|\"?sep=.\"?")
#: Encodings of text, and what shows that it is one of them: kana, what is measured in Chinese, signs of Windows.
_ENCODINGS = (
    ("utf-8", re.compile("")),
    ("cp932", re.compile("[\u3041-\u30fa]{2}")),
    ("gb18030", re.compile("[\u8f6c\u626d]\u77e9|\u901f\u5ea6|\u8f6c\u901f|\u4f4d\u7f6e|\u7535\u6d41")),
    ("cp1252", re.compile("[^\0-\xff]")),
)
_UNIT = re.compile(r"\s*[-+]?[\d.,]+\s*([^\s\d.,'+-]\S*)\s*$", re.ASCII)
_OTHER_FORMATS = {
    b"version https://git-lfs.github.com/spec/v1": (
        "is a pointer of Git LFS, the file itself was not fetched",
        "git lfs pull",
    ),
    b"WPILOG": ("is a data log of WPILib", "AdvantageScope exports it as CSV or MCAP"),
    b"<!": ("is a web page", "fetch the file itself"),
    b"<html": ("is a web page", "fetch the file itself"),
    b"<?xml": ("is XML", "export it as CSV"),
    b"header:\n": ("is what a topic was echoed as", "record a bag, or echo it with --csv (ROS 1: -p)"),
    b"header: \n": ("is what a topic was echoed as", "record a bag, or echo it with --csv (ROS 1: -p)"),
    b"Obj\x01": ("is an Avro file", "write it as Parquet or CSV"),
    b"\xd0\xcf\x11\xe0": ("is a workbook of an old Excel (.xls)", "save it as .xlsx or CSV"),
    b"\x1f\x8b": ("is gzip-compressed", "unpack it first"),
    b"PK\x03\x04": ("is a zip archive or a spreadsheet", "export it as CSV"),
    b"\xff\xfe": ("is UTF-16 text", "save it as UTF-8"),
    b"\xfe\xff": ("is UTF-16 text", "save it as UTF-8"),
}


#: A frame as candump prints it: `(1436509052.249713) can0 123#1122`, `can0  123   [2]  11 22`; and how traces of Vector
#: (.asc, .blf), PCAN (.trc) and python-can (.csv) begin.
_FRAME = re.compile(
    rb"\s*(?:\(\d+\.\d+\)\s+)?v?x?l?can\d+\s+[0-9A-F]{3,8}(?:#|\s+\[\d+\])"
    rb"|date [^\n]*\n\s*base (?:hex|dec)|LOGG.\0\0\0|;\$FILEVERSION=\d|timestamp,arbitration_id,extended,",
    re.DOTALL,
)
_KNOWN = "export it as one of CSV, Parquet, Arrow, MAT, HDF5, NetCDF, NumPy, MDF, TDMS, MCAP, ROS bag, JSON"


class Header(NamedTuple):
    """Column names, what separates them, and whether the line after the comments was data already."""

    names: list[str]
    delimiter: str
    line_is_data: bool = False


class Dialect(NamedTuple):
    """`header` and what was seen of the data: `skip` lines come before it, `first` is its first row ([] if none).

    `written`: place -> how its column writes numbers, where that is more than digits and the decimal sign.
    """

    header: Header
    skip: int
    first: list[str]
    decimal: str
    units: list[str] | None
    written: Mapping[int, Written] = {}


def refuse_other_formats(source: str, head: bytes) -> None:
    """One line for what is no CSV at all."""
    if _FRAME.match(head):
        told = "decode them by the bus's DBC (asammdf or cantools) into MDF or CSV"
        raise DataError(f"{source}: holds raw frames of a CAN bus, whose bytes it does not explain", told)
    for magic, (found, remedy) in _OTHER_FORMATS.items():
        if head.startswith(magic):
            raise DataError(f"{source}: {found}", remedy)
    if b"\0" in head and head.rstrip(b"\0").count(b"\0"):  # zeros at the end alone were lines once, see `_explain`
        raise DataError(f"{source}: is neither CSV nor Parquet, nor of another known format", _KNOWN)


def decode(line: bytes) -> str:
    """A line as text."""
    return line.decode(encoding_of(line)).removeprefix("\ufeff")


def encoding_of(content: bytes) -> str:
    """UTF-8, else one of two bytes a letter where that gives letters that are usual there, else Latin.

    That of Windows, which has more signs (per mille, quotes), is it where one of these is there."""
    for encoding, usual in _ENCODINGS:
        with suppress(UnicodeDecodeError):
            if usual.search(content.decode(encoding)):
                return encoding
    return "latin-1"


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
    return [_unquoted(name.strip()).strip() for name in fields_of(line, delimiter)], delimiter


def _unquoted(name: str) -> str:
    """Without quotes around it; `"Axis_1".ActualPosition` has them around a part alone, which are of the name."""
    inside = name.strip('"')
    return name if '"' in inside else inside


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


def numbered(names: Sequence[str], wanted: Iterable[str], below: Sequence[str] = ()) -> list[str]:
    """The names, but numbers, from 1, of columns that are wanted by it or that have no name, where no other has that.

    below : cells of a row; a column without a name and a cell is the delimiter at the end of lines.
    """
    found = list(names)
    for text in wanted:
        if text not in found and text.isascii() and text.isdigit() and 0 < int(text) <= len(found):
            found[int(text) - 1] = text
    for k, cell in enumerate(below[: len(found)]):
        if not found[k] and cell.strip() and str(k + 1) not in found:
            found[k] = str(k + 1)
    return found


def by_number(names: Sequence[str]) -> list[str]:
    """The names, but numbers, from 1, of columns whose name one before them has."""
    again = [name in names[:at] and str(at + 1) not in names for at, name in enumerate(names)]
    return [str(at + 1) if again[at] else name for at, name in enumerate(names)]


def without_copies(names: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The names, with a number behind those of clocks that have in all these rows what the first of their name has:
    one clock, beside each channel. What LabVIEW has there is the X of a plot, which is no name of a time."""
    rows = [row for row in rows if len(row) == len(names)]
    found = list(names)
    for at, name in enumerate(names):
        first, other = names.index(name), f"{name} {names[: at + 1].count(name)}"
        if first == at or other in names or not (is_time(name) or name == "X_Value"):
            continue
        stamps = [(row[first], row[at]) for row in rows if is_number(row[first])]
        if stamps and all(one == copy for one, copy in stamps):
            found[at] = other
    return found


def _at_first(cells: Sequence[str], sure: Collection[str]) -> Written | None:
    """Of a column in several units, how it is written with the first: whoever reads it says where that changes."""
    units = {cell: match[1] for cell in cells if (match := _UNIT.match(cell))}
    first = next(iter(units.values()), "")
    found = written([cell for cell in cells if units.get(cell) == first], sure) if first else None
    return found if found and found.unit else None


def look_at_rows(
    lines: Sequence[str], header: Header, skip: int, needed: Sequence[int], units: list[str] | None = None
) -> Dialect:
    """Units row and decimal sign, from the first lines; `needed`: places of the columns that are read.

    `units`: those that are known already. Without any that is needed, all are looked at.
    """
    told = [(at, line) for at, line in enumerate(lines[skip:], start=skip) if not is_comment(line)]
    rows = [(at, fields_of(line, header.delimiter)) for at, line in told]
    if units is None and len(rows) > 1 and is_units_row(rows[0][1], needed) and not is_units_row(rows[1][1], needed):
        units = [text.strip() for text in rows[0][1]]
        skip = rows[0][0] + 1
        rows = rows[1:]
    whole = [fields for at, fields in rows if lines[at].count('"') % 2 == 0]  # behind a stray quote a comma is none
    columns = [[fields[k] for fields in whole if len(fields) == len(header.names)] for k in range(len(header.names))]
    sure = decimal_signs(cell for cells in columns for cell in cells)
    how = {k: found for k, cells in enumerate(columns) if (found := written(cells, sure) or _at_first(cells, sure))}
    cells = (cell for fields in whole for k, cell in enumerate(fields) if k not in how and (k in needed or not needed))
    decimal = "," if any("," in cell and DECIMAL_COMMA.fullmatch(cell) for cell in cells) else "."
    return Dialect(header, skip, rows[0][1] if rows else [], decimal, units, how)
