"""What is behind or among the rows of a text and is none: a footer, a cut line, the header again, ended columns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

from dsd_cli.files.csv_body import GOES_ON, rises
from dsd_cli.files.csv_cells import is_number
from dsd_cli.files.csv_dialect import COMMENT, decode, fields_of

_COMMENT = tuple(map(str.encode, COMMENT))
#: Bytes in which the header ends.
_HEAD = 1 << 16


def behind_rows(lines: Sequence[bytes], delimiter: str, width: int, row: Sequence[str]) -> tuple[int, list[str]]:
    """How many bytes at the end of these lines are no rows, and what to say of them; `row`: cells of one that is."""
    if half := _cut_off(lines, delimiter, width):
        return len(half), ["its last line is cut off in the middle, and left out"]
    cut = _footer(lines, delimiter, width, [k for k, cell in enumerate(row) if cell.strip() and is_number(cell)])
    if not cut.strip():
        return 0, []
    said = [f"{sum(bool(line.strip()) for line in cut.splitlines())} line(s) of text at its end are left out"]
    if half := _cut_off(lines[: len(lines) - len(cut.splitlines())], delimiter, width, followed=True):
        said.append("the line before them is cut off in the middle, and left out")
    return len(cut) + len(half), said


def _cut_off(lines: Sequence[bytes], delimiter: str, width: int, followed: bool = False) -> bytes:
    """The last line where it has no end and not all fields: the recording ended in the middle of it.

    followed : by a text of whoever wrote the file, which ended the line.
    """
    if not lines or (lines[-1].endswith((b"\n", b"\r")) and not followed):
        return b""
    fields = fields_of(decode(lines[-1]).rstrip("\r\n"), delimiter)  # tabs at its end are cells without a value
    return lines[-1] if len(lines) > 1 and len(fields) < width and is_number(fields[0].strip(' "')) else b""


def _footer(lines: Sequence[bytes], delimiter: str, width: int, numeric: Sequence[int]) -> bytes:
    """What at the end of a file is no row: lines of text behind the numbers, set off by a blank one or by their form.

    A row that was cut, or that has a bad cell, is none of them: it is for the reader to complain about. `Sum;1.5;2.5`
    at the very end, where the other rows begin with a number, is of a spreadsheet.
    """
    cut: list[bytes] = []
    rest = 0
    for raw in reversed(lines):
        text = decode(raw)
        fields = fields_of(text.rstrip("\r\n") if delimiter == "\t" else text.strip(), delimiter)
        place, first = next(((k, cell.strip(' "')) for k, cell in enumerate(fields) if cell.strip(' "')), (0, ""))
        if first:
            if any(k < len(fields) and fields[k].strip(' "') and is_number(fields[k]) for k in numeric[:1]):
                break
            if not (first[:1].isalpha() or first.startswith((*COMMENT, *"[<*=;"))):
                break
        cut.append(raw)
        of_words = place in numeric and first.isalpha()
        if len(fields) != width or of_words or not any(map(is_number, fields)):  # else it may be a row with a bad cell
            rest = len(cut)
    return b"".join(reversed(cut[:rest]))


class Head:
    """The lines above the rows of a text, which come again where its logger was started once more.

    Every reader of text asks here. Rows without stamps are another recording from there on: nothing else says so.

    Attributes
    ----------
    begins : how many rows came before each time.
    """

    def __init__(self, lines: Iterable[bytes]) -> None:
        self._lines = {line.strip() for line in lines if line.strip(b" ,;\t\r\n")}  # a row of blank cells says nothing
        self._first = 0
        self.begins: list[int] = []

    def comes_again(self, line: bytes, at: int, rows: int) -> bool:
        """Whether line `at`, from 1, is one of them; `rows` came before it."""
        if line.strip() not in self._lines:
            return False
        self._first = self._first or at
        self.begins += [rows] if self.begins[-1:] != [rows] else []
        return True

    def said(self, stamped: bool) -> list[str]:
        """What there is to say of it."""
        then = "is left out" if stamped else "begins another recording"
        again = f"its header comes again {len(self.begins)} time(s), first in line {self._first}, and {then}"
        return [again] if self.begins else []


def without_copies_of_head(content: bytes, skip: int) -> tuple[bytes, Head] | None:
    """A text in which blank lines stand for lines like the first `skip` ones that come again, and for comments among
    the rows; None: there are none."""
    above = content[:_HEAD].splitlines(keepends=True)[:skip]
    head, rows, at, begin, whole = Head(above), 0, skip, sum(map(len, above)), memoryview(content)
    ends = b"\n" if b"\n" in content[:_HEAD] else b"\r"
    kept, copied = bytearray(), 0  # what is copied already
    while begin < len(content):
        end = content.find(ends, begin) + 1 or len(content)
        line, at = content[begin:end], at + 1
        if head.comes_again(line, at, rows) or line.lstrip().startswith(_COMMENT):
            kept += whole[copied:begin]
            kept += ends
            copied = end
        else:
            rows += bool(line.strip())
        begin = end
    kept += whole[copied:] if copied else b""
    return (bytes(kept), head) if copied else None


def with_ended_columns(content: bytes, skip: int, delimiter: str, width: int) -> tuple[bytes, str] | None:
    """A text with empty cells for columns that end before the others, and what to say of it; None: none do.

    A scope writes channels that were sampled at another rate beside each other, each group with stamps of its own: the
    slower one has fewer rows. So rows become shorter only, and what ends begins with a clock; of a row that was cut, or
    that lacks a cell, neither is so.
    """
    if delimiter == " " or b'"' in content:
        return None
    by, lines = delimiter.encode(), content.splitlines(keepends=True)
    fields = [line.count(by) + 1 if line.strip() else 0 for line in lines]
    rows = [at for at in range(skip, len(lines)) if fields[at]]
    if any(fields[a] < fields[b] for a, b in pairwise(rows)):
        return None
    ends = [(a, fields[b]) for a, b in pairwise(rows) if fields[b] < fields[a]]  # the last row with them, the first one
    for last, column in ends:
        before = [at for at in rows if at <= last][-GOES_ON:]
        stamps = [fields_of(decode(lines[at]).strip("\r\n"), delimiter)[column] for at in before]
        if len(stamps) < GOES_ON or not rises(stamps, evenly=True):
            return None
    if not ends or fields[rows[0]] != width:
        return None
    for at in rows:
        if fields[at] < width:
            lines[at] = lines[at].rstrip(b"\r\n") + by * (width - fields[at]) + b"\n"
    widths = [width, *(column for _, column in ends)]
    said = [f"{column + 1} to {wide} in line {last + 1}" for wide, (last, column) in zip(widths, ends, strict=False)]
    return b"".join(lines), f"columns end before the others: {', '.join(said)}"
