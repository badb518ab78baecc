"""Text of a scope whose channels have stamps of their own: a column of time, one of values, and more, for each.

`Name a Name b` above them in the preamble of a scope, `time, a, time, b` or `time, a, status, time, b, status` in a
header.
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
from dsd_cli.files.csv_end import behind_rows
from dsd_cli.files.csv_factors import Scaling
from dsd_cli.files.csv_layout import CsvLayout, Found, look
from dsd_cli.files.formats.base import InMemory
from dsd_cli.files.names_in import is_unit
from dsd_cli.files.recognise import is_motion, is_time
from dsd_cli.files.table_source import read_head
from dsd_cli.signals.log import Array

#: Bytes that hold its preamble and its first rows.
HEAD = 1 << 13
_NUMBERED = re.compile(r"[ ._]?\d+$")
#: What the stamps of a plot are called, which may be a place as well.
_OF_A_PLOT = {"x", "x_value"}
#: What the last column is called where it is none of a channel.
_NO_CHANNEL = ("", "comment")
#: Columns that a channel may have, and what that of its values is called below its name.
COLUMNS = (2, 3, 4)
_VALUES = {"value", "val", "wert", "y"}


class ScopeFile(InMemory):
    """`name/time` and `name/value` for each channel; a channel ends where its cells do. See `Container`."""

    def __init__(self, path: str, scaled: bool | None = None) -> None:
        text, found = text_of(path), look(path, _head(path), CsvLayout())
        raw, by = text.splitlines(keepends=True)[found.skip :], found.header.delimiter
        cut, said = behind_rows(raw, by, len(found.header.names), fields_of(decode(raw[0]), by) if raw else [])
        lines = decode(text[: len(text) - cut]).splitlines()
        scaling = Scaling(path, found.factors, found.header.names, scaled)
        names, units = found.header.names, found.units or []
        channels: dict[str, Array] = {}
        told: dict[str, str] = {}
        period = _period(names)
        columns, words = _columns(path, lines, found, period)
        for at, name in enumerate(names):
            clock = at - at % period
            if at == clock or at in words:
                continue
            both = np.array([columns[clock], columns[at]])
            t, values = (scaling.applied(*one) for one in zip((clock, at), both[:, ~np.isnan(both[0])], strict=True))
            group, _, last = name.rpartition("/")
            of_it = group if group and last.casefold() in _VALUES else name
            of_it = f"{of_it} {at}" if f"{of_it}/value" in channels else of_it
            channels |= {f"{of_it}/time": t, f"{of_it}/value": values}
            beside = next((words[k] for k in range(clock, clock + period) if is_unit(words.get(k, ""))), "")
            told |= {f"{of_it}/time": _at(units, clock), f"{of_it}/value": _at(units, at) or beside}
        super().__init__(channels, units=told)
        self.notes += [*found.notes, *said, *scaling.said]


def is_scope(path: str | Path, head: bytes) -> bool:
    """Whether a file that begins so has channels with stamps that differ."""
    cells = (fields_of(decode(line), by) for line in head.splitlines() for by in DELIMITERS[:3])
    if not any(_period(one) or _period(one[:-1]) for one in cells):  # the last may be a column for comments
        return False
    try:
        lines = _head(path)
        found = look(str(path), lines, CsvLayout())
    except DataError:
        return False
    width, period = len(found.header.names), _period(found.header.names)
    if not period:
        return False
    rows = [fields_of(line, found.header.delimiter) for line in lines[found.skip :] if line.strip()]
    stamps = [[cell.strip() for cell in row[: width - period + 1 : period]] for row in rows]
    differ = any(len(set(row)) > 1 or 2 * len(row) < width / period for row in stamps)
    return differ and (is_time(found.header.names[0]) or _rise(stamps))


def _rise(rows: Sequence[Sequence[str]]) -> bool:
    """Whether no column falls from row to row, as long as it has cells: what swings is measured."""
    longest = max(map(len, rows), default=0)
    columns = [[row[at] for row in rows if at < len(row) and row[at] not in MISSING] for at in range(longest)]
    return all(all(map(is_number, cells)) and np.all(np.diff([*map(number, cells)]) >= 0.0) for cells in columns)


def _head(path: str | Path) -> list[str]:
    text = content_of(path, HEAD)
    return decode(read_head(path, HEAD) if text is None else text).splitlines()[:-1]


def _period(names: Sequence[str]) -> int:
    """How many columns a channel has, if each has a time, a value, and what else: its status, its unit; 0: they do not.

    The keys of a preamble name them in turn, too.
    """
    names = [name.strip(' "').casefold() for name in names]
    names = names[:-1] if names and names[-1] in _NO_CHANNEL else names
    return next((many for many in COLUMNS if _in_turn(names, many)), 0)


def _in_turn(names: Sequence[str], many: int) -> bool:
    named = len(names) >= 2 * many and len(names) % many == 0 and all(names)
    if not named or any(map(is_number, names)):  # of most lines, and what a name says takes long to tell
        return False
    clocks = {_NUMBERED.sub("", name) for name in names[::many]}
    others = [name for at, name in enumerate(names) if at % many]
    of_one = len(clocks) == 1 and (clocks <= _OF_A_PLOT or not is_motion(names[0], ""))
    alike = many == 2 or (all(map(is_time, clocks)) and not any(map(is_time, others)))
    return (
        alike
        and (of_one or all(map(is_time, clocks)))
        and all(clocks)
        and not any(map(is_number, clocks))
        and clocks.isdisjoint(_NUMBERED.sub("", name) for name in others)
    )


def _at(units: Sequence[str], at: int) -> str:
    return units[at] if at < len(units) else ""


def _columns(path: str, lines: list[str], found: Found, period: int) -> tuple[list[Array], dict[int, str]]:
    """Every column, NaN where it has no cell; place of those that hold words -> the first of them."""
    width = len(found.header.names)
    columns: list[list[float]] = [[] for _ in range(width)]
    words: dict[int, str] = {}
    bad: dict[int, DataError] = {}
    for at, line in enumerate(lines[found.skip :], start=found.skip + 1):
        cells = fields_of(line, found.header.delimiter)
        if not line.strip() or len(cells) > width:
            continue
        for k in range(width):
            cell = cells[k].strip() if k < len(cells) else ""
            if cell not in MISSING and not is_number(cell):
                error = DataError(f'{path}, line {at}: "{cell[:40]}" is not a number', "mend or delete the line")
                if k % period == 0 or period == 2:
                    raise error
                bad.setdefault(k, error)
                words.setdefault(k, cell)
                cell = ""
            columns[k].append(np.nan if cell in MISSING else number(cell))
    arrays = [np.array(column) for column in columns]
    for k, error in bad.items():
        if not np.all(np.isnan(arrays[k])):
            raise error
    return arrays, words
