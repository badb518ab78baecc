"""What the numbers of a text file are to be multiplied by, where a row above them says so for each channel.

Every reader of text asks here, whether it has a file, the channels of a scope or lines as they come. A factor that is
not whole is that of counts, and counts are whole. Of other numbers nobody can say whether they were multiplied already,
which is said, with the key that answers it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.csv_body import Body
from dsd_cli.files.csv_cells import MISSING, is_number, number
from dsd_cli.files.csv_described import Row, as_wide, kind_in
from dsd_cli.signals.log import Array


class Factors(NamedTuple):
    """Place of a column -> its factor, and what is added then; the line of the factors, from 0."""

    at: int
    by: Mapping[int, float]
    plus: Mapping[int, float]


def factors_in(rows: Sequence[Row], body: Body) -> Factors | None:
    """The factors of the last row of such, with the last row of offsets; None: there are none but ones and zeros."""
    (at, by), (below, plus) = (_last(rows, kind, body) for kind in ("factor", "offset"))
    by, plus = ({k: x for k, x in one.items() if x != idle} for one, idle in ((by, 1.0), (plus, 0.0)))
    return Factors(at if by else below, by, plus) if by or plus else None


def _last(rows: Sequence[Row], kind: str, body: Body) -> tuple[int, dict[int, float]]:
    """Line and numbers of the last row of such."""
    found: tuple[int, dict[int, float]] = (-1, {})
    for row in rows:
        cells = as_wide(row.cells, body)
        if kind_in(row, body) == kind and len(cells) == body.fields:  # else it is a setting, of all of them
            there = {k: cell for k, cell in enumerate(cells) if cell.strip() not in MISSING and is_number(cell)}
            found = row.at, {k: number(cell) for k, cell in there.items()}
    return found


class Scaling:
    """Multiplies the columns of one source, in pieces of any size.

    The first numbers of a column decide whether it holds counts. Zeros do not, which are zeros either way, and numbers
    that contradict later end the reading: so an axis that rests first is read as one that moves at once.

    Parameters
    ----------
    scaled : whether the numbers are multiplied already, as [csv] says; None: it does not say.

    Attributes
    ----------
    places : of the columns that have a factor or an offset.
    """

    def __init__(self, source: str, factors: Factors | None, names: Sequence[str], scaled: bool | None = None) -> None:
        self._source, self._names, self._scaled = source, names, scaled
        self._at, self._by, self._plus = factors if factors and not scaled else Factors(0, {}, {})
        self.places = {*self._by, *self._plus}
        self._counts: dict[int, bool] = {}

    def applied(self, at: int, values: Array) -> Array:
        """Numbers of the column at that place as they are meant.

        Raises
        ------
        DataError : those before were counts, and these are not.
        """
        if at not in self.places:
            return values
        factor, offset = self._by.get(at, 1.0), self._plus.get(at, 0.0)
        there = values[np.isfinite(values)]
        broken = there[there != np.round(there)]
        if at not in self._counts and (np.any(there) or offset or self._scaled is not None):
            self._counts[at] = self._scaled is False or not (broken.size or offset or factor == round(factor))
        if not self._counts.get(at):
            return values
        if broken.size and self._scaled is None:
            what = f'line {self._at + 1} has a factor, and "{self._names[at]}" {broken[0]:g} behind whole numbers'
            told = f"csv.scaled = true if {factor:g} is in it already, else false"
            raise DataError(f"{self._source}: {what}", told)
        return factor * values + offset

    @property
    def said(self) -> list[str]:
        """What there is to say of the columns so far."""
        by = {k: f"{self._names[k]} {self._by.get(k, 1.0):g}" for k in self._counts if k < len(self._names)}
        by |= {k: f"{by[k]} and {plus:+g}" for k, plus in self._plus.items() if k in by}
        counts, left = (", ".join(by[k] for k in sorted(by) if self._counts[k] is taken) for taken in (True, False))
        what = "numbers" if self._scaled is False else "whole numbers"
        said = [f"line {self._at + 1} says what {what} are multiplied by: {counts}"] if counts else []
        if left:
            told = "--set csv.scaled=false multiplies by all in that line and adds its offsets, true leaves the numbers"
            said.append(f"line {self._at + 1} has factors that are left to you: {left}; {told} as they are")
        return said
