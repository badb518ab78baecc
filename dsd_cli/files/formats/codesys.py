"""A trace of CODESYS (`.trace.csv`): one variable after the other, each with lines of a stamp and a value."""

from __future__ import annotations

from collections import Counter

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.content import text_of
from dsd_cli.files.csv_cells import number
from dsd_cli.files.csv_dialect import decode
from dsd_cli.files.formats.base import InMemory
from dsd_cli.signals.log import Array


class CodesysTrace(InMemory):
    """Variables of the same stamps are one table with the column `time`; others are `variable/time`, `variable/value`.

    The file does not say the unit of its stamps. See `Container`.
    """

    def __init__(self, path: str) -> None:
        found = _variables(path, decode(text_of(path)).splitlines())
        channels: dict[str, Array] = {}
        stamps = next(iter(found.values()), np.zeros((0, 2)))[:, 0]
        together = all(np.array_equal(rows[:, 0], stamps) for rows in found.values())
        if together and found:
            channels["time"] = stamps
        for name, rows in found.items():
            channels |= {name: rows[:, 1]} if together else {f"{name}/time": rows[:, 0], f"{name}/value": rows[:, 1]}
        super().__init__(channels)


def _variables(path: str, lines: list[str]) -> dict[str, Array]:
    """Variable -> its stamps and values, shape (rows, 2); one that stands there once more has a number, from 2."""
    times: Counter[str] = Counter()
    found: dict[str, list[tuple[float, float]]] = {}
    rows: list[tuple[float, float]] = []
    for at, line in enumerate(lines, start=1):
        key, _, value = line.partition(";")
        if key.strip().endswith(".Variable"):
            name = value.strip()
            times[name] += 1
            rows = found.setdefault(name if times[name] == 1 else f"{name} {times[name]}", [])
        elif not key.strip() and value.strip(" \t;"):
            stamp, _, measured = value.partition(";")
            try:
                rows.append((number(stamp.strip()), number(measured.strip())))
            except ValueError:
                raise DataError(f'{path}, line {at}: "{value.strip()}" is no stamp and value') from None
    return {name: np.array(one) for name, one in found.items() if one}
