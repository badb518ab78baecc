"""The rows of numbers in a text file: lines of one number of fields, most of them numbers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, takewhile
from typing import NamedTuple

from dsd_cli.files.csv_cells import MISSING, is_number, number
from dsd_cli.files.csv_dialect import fields_of, is_comment
from dsd_cli.files.csv_said import are_tens, key_of, labelled

#: What separates fields, tried in this order; the last is any run of blanks.
DELIMITERS = (",", ";", "\t", "|", " ")
#: Lines at the end of the looked-at part that say what a row of the body is, and the share of them that must agree.
BODY, AGREED = 200, 0.6
#: Of fewer lines all are looked at, of more the later half.
FEW = 40
#: Rows that show whether a field of them is a clock.
GOES_ON = 8
#: By so much blanks are less likely to separate columns than anything that is meant to.
BLANKS = 0.3


@dataclass(frozen=True)
class CsvLayout:
    """[csv]: what is not None is so, whatever the file looks like. Lines are counted from 1; 0: there is none.

    `skip_rows` lines come before the header; `header` and `units_row` are lines of the file. `scaled`: see `Scaling`.
    """

    skip_rows: int | None = None
    header: int | None = None
    units_row: int | None = None
    delimiter: str | None = None
    decimal: str | None = None
    scaled: bool | None = None


class Body(NamedTuple):
    """Rows of numbers: what separates them, fields in each, which of these are numbers, line of the first (from 0).

    `counted`: the first field may be the number of the row, and the last one is filled; `rising`: fields that rise;
    `factors`: line of what counts are multiplied by where nothing but the counts says so, -1: there is none.
    """

    delimiter: str
    fields: int
    numeric: tuple[int, ...]
    start: int
    counted: bool = False
    rising: tuple[int, ...] = ()
    factors: int = -1


def body_of(lines: Sequence[str], delimiters: Sequence[str], layout: CsvLayout) -> Body | None:
    """The rows of numbers; None: there are none that are alike."""
    last = [line for line in lines if not is_comment(line)][-BODY:]
    last = last[len(last) // 2 :] if len(last) > FEW else last
    best: tuple[float, Body] | None = None
    for delimiter in delimiters if layout.delimiter is None else (layout.delimiter,):
        rows = [fields_of(line, delimiter) for line in last]
        counted = Counter(map(len, rows)).most_common(1)
        if not counted or counted[0][0] < (2 if layout.delimiter is None else 1):
            continue
        width, agreeing = counted[0]
        alike = [row for row in rows if len(row) == width]
        numeric = tuple(k for k in range(width) if _share(alike, k) > 0.5 and _filled(alike, k) > 0.5)
        cells = sum(_share(alike, k) for k in numeric)
        if not numeric or agreeing < AGREED * len(rows):
            continue
        score = cells / width * agreeing / len(rows) + 1e-3 * cells - BLANKS * (delimiter == " ")
        if best is None or score > best[0]:
            start = _start(lines, delimiter, width, numeric, by_label=not _filled(alike, 0))
            if start is not None:
                first, start = start, start + are_of_counts(lines[start:], delimiter, width)
                ends = numeric[-1] == width - 1 or (delimiter == " " and _filled(alike, width - 1) > 0.5)  # R's words
                of_rows = ends and _is_counted([row[0].strip(' "') for row in alike])
                below = [row for row in alike if is_data(row, width, numeric)]
                rising = tuple(k for k in numeric if rises([row[k].strip(' "') for row in below]))
                best = score, Body(delimiter, width, numeric, start, of_rows, rising, first if start > first else -1)
    if best and _above(lines, best[1]):
        return body_of(lines[: best[1].start], delimiters, layout)
    return best[1] if best else None


def _above(lines: Sequence[str], body: Body) -> bool:
    """Whether right above these rows are wider ones, in which what ends begins with a clock: channels of a slower task,
    which ended before the others."""
    rows = [fields_of(line, body.delimiter) for line in lines[max(body.start - GOES_ON, 0) : body.start]]
    clock = [row[body.fields] for row in rows if len(row) > body.fields and is_data(row, len(row), body.numeric)]
    return len(clock) == GOES_ON and rises(clock, evenly=True)


def _share(rows: Sequence[Sequence[str]], place: int) -> float:
    """Share of rows with a number there, of those with anything there."""
    there = [row[place] for row in rows if row[place].strip() not in MISSING]
    return sum(map(is_number, there)) / len(there) if there else 0.0


def _is_counted(cells: Sequence[str]) -> bool:
    """Whether whole numbers go up by one from row to row."""
    if len(cells) < 2 or not all(cell.isascii() and cell.isdigit() for cell in cells):
        return False
    numbers = [int(cell) for cell in cells]
    return all(after == before + 1 for before, after in pairwise(numbers))


def _filled(rows: Sequence[Sequence[str]], place: int) -> float:
    """Share of rows with anything there."""
    return sum(row[place].strip() not in MISSING for row in rows) / len(rows)


def _start(
    lines: Sequence[str], delimiter: str, width: int, numeric: Sequence[int], by_label: bool = False
) -> int | None:
    """The first line with numbers where the body has them, and another such line behind it.

    by_label : the first field is blank in the body, and is what a row above it is called, or stands beside its first
        rows: as instruments write what they were set to on the left of them, whose stamps go on below.
    """
    rows = [at for at, line in enumerate(lines) if not is_comment(line)]
    places = {at: place for place, at in enumerate(rows)}
    cells = {at: fields_of(lines[at], delimiter) for at in rows}
    said = Counter(key_of(cells[at]) for at in rows if labelled(cells[at]))  # again and again is a mode of the axis

    def goes_on(at: int) -> bool:
        three = [cells[k] for k in rows[places[at] : places[at] + 3]]
        return set(map(len, three)) == {width} and any(rises([row[k] for row in three], True) for k in numeric)

    def is_of_another(at: int) -> bool:
        """Whether it begins a few rows with a word among the numbers: a list of events, above the rows."""
        alike = takewhile(lambda k: len(cells[k]) == width, rows[places[at] : places[at] + FEW])
        few = [[cells[k][place] for place in numeric] for k in alike]
        return len(few) < min(FEW, len(rows) - places[at]) and all(any(_is_word(cell) for cell in row) for row in few)

    def is_good(at: int) -> bool:
        named = by_label and cells[at][0].strip() and not goes_on(at)
        good = is_data(cells[at], width, numeric) and said[key_of(cells[at])] != 1 and not named
        return good and not is_of_another(at)

    for at, after, third in zip(rows, [*rows[1:], rows[-1]], [*rows[2:], *rows[-2:]], strict=False):
        if is_good(at) and is_good(after) and not _is_of_factors(*(cells[k] for k in (at, after, third))):
            return at
    return None


def are_of_counts(lines: Sequence[str], delimiter: str, width: int) -> bool:
    """Whether a first row has what the rows below it are multiplied by: all above 0, and where it has fractions they
    are whole, and of more than two numbers at one place at least."""
    cells = fields_of(lines[0], delimiter)
    first = [number(cell) for cell in cells if is_number(cell)]
    broken = [k for k, x in enumerate(first) if x % 1.0]
    if len(first) != width or not broken or not all(0.0 < x < math.inf for x in first):
        return False
    rows = [row for line in lines[1:] if len(row := fields_of(line, delimiter)) == width]
    below = [{_number(row[k]) for row in rows} for k in broken]
    stamps = (k for k in range(width) if first[k] == round(first[k]))
    if any(rises([cells[k], *(row[k] for row in rows[:FEW])], True) for k in stamps):
        return False
    return len(rows) > FEW // 2 and max(map(len, below)) > 2 and not any(x % 1.0 for values in below for x in values)


def _is_of_factors(first: Sequence[str], second: Sequence[str], third: Sequence[str]) -> bool:
    """Whether a first row is of factors: powers of ten before numbers that are none, whose first is no step to them."""
    if not are_tens(first) or are_tens(second) or len(third) != len(first):
        return False
    return not _goes_on(*(_number(row[0]) for row in (first, second, third)))


def rises(cells: Sequence[str], evenly: bool = False) -> bool:
    """Whether all are numbers that do, `evenly` as those of a clock do."""
    x = list(map(_number, cells))
    rise = all(a < b for a, b in pairwise(x))
    return rise and not (evenly and any(not _goes_on(*three) for three in zip(x, x[1:], x[2:], strict=False)))


def _is_word(cell: str) -> bool:
    return cell.strip() not in MISSING and not is_number(cell)


def _number(cell: str) -> float:
    return number(cell) if is_number(cell) else math.nan


def _goes_on(a: float, b: float, c: float) -> bool:
    """Whether a number is a step to the next two, as that of a clock is."""
    return abs((b - a) - (c - b)) <= 0.5 * abs(c - b)


def is_data(fields: Sequence[str], width: int, numeric: Sequence[int]) -> bool:
    """Whether these are numbers where the rows have them, by and large."""
    if len(fields) != width or not is_number(fields[numeric[0]]):  # `Samples; 1000; 1000` is none
        return False
    numbers = sum(is_number(fields[k]) and fields[k].strip() not in MISSING for k in numeric)
    return numbers >= max(1, (len(numeric) + 1) // 2)
