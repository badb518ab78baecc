"""What stands behind or among the rows of a text file and is none: a footer, a line that was cut, the header again."""

from __future__ import annotations

from collections.abc import Sequence

from dsd_cli.files.csv_cells import is_number
from dsd_cli.files.csv_dialect import COMMENT, decode, fields_of


def behind_rows(lines: Sequence[bytes], delimiter: str, width: int, row: Sequence[str]) -> tuple[int, list[str]]:
    """How many bytes at the end of these lines are no rows, and what to say of them; `row`: cells of one that is."""
    if half := _cut_off(lines, delimiter, width):
        return len(half), ["its last line is cut off in the middle, and left out"]
    cut = _footer(lines, delimiter, width, [k for k in range(len(row)) if is_number(row[k])])
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
    fields = fields_of(decode(lines[-1]).strip(), delimiter)
    return lines[-1] if len(lines) > 1 and len(fields) < width and is_number(fields[0].strip(' "')) else b""


def _footer(lines: Sequence[bytes], delimiter: str, width: int, numeric: Sequence[int]) -> bytes:
    """What at the end of a file is no row: lines of text behind the numbers, set off by a blank one or by their form.

    A row that was cut, or that has a bad cell, is none of them: it is for the reader to complain about.
    """
    cut: list[bytes] = []
    rest = 0
    for raw in reversed(lines):
        fields = fields_of(decode(raw).strip(), delimiter)
        first = fields[0].strip(' "') if fields else ""
        if first or len(fields) > 1:
            if any(k < len(fields) and is_number(fields[k]) for k in numeric[:1]):
                break
            if not (first[:1].isalpha() or first.startswith((*COMMENT, *"[<*=;"))):
                break
        cut.append(raw)
        if len(fields) != width or not any(is_number(cell) for cell in fields):  # else it may be a row with a bad cell
            rest = len(cut)
    return b"".join(reversed(cut[:rest]))


def without_copies_of_head(content: bytes, skip: int) -> tuple[bytes, list[int], int] | None:
    """A text in which blank lines stand for lines like the first `skip` ones that come again, the rows that follow
    them, and the first such line, from 1; None: none comes again."""
    lines = content.splitlines(keepends=True)
    head = {line.strip() for line in lines[:skip] if line.strip()}
    kept, rows, begins, first = lines[:skip], 0, list[int](), 0
    for at, line in enumerate(lines[skip:], start=skip + 1):
        if line.strip() in head:
            kept.append(b"\n")
            begins += [rows] if rows not in begins else []
            first = first or at
        else:
            kept.append(line)
            rows += bool(line.strip())
    return (b"".join(kept), begins, first) if begins else None
