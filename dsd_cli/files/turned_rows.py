"""Text whose signals stand in its rows, a row of a name (and a unit) with all its samples: turned, as matrices are."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from itertools import dropwhile, pairwise, zip_longest

from dsd_cli.files.csv_cells import MISSING, is_number, number
from dsd_cli.files.csv_dialect import decode, fields_of, is_comment
from dsd_cli.files.formats.base import LONG, lies_in_rows

#: Cells at the begin of a row that may say of which signal it is.
_SAYING = 3
#: Cells of a row that are looked at, and the share of them that are numbers.
_SOME, _MOSTLY = 64, 0.9
#: Bytes that say it.
_HEAD = 4096
#: What a row of sheets is called that numbers the samples.
_NUMBERS = ("signal", "signals", "channel", "name", "sample", "samples", "index", "no", "no.", "nr", "n", "#")
#: What is said of it.
TURNED = "its signals stand in its rows, which are taken as columns"


class TurnedText(bytes):
    """What was text with its signals in its rows, with them in columns."""


def may_be_turned(head: bytes) -> bool:
    """Whether a text that begins so may be one: its first long line has very many numbers."""
    return _delimiter(decode(head)) is not None


def turned(content: bytes) -> TurnedText | None:
    """The same with its signals in columns and without a title above; None: they stand there already."""
    by = _delimiter(decode(content[:_HEAD]))
    if by is None:
        return None
    rows = [fields_of(line, by) for line in decode(content).splitlines() if not is_comment(line)]
    rows = [*dropwhile(lambda row: len(row) < LONG, rows)]
    most = max(map(len, rows))
    if len(rows) < 2 or not lies_in_rows((len(rows), most)) or min(map(len, rows)) < LONG:
        return None
    if all(is_number(row[0]) for row in rows) and not (_rises(rows[0]) and not _rises([row[0] for row in rows])):
        return None  # a table of very many channels, without names
    rows = rows[1:] if _only_counts(rows[0]) else rows
    out = io.StringIO()
    csv.writer(out, delimiter=by if by != " " else ",", lineterminator="\n").writerows(zip_longest(*rows, fillvalue=""))
    return TurnedText(out.getvalue().encode())


def said_of(content: bytes | None) -> list[str]:
    """What to say of the text of a file."""
    return [TURNED] if isinstance(content, TurnedText) else []


def _only_counts(cells: Sequence[str]) -> bool:
    """Whether it numbers the samples, as the header of a sheet does, and is called so: a signal may count as well."""
    numbers = [cell for cell in cells[1:] if is_number(cell)]
    return cells[0].strip().lower() in _NUMBERS and any(
        [*map(number, numbers)] == [*range(k, k + len(numbers))] for k in (0, 1)
    )


def _rises(cells: Sequence[str]) -> bool:
    """Whether they are numbers, each above the one before, as stamps are."""
    values = [number(cell) for cell in cells if is_number(cell)]
    return all(a < b for a, b in pairwise(values))


def _delimiter(text: str) -> str | None:
    """What stands between the cells of its first line that has many; None where none has, or they are no numbers."""
    for line in text.splitlines():
        for by in (";", "\t", ",", " "):
            cells = fields_of(line, by) if line.count(by) > LONG and not is_comment(line) else []
            if len(cells) > LONG + _SAYING:
                return by if _are_numbers(cells[_SAYING:-1]) else None  # the last may be cut
    return None


def _are_numbers(cells: Sequence[str]) -> bool:
    some = [cell for cell in cells[:_SOME] if cell.strip() not in MISSING]
    return sum(map(is_number, some)) > _MOSTLY * len(some)
