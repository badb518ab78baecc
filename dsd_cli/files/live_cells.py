"""Cells of a stream, one after the other: what stands for thousands is known by the cells that came before."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress

from dsd_cli.files.csv_cells import LARGE, Written, plain_number, seconds, written

#: Rows from which on blank cells are worth a word.
ROWS = 200


class LiveCells:
    """Numbers of each column with their thousands, as `1.234,5` and `1,234.5`, whose signs no cell has otherwise.

    A lone sign before three digits is decimal until the column has shown the other one to be so.
    """

    def __init__(self) -> None:
        self._decimal: dict[int, str] = {}
        self._doubtful: dict[tuple[int, str], str] = {}  # the first whose sign nothing showed to be decimal
        self._late: list[tuple[int, str, str, str]] = []  # column, what showed which sign, the first by the other one
        self._rows = self._blank = 0

    def read(self, at: int, text: str, stamp: bool = False) -> float:
        """The value of a cell of that column; NaN: there is none.

        Raises
        ------
        ValueError : it is no number, or has a unit.
        """
        with suppress(ValueError):
            value = seconds(text) if stamp else plain_number(text)
            sign = "," if "," in text else "." if "." in text else ""
            known = self._decimal.get(at)
            if not sign or known == sign:
                return value
            if not LARGE.fullmatch(text.strip()):
                self._learn(at, sign, text)
                return value
            if known is None:
                self._doubtful.setdefault((at, sign), text.strip())
                return value
            return Written(sign, known).value(text)
        how = written([text]) or Written()
        if how.unit or not how.thousands:
            raise ValueError(text)
        self._learn(at, how.decimal, text)
        return how.value(text)

    def _learn(self, at: int, decimal: str, text: str) -> None:
        """That sign is the decimal one of the column, as a cell shows."""
        self._decimal[at] = decimal
        if first := self._doubtful.get((at, "." if decimal == "," else ",")):
            self._late.append((at, text.strip(), decimal, first))
        self._doubtful = {key: one for key, one in self._doubtful.items() if key[0] != at}

    def count(self, row: Sequence[float]) -> None:
        """Remember whether a row lacks a value."""
        self._rows += 1
        self._blank += any(map(math.isnan, row))

    def said(self, names: Sequence[str]) -> list[str]:
        """Cells that were read wrongly; that most rows lack a value, as of channels that are logged each by itself."""
        late = [
            f'column "{names[at] if at < len(names) else at + 1}": "{cell}" shows that its decimal sign is "{sign}"; '
            f'what came before it as "{first}" was read a thousand times too small, which it is not in a file'
            for at, cell, sign, first in self._late
        ]
        if self._rows < ROWS or 2 * self._blank < self._rows:
            return late
        what = f"{self._blank:,} of {self._rows:,} rows lack a value and are left out"
        return [*late, f"{what}: channels that were logged each by itself, or on change, are joined in a file only"]
