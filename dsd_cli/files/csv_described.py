"""What stands above the numbers of a text file beside the names of its channels: units, types, a line of each."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from dsd_cli.files.csv_body import Body
from dsd_cli.files.recognise import is_unit

UNIT_KEYS = ("unit", "units", "einheit", "y_unit_label", "symbolunit")
#: What else the cells of a row say of their channels, each of its own: `Type: double`.
OTHER_KEYS = ("type", "datatype", "interp", "blockpath", "portindex")
_KEYED = re.compile(r"\s*([^\W\d]\w*)\s*:\s*(.*?)\s*")


class Row(NamedTuple):
    """The fields of a line, without the mark of a comment if it is one; `at` counts lines from 0."""

    at: int
    cells: list[str]
    comment: bool


def as_wide(cells: list[str], body: Body) -> list[str]:
    """Without empty cells behind the fields that the numbers have: a delimiter at the end of lines."""
    return cells if any(map(str.strip, cells[body.fields :])) else cells[: body.fields]


def without_descriptions(rows: Sequence[Row], body: Body) -> tuple[list[Row], list[str] | None]:
    """The rows without those all of whose cells say what they say, and the units that these say.

    `Unit: N*m,,Unit: rad` below the names, as the data inspector of Simulink exports them.
    """
    kept, units = [], None
    for row in rows:
        found = [_KEYED.fullmatch(cell) for cell in row.cells if cell.strip()]
        keys = {"" if one is None else one[1].casefold() for one in found}
        if len(keys) != 1 or not keys <= {*UNIT_KEYS, *OTHER_KEYS}:
            kept.append(row)
        elif keys <= set(UNIT_KEYS) and len(row.cells) == body.fields:
            units = [cell.partition(":")[2].strip() for cell in row.cells]
    return kept, units


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
    """Name in the last row -> the line about it above, where there are several: `Trace 1,Feedback Speed,min-1`."""
    names = [cell.strip() for cell in rows[-1].cells] if rows else []
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
