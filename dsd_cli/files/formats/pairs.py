"""Lines of names with their values, as firmware prints them: `u:0.52,pos:1.25`, `I (1250) axis: tau=0.52Nm q=1.25`.

And `>u:1250:0.52§Nm` of Teleplot, one sample of one channel each.
"""

from __future__ import annotations

import re
from array import array
from collections import Counter

import numpy as np

from dsd_cli.files.content import text_of
from dsd_cli.files.csv_cells import is_number, seconds
from dsd_cli.files.csv_dialect import decode
from dsd_cli.files.formats.base import InMemory
from dsd_cli.signals.log import Array

#: A name, perhaps with its number in a register map, its value, and a unit right behind that, or one of these behind a
#: blank.
_APART = r"(?: (?=(?:Nm|m?A|m?V|N|%|°|(?:rad|deg|mm|m)(?:/s)?|rpm)(?:[\s,;)]|$)(?!\s*[=:])))?"
PAIR = re.compile(
    r"([A-Za-z_][\w./\[\]]*)(?:\(0x[0-9a-fA-F]+\))?'?\s*[=:]\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|nan|-?inf)"
    rf"{_APART}([A-Za-z%°]+(?:/s)?)?(?![\w.:])"
)
#: What may be a stamp before the first of them.
STAMP = re.compile(r"\d{4}-\d\d-\d\d[ T][\d:.,]*\d|\d+(?:[.:]\d+)*")
#: Where a frame that cantools decoded goes on in the next line: `can0 064#00 ::⏎Drive(⏎    Speed: 0.5 rad/s,⏎)`.
_GOES_ON = re.compile(r"(?<=::)\s*\n\s*|(?<=[(,])\n\s+|(?<=\S)\n(?=\)\s*(?:\n|$))")
#: Pairs in a line, lines and the share of them with the same names, at least.
FEWEST, LINES, ALIKE = 2, 5, 0.6


class PairsFile(InMemory):
    """Lines with the names that most lines have, and `time` where they begin or end with a stamp; see `Container`."""

    def __init__(self, path: str) -> None:
        lines = _lines(text_of(path))
        names = _names(lines)
        units: dict[str, str] = {}
        values: list[list[float]] = []
        stamps: list[float] = []
        for line in lines:
            found = list(PAIR.finditer(line))
            if tuple(one[1] for one in found) == names:
                values.append([float(one[2]) for one in found])
                units |= {one[1]: one[3] for one in found if one[3]}
                stamp = STAMP.search(line, 0, found[0].start()) or STAMP.fullmatch(line[found[-1].end() :].strip())
                stamps.append(seconds(stamp[0]) if stamp and is_number(stamp[0]) else np.nan)
        channels: dict[str, Array] = dict(zip(names, np.array(values).T.copy(), strict=True))
        t = np.array(stamps)
        if "time" not in channels and np.all(np.diff(t) >= 0.0) and t[-1] > t[0]:
            channels = {"time": t, **channels}
        super().__init__(channels, units=units)
        if left := sum(bool(line.strip()) for line in lines) - len(values):
            self.notes.append(f"{left} line(s) without {', '.join(names)} are left out")


def are_pairs(head: bytes) -> bool:
    """Whether a file that begins so is one."""
    if b"\0" in head or not (b"=" in head or b":" in head):
        return False
    return bool(_names(_lines(head)[:-1]))


def _lines(text: bytes) -> list[str]:
    whole = decode(text)
    return (_GOES_ON.sub(" ", whole) if "::\n" in whole else whole).splitlines()


#: Numbers of a sample with a stamp.
STAMPED = 2
#: `>torque:1250:0.5§Nm|g` of Teleplot: name, ms and value or several of these, unit, and how it is drawn.
_PLOTTED = re.compile(r">([^:|]+):([-+\d.eE:;]+)(?:§([^|]*))?(?:\|(?![a-z,]*xy)[a-z,]*)?\s*")


class TeleplotFile(InMemory):
    """`name/time`, ms, and `name/value` for each channel, whose stamps are its own; without stamps a column each.

    Of a channel what most of its samples are is kept, and of all of them those with stamps where there are such.
    """

    def __init__(self, path: str) -> None:
        rows: dict[str, dict[int, array[float]]] = {}
        units: dict[str, str] = {}
        left = 0
        for line in filter(str.strip, decode(text_of(path)).splitlines()):
            try:
                name, cells, unit = _sample(line)
            except ValueError:
                left += 1
                continue
            units |= {f"{name}/time": "ms", f"{name}/value": unit}
            for numbers in cells:
                rows.setdefault(name, {1: array("d"), 2: array("d")})[len(numbers)].extend(numbers)
        stamped = {
            name: np.array(one[2]).reshape(-1, 2).T for name, one in rows.items() if len(one[2]) > 2 * len(one[1])
        }
        bare = {name: np.array(one[1]) for name, one in rows.items() if name not in stamped}
        channels = {
            f"{name}/{of}": x for name, one in stamped.items() for of, x in zip(("time", "value"), one, strict=True)
        }
        super().__init__(channels or bare, units=units if channels else {name: units[f"{name}/value"] for name in bare})
        self.notes += [f"{left} line(s) that are no samples are left out"] if left else []
        many = {name: len(one[1]) if channels else len(one[2]) // 2 for name, one in rows.items()}
        if said := ", ".join(f"{count} of {name}" for name, count in many.items() if count):
            self.notes.append(f"samples {'without' if channels else 'with'} stamps beside others are left out: {said}")


def _sample(line: str) -> tuple[str, list[list[float]], str]:
    """Channel, the numbers of each sample of it, value alone or behind a stamp, and unit.

    Raises
    ------
    ValueError : it is none.
    """
    found = _PLOTTED.fullmatch(line)
    cells = [[*map(float, part.split(":"))] for part in found[2].strip(";").split(";")] if found else []
    if found is None or any(len(one) > STAMPED for one in cells):
        raise ValueError
    return found[1], cells, found[3] or ""


def is_teleplot(head: bytes) -> bool:
    """Whether most lines of a file that begins so are samples for Teleplot."""
    lines = [line for line in decode(head).splitlines()[:-1] if line.strip()] if head.count(b"\n>") else []
    return sum(_PLOTTED.fullmatch(line) is not None for line in lines) >= max(LINES, ALIKE * len(lines))


def _names(lines: list[str]) -> tuple[str, ...]:
    """The names in most lines; () where these are too few."""
    there = [line for line in lines if line.strip()]
    counted = Counter(tuple(one[1] for one in PAIR.finditer(line)) for line in there[: 40 * LINES])
    names, count = counted.most_common(1)[0] if counted else ((), 0)
    enough = len(set(names)) == len(names) >= FEWEST and count >= max(LINES, ALIKE * counted.total())
    return names if enough else ()
