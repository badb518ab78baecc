"""Stamps in two columns, whole seconds and what of the next one has gone, as ROS and sockets keep them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from dsd_cli.files.csv_cells import is_number, number
from dsd_cli.files.csv_dialect import fields_of, is_comment
from dsd_cli.files.words import TIME_UNITS
from dsd_cli.signals.log import Array

#: What the second column is called -> s.
_PARTS = {"nanosec": 1e-9, "nanosecs": 1e-9, "nanoseconds": 1e-9, "nsec": 1e-9, "nsecs": 1e-9, "ns": 1e-9}
_PARTS |= {"usec": 1e-6, "usecs": 1e-6, "microsec": 1e-6, "microseconds": 1e-6}
#: Parts beside a date.
_THOUSANDTHS = {word for word, unit in TIME_UNITS.items() if unit == "ms"}
_SECONDS = {"sec", "secs", "seconds", "s"}
_LAST = re.compile(r"[^A-Za-z]?([A-Za-z]+)$")
_WHOLE = re.compile(r"\s*(?:\d{1,10}|\d(?:\.\d+)?e\+0?\d)\s*")  # printf's %g writes 2e+06
#: Seconds since 1970 of today have so many digits; parts of one go from nothing to this.
_OF_TODAY, _SECOND = 10, 10**9


class Split(NamedTuple):
    """`name` of both columns together; the places of the seconds and of their parts, which are `scale` s each."""

    name: str
    at: int
    scale: float

    def whole(self, seconds: Array, parts: Array) -> Array:
        """Both columns as one, in s."""
        return seconds + self.scale * parts


def split_stamps(names: Sequence[str], lines: Sequence[str], delimiter: str) -> Split | None:
    """The stamps in two columns beside each other of a table whose rows are these lines; None: there are none."""
    rows = [fields_of(line, delimiter) for line in lines if not is_comment(line)]
    rows = [row for row in rows if len(row) == len(names)]
    for at in range(len(names) - 1):
        a, b = names[at : at + 2]
        if not rows or not all(_WHOLE.fullmatch(row[at + 1].strip('"')) for row in rows):
            continue
        if _LAST.fullmatch(b.strip()) and b.strip().lower() in _THOUSANDTHS and _of_dates(rows, at):
            return Split(f"{a}+{b}", at, 1e-3)
        whole = all(_WHOLE.fullmatch(row[at]) for row in rows)
        if whole and (scale := _by_name(a, b) or _by_deeds([(_int(row[at]), _int(row[at + 1])) for row in rows])):
            return Split(f"{a}+{b}", at, scale)
    return None


def _int(cell: str) -> int:
    return int(float(cell))


def _of_dates(rows: Sequence[Sequence[str]], at: int) -> bool:
    """Whether these are dates, or times of day, of whole seconds, and beside them thousandths: all that has gone by
    since a start begins at 0 and does not begin anew."""
    dates, parts = [row[at] for row in rows], [_int(row[at + 1].strip('"')) for row in rows]
    anew = parts[0] > 0 or any(b < a for a, b in pairwise(parts))
    whole = all(":" in cell and is_number(cell) and number(cell) == round(number(cell)) for cell in dates)
    return whole and max(parts) < 1000 and anew


def _by_name(a: str, b: str) -> float:
    """s of the parts, where names say that both belong together; 0 else."""
    of_a, of_b = _LAST.search(a.strip()), _LAST.search(b.strip())
    if of_a is None or of_b is None or a[: of_a.start(1)].strip("_ .") != b[: of_b.start(1)].strip("_ ."):
        return 0.0
    return _PARTS.get(of_b[1].lower(), 0.0) if of_a[1].lower() in _SECONDS else 0.0


def _by_deeds(rows: Sequence[tuple[int, int]]) -> float:
    """As `_by_name`: seconds since 1970 beside nanoseconds that rise, and begin anew in the next second."""
    stamps = [seconds * _SECOND + parts for seconds, parts in rows]
    rises = all(before <= after for before, after in pairwise(stamps))
    seconds, parts = zip(*rows, strict=True)
    as_such = all(len(str(one)) == _OF_TODAY for one in seconds) and max(parts) < _SECOND
    return 1e-9 if len(rows) > 2 and as_such and rises and len(str(max(parts))) == len(str(_SECOND)) - 1 else 0.0
