"""What stands above the numbers of a text file beside the names of its channels: units, types, a line of each."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from dsd_cli.files.csv_body import UNIT_KEYS, Body, is_keyed, key_of
from dsd_cli.files.recognise import is_unit

#: What else the cells of a row say of their channels, each of its own: `Type: double`.
OTHER_KEYS = ("type", "datatype", "interp", "blockpath", "portindex")
_KEYED = re.compile(r"\s*([^\W\d]\w*)\s*:\s*(.*?)\s*")
#: What says it of one channel as of all: `dt = 0.001`.
_SET = re.compile(r"\s*([^\W\d][\w.]*)\s*=\s*\S.*")
#: What stands between a channel and what it is.
_SAYS = re.compile(r"\s*[=:]\s*")
#: How numbers are held.
_TYPE = re.compile(
    r"\s*(?:[uif][1248]|u?int(?:8|16|32|64)?|u?[sdl]?int|l?real(?:32|64)?|float(?:32|64)?|double|single|bool(?:ean)?|bit"
    r"|long|short|word|dword|byte|number)\s*",
    re.IGNORECASE,
)
#: A unit and its quantity: `° (Angle)`.
_OF_QUANTITY = re.compile(r"(\S+)\s+\([^()]*\)")


class Row(NamedTuple):
    """The fields of a line, without the mark of a comment if it is one; `at` counts lines from 0."""

    at: int
    cells: list[str]
    comment: bool


def as_wide(cells: list[str], body: Body) -> list[str]:
    """As many as the fields that the numbers have: a delimiter at the end of lines, or of the rows alone, is none."""
    if 2 < len(cells) == body.fields - 1 and body.fields - 1 not in body.numeric:
        return [*cells, ""]
    return cells if any(map(str.strip, cells[body.fields :])) else cells[: body.fields]


def of_unit(cell: str) -> str:
    """The unit that a cell names."""
    text = cell.strip().strip("[]").strip()
    quantity = _OF_QUANTITY.fullmatch(text)
    text = quantity[1] if quantity and is_unit(quantity[1]) else text.strip("()")
    return "" if text.casefold() == "none" else text


def without_descriptions(rows: Sequence[Row], body: Body) -> tuple[list[Row], list[str] | None]:
    """The rows without those that say something of each channel but its name, and the units that one of them says.

    `Unit: N*m,,Unit: rad` below the names, as the data inspector of Simulink exports them; `Scale, 1, 0.001`; `f8, f8`;
    `dt = 0.1; dt = 0.1`.
    """
    kept: list[Row] = []
    units = None
    for row in rows:
        cells = as_wide(row.cells, body)
        found = [_KEYED.fullmatch(cell) for cell in cells if cell.strip()]
        keys = {"" if one is None else one[1].casefold() for one in found}
        if is_keyed(cells):
            if key_of(cells) in UNIT_KEYS and len(cells) == body.fields:  # its name stands in the place of the stamps
                units = ["", *map(of_unit, cells[1:])]
        elif len(keys) != 1 or not keys <= {*UNIT_KEYS, *OTHER_KEYS}:
            if not _of_all(cells) or not any(len(one.cells) == body.fields for one in kept):
                kept.append(row)
        elif keys <= set(UNIT_KEYS) and len(row.cells) == body.fields:
            units = [of_unit(cell.partition(":")[2]) for cell in row.cells]
    return kept, units


def _of_all(cells: Sequence[str]) -> bool:
    """Whether it is a type in each cell, or the same key."""
    there = [cell for cell in cells if cell.strip()]
    keys = {"" if (one := _SET.fullmatch(cell)) is None else one[1].casefold() for cell in there}
    return len(there) > 1 and (all(map(_TYPE.fullmatch, there)) or (len(keys) == 1 and "" not in keys))


def in_groups(names: Sequence[str], above: Sequence[str]) -> list[str]:
    """`group/name` where names come again and the row above says of which group each is: `elbow,,wrist,` holds on.

    As they are where that distinguishes no more.
    """
    there = [name for name in names if name]
    if len(set(there)) == len(there) or len(above) != len(names):
        return list(names)
    groups = [""]
    for cell in above:
        groups.append(cell.strip() or groups[-1])
    paired = zip(groups[1:], names, strict=True)
    full = [f"{group}/{name}" if group and there.count(name) > 1 else name for group, name in paired]
    return full if len(set(full)) == len(full) else list(names)


def lines_of_each(rows: Sequence[Row]) -> dict[str, Row]:
    """Name in the last row -> the line about it above, where there are several: `Trace 1,Feedback Speed,min-1`.

    `CH1 = Motor Speed [rpm]` is one, too.
    """
    names = [cell.strip() for cell in rows[-1].cells] if rows else []
    rows = [row._replace(cells=_SAYS.split(row.cells[0], 1)) if len(row.cells) == 1 else row for row in rows]
    first = {row.cells[0].strip(): row for row in rows[:-1] if len(row.cells) in (2, 3)}
    told = {name: row for name, row in first.items() if name and names.count(name) == 1 and row.cells[1].strip()}
    return told if len(told) > 1 else {}


def with_lines(
    told: Mapping[str, Row], names: list[str], units: list[str] | None
) -> tuple[list[str], list[str] | None]:
    """Names with what these lines say of them, and their units."""
    if not told:
        return names, units
    said = {name: [cell.strip() for cell in row.cells[1:]] for name, row in told.items()}
    beside = units or [""] * len(names)
    units = [
        next(filter(is_unit, reversed(said.get(name, []))), unit) for name, unit in zip(names, beside, strict=True)
    ]
    more = {name: cells[0] for name, cells in said.items() if cells[0][0].isalpha() and not is_unit(cells[0])}
    return [f"{name} {more[name]}" if name in more else name for name in names], units
