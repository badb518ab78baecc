"""What the numbers of a text file are to be multiplied by, where a row above them says so for each channel.

A factor is that of counts, and counts are whole: it is taken where the cells are whole and it is not. Of other numbers
nobody can say whether they were multiplied already, which is said, with the keys that multiply.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from dsd_cli.files.csv_body import FACTOR_KEYS, OFFSET_KEYS, Body, key_of
from dsd_cli.files.csv_cells import MISSING, is_number, number
from dsd_cli.files.csv_described import Row, as_wide


class Factors(NamedTuple):
    """Place of a column -> its factor, and what is added then; the line of the factors, from 0."""

    at: int
    by: Mapping[int, float]
    plus: Mapping[int, float]


def factors_in(rows: Sequence[Row], body: Body) -> Factors | None:
    """The factors of the last row of such, with the last row of offsets; None: there are none but ones and zeros."""
    (at, by), (below, plus) = (_last(rows, keys, body) for keys in (FACTOR_KEYS, OFFSET_KEYS))
    by, plus = ({k: x for k, x in one.items() if x != idle} for one, idle in ((by, 1.0), (plus, 0.0)))
    return Factors(at if by else below, by, plus) if by or plus else None


def _last(rows: Sequence[Row], keys: Sequence[str], body: Body) -> tuple[int, dict[int, float]]:
    """Line and numbers of the last row that begins with one of these keys; its first cell is no number."""
    found: tuple[int, dict[int, float]] = (-1, {})
    for row in rows:
        cells = as_wide(row.cells, body)
        if key_of(cells) in keys and len(cells) == body.fields:  # else it is a setting, of all of them
            numbers = {
                k: number(cell) for k, cell in enumerate(cells) if cell.strip() not in MISSING and is_number(cell)
            }
            found = row.at, numbers
    return found


def taken(factors: Factors, names: Sequence[str], rows: Sequence[Sequence[str]]) -> tuple[dict[int, float], list[str]]:
    """Place -> factor of the columns of counts, and what to say of all of them.

    rows : cells of the first rows.
    """
    counts = {k: f for k, f in factors.by.items() if f != round(f) and k not in factors.plus and _whole(rows, k)}
    left = [k for k in sorted({*factors.by, *factors.plus}) if k not in counts]
    said = []
    if counts:
        shown = ", ".join(f"{names[k]} {f:g}" for k, f in counts.items())
        said.append(f"line {factors.at + 1} says what whole numbers are multiplied by: {shown}")
    if left:
        shown = ", ".join(f"{names[k]} {_shown(factors, k)}" for k in left if k < len(names))
        remedy = "if they were not multiplied yet: signals.u_scale, position_scale or velocity_scale"
        said.append(f"line {factors.at + 1} has factors that are left to you: {shown}; {remedy}")
    return counts, said


def _shown(factors: Factors, at: int) -> str:
    by, plus = factors.by.get(at, 1.0), factors.plus.get(at, 0.0)
    return f"{by:g}" if plus == 0.0 else f"{by:g} and {plus:+g}"


def _whole(rows: Sequence[Sequence[str]], at: int) -> bool:
    """Whether all numbers of a column are whole, and not all the same."""
    cells = [row[at] for row in rows if at < len(row) and row[at].strip() not in MISSING and is_number(row[at])]
    values = {number(cell) for cell in cells}
    return len(values) > 1 and all(value == round(value) for value in values)
