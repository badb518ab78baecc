"""What stands above the numbers of a text file beside the names of its channels: units, types, a line of each."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate
from typing import NamedTuple

from dsd_cli.files.csv_body import Body
from dsd_cli.files.csv_cells import is_number
from dsd_cli.files.csv_said import key_of, kind_of, labelled, of_unit
from dsd_cli.files.names_in import is_unit

#: What stands between a channel and what it is.
_SAYS = re.compile(r"\s*[=:]\s*")


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


def kind_in(row: Row, body: Body) -> str:
    """What a row above the numbers says, see `kind_of`; of factors without a word the numbers say it."""
    return "factor" if row.at == body.factors else kind_of(as_wide(row.cells, body))


def without_descriptions(rows: Sequence[Row], body: Body) -> tuple[list[Row], list[str] | None]:
    """The rows without those that say something of each channel but its name, and the units that one of them says.

    `Unit: N*m,,Unit: rad` below the names, as the data inspector of Simulink exports them; `Scale, 1, 0.001`; `f8, f8`;
    `dt = 0.1; dt = 0.1`.
    """
    kept: list[Row] = []
    units = None
    wide = [row for row in rows if len(row.cells) == body.fields and kind_of(row.cells) != "type"]
    for row in rows:
        cells = as_wide(row.cells, body)
        kind = kind_in(row, body)
        if kind == "unit":
            units = [*map(of_unit, cells)] if len(cells) == body.fields else units
            continue
        said = {"set": any(one in wide for one in kept), "type": bool(wide or labelled(cells))}
        if not said.get(kind, kind):
            kept.append(row)
    return kept, units


def in_groups(names: Sequence[str], above: Sequence[str]) -> list[str]:
    """`group/name` where names come again and the row above says of which group each is: `elbow,,wrist,` holds on.

    As they are where that distinguishes no more.
    """
    above, there = [cell.strip() for cell in above], [name for name in names if name]
    if len(set(there)) == len(there) or len(above) != len(names):
        return list(names)
    names = [name or cell for name, cell in zip(names, above, strict=True)]
    groups = list[str]()
    for cell in above:
        groups.append(cell or (groups[-1] if groups else ""))
    paired = zip(groups, names, strict=True)
    full = [f"{group}/{name}" if group and names.count(name) > 1 else name for group, name in paired]
    return full if len(set(full)) > len(set(names)) else names


def differ(cells: Sequence[str]) -> bool:
    """Whether no name comes again in a row that begins with what it says; channels that are counted have none."""
    names = [cell for cell in cells if key_of([cell]) != key_of(cells)]
    return len(set(names)) == len(names) and not all(map(is_number, names))


def lines_of_each(rows: Sequence[Row]) -> dict[str, Row]:
    """Name in the last row -> the line about it above, where there are several: `Trace 1,Feedback Speed,min-1`.

    `CH1 = Motor Speed [rpm]` is one, too, and `CH1,Axis 1,Speed,1/min`.
    """
    names = [cell.strip() for cell in rows[-1].cells] if rows else []
    rows = [
        row._replace(cells=[c for k, c in enumerate(row.cells) if any(map(str.strip, row.cells[k:]))]) for row in rows
    ]
    rows = [row._replace(cells=_SAYS.split(row.cells[0], 1)) if len(row.cells) == 1 else row for row in rows]
    first = {row.cells[0].strip(): row for row in rows[:-1] if len(row.cells) > 1}
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
    words = {name: [one for one in cells if one and not is_unit(one)] for name, cells in said.items()}
    more = {name: " ".join(cells) for name, cells in words.items() if cells and not any(map(is_number, cells))}
    return [f"{name} {more[name]}" if name in more else name for name in names], units


#: A quoted cell that the line does not close.
_OPEN = re.compile(r'(?:^|[,;\t|])\s*"[^"]*$')


def closed(lines: Sequence[str], start: int, stop: int) -> Iterator[tuple[int, str]]:
    """(place of its last line, row) of the lines from `start` to before `stop`, of which quoted cells make one: a
    spreadsheet writes `"Torque` and `[Nm]"` below it."""
    at = start
    while at < stop:
        end = at + 1
        if _OPEN.search(lines[at]):
            quotes = accumulate(line.count('"') for line in lines[at:stop])
            end = next((at + k for k, count in enumerate(quotes, start=1) if k > 1 and count % 2 == 0), end)
        yield end - 1, " ".join(lines[at:end])
        at = end
