"""What Octave's `save` writes by default: text, one variable after the other, each under lines that say what it is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.content import text_of
from dsd_cli.files.csv_dialect import decode
from dsd_cli.files.formats.base import InMemory, columns_of
from dsd_cli.signals.log import Array

#: Types whose lines are numbers; others, and what is in cells, are left out.
_NUMBERS = ("matrix", "scalar", "bool matrix", "range", "double_range")


class OctaveText(InMemory):
    """Variables, fields of structs as `struct/field`; see `Container`."""

    def __init__(self, path: str) -> None:
        channels: dict[str, Array] = {}
        for name, kind, rows in _variables(decode(text_of(path)).splitlines()):
            try:
                values = np.array([[float(cell) for cell in row.split()] for row in rows])
            except ValueError:
                raise DataError(f'{path}: variable "{name}" has a line that is no row of numbers') from None
            if kind.endswith("range") and values.size:
                low, high, step = values.ravel()[:3]
                values = low + step * np.arange(round((high - low) / step) + 1)
            channels |= columns_of(name, values) if values.size > 1 else {}
        super().__init__(channels)


def _variables(lines: list[str]) -> Iterator[tuple[str, str, list[str]]]:
    """Name, type and lines of each variable that is numbers."""
    around: list[tuple[str, int]] = []  # structs that are open, and how many fields of theirs are still to come
    name, kind, rows = "", "", list[str]()
    for line in [*lines, "# name: "]:
        key, _, value = line.removeprefix("#").partition(":")
        if not line.startswith("#"):
            rows += [line] if line.strip() else []
        elif key.strip() == "name":
            if kind in _NUMBERS:
                yield name, kind, rows
            while around and around[-1][1] == 0:
                around.pop()
            if around:
                around[-1] = around[-1][0], around[-1][1] - 1
            name, kind, rows = "/".join([*(one for one, _ in around), value.strip()]), "", []
        elif key.strip() == "type":
            kind = value.strip()
        elif key.strip() == "length" and kind == "scalar struct":
            around.append((name.rpartition("/")[2], int(value)))
