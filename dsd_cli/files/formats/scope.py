"""Text of a scope whose channels have stamps of their own: a column of time and one of values for each.

`Name a Name b` above them in the preamble of a scope, `time, a, time, b` in a header.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.content import content_of, text_of
from dsd_cli.files.csv_body import DELIMITERS
from dsd_cli.files.csv_cells import MISSING, is_number, number
from dsd_cli.files.csv_dialect import decode, fields_of
from dsd_cli.files.csv_layout import CsvLayout, Found, look
from dsd_cli.files.formats.base import InMemory
from dsd_cli.files.recognise import is_motion, is_time
from dsd_cli.files.table_source import read_head
from dsd_cli.signals.log import Array

#: Bytes that hold its preamble and its first rows.
HEAD = 1 << 13
_NUMBERED = re.compile(r"[ ._]?\d+$")
#: What the stamps of a plot are called, which may be a place as well.
_OF_A_PLOT = "x"


class ScopeFile(InMemory):
    """`name/time` and `name/value` for each channel; a channel ends where its cells do. See `Container`."""

    def __init__(self, path: str) -> None:
        lines = decode(text_of(path)).splitlines()
        found = look(path, _head(path), CsvLayout())
        names, units = found.header.names, found.units or []
        channels: dict[str, Array] = {}
        told: dict[str, str] = {}
        columns = _columns(path, lines, found)
        for at, name in list(enumerate(names))[1::2]:
            both = np.array([columns[at - 1], columns[at]])
            t, values = both[:, ~np.isnan(both[0])]
            of_it = f"{name} {at}" if f"{name}/value" in channels else name
            channels |= {f"{of_it}/time": t, f"{of_it}/value": values}
            told |= {f"{of_it}/time": _at(units, at - 1), f"{of_it}/value": _at(units, at)}
        super().__init__(channels, units=told)
        self.notes += found.notes


def is_scope(path: str | Path, head: bytes) -> bool:
    """Whether a file that begins so has channels with stamps that differ."""
    cells = (fields_of(decode(line), by) for line in head.splitlines() for by in DELIMITERS[:3])
    if not any(_paired(one) or _paired(one[:-1]) for one in cells):  # the last may be a column for comments
        return False
    try:
        lines = _head(path)
        found = look(str(path), lines, CsvLayout())
    except DataError:
        return False
    width = len(found.header.names)
    rows = [fields_of(line, found.header.delimiter) for line in lines[found.skip :] if line.strip()]
    stamps = [[cell.strip() for cell in row[: width - 1 : 2]] for row in rows]
    differ = any(len(set(row)) > 1 or 2 * len(row) < width for row in stamps)
    return differ and _paired(found.header.names) and (is_time(found.header.names[0]) or _rise(stamps))


def _rise(rows: Sequence[Sequence[str]]) -> bool:
    """Whether no column falls from row to row, as long as it has cells: what swings is measured."""
    longest = max(map(len, rows), default=0)
    columns = [[row[at] for row in rows if at < len(row) and row[at] not in MISSING] for at in range(longest)]
    return all(all(map(is_number, cells)) and np.all(np.diff([*map(number, cells)]) >= 0.0) for cells in columns)


def _head(path: str | Path) -> list[str]:
    text = content_of(path, HEAD)
    return decode(read_head(path, HEAD) if text is None else text).splitlines()[:-1]


def _paired(names: Sequence[str]) -> bool:
    """Whether these name times and what was measured then, in turn; the keys of a preamble do, too."""
    names = [name.strip(' "').casefold() for name in names]
    names = names[:-1] if names and not names[-1] else names
    clocks = {_NUMBERED.sub("", name) for name in names[::2]}
    of_values = names[1::2]
    of_one = len(clocks) == 1 and (clocks == {_OF_A_PLOT} or not is_motion(names[0], ""))
    return (
        len(names) >= 4
        and len(names) % 2 == 0
        and (of_one or all(map(is_time, clocks)))
        and all(name and not is_number(name) for name in (*clocks, *of_values))
        and clocks.isdisjoint(_NUMBERED.sub("", name) for name in of_values)
    )


def _at(units: Sequence[str], at: int) -> str:
    return units[at] if at < len(units) else ""


def _columns(path: str, lines: list[str], found: Found) -> list[Array]:
    """Every column, NaN where it has no cell."""
    width = len(found.header.names)
    columns: list[list[float]] = [[] for _ in range(width)]
    for at, line in enumerate(lines[found.skip :], start=found.skip + 1):
        cells = fields_of(line, found.header.delimiter)
        if not line.strip() or len(cells) > width:
            continue
        for k in range(width):
            cell = cells[k].strip() if k < len(cells) else ""
            if cell not in MISSING and not is_number(cell):
                raise DataError(f'{path}, line {at}: "{cell[:40]}" is not a number', "mend or delete the line")
            columns[k].append(np.nan if cell in MISSING else number(cell))
    return [np.array(column) for column in columns]
