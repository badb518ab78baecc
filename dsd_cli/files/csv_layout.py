"""Where in a text file the numbers are: drives and instruments write lines about themselves before and after them.

The body is found first: lines of one number of fields, most of them numbers. What stands above it is its header, a row
of units, and a preamble; [csv] says where these are when that is not so.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from dsd_cli.errors import DataError
from dsd_cli.files.csv_body import DELIMITERS, FEW, Body, CsvLayout, body_of, is_data
from dsd_cli.files.csv_cells import MISSING, is_number
from dsd_cli.files.csv_described import (
    Row,
    as_wide,
    closed,
    differ,
    in_groups,
    lines_of_each,
    with_lines,
    without_descriptions,
)
from dsd_cli.files.csv_dialect import Header, fields_of, find_header, is_comment, uncommented
from dsd_cli.files.csv_factors import Factors, factors_in
from dsd_cli.files.csv_said import KEYS, key_of, kind_of, of_unit
from dsd_cli.files.names_in import is_unit
from dsd_cli.files.recognise import is_count, is_time

#: First cells of the rows of a preamble that has one column for each channel.
NAME_KEYS = (
    "name", "channel name", "channel", "signal", "signal name", "symbol", "kanal", "signalname", "names", "trace_names",
    "tracename", "trace name", "data name", "dataname", "channel names", "signal names", "kanalname", "label", "labels",
    "bezeichnung",
)  # fmt: skip
#: Name of a column without one that counts the rows.
ROW = "row"


class Found(NamedTuple):
    """A layout that was found: as `Dialect`, and `notes` for the user."""

    header: Header
    skip: int
    units: list[str] | None
    notes: list[str]
    sample_time: float | None = None
    factors: Factors | None = None


def look(source: str, lines: Sequence[str], layout: CsvLayout) -> Found:
    """Header, units and first row of data of a file that begins with these lines.

    Raises
    ------
    DataError : nothing but comments, no names and no numbers, or [csv] points to lines that are none.
    """
    if replace(layout, scaled=None) != CsvLayout():
        return find_layout(source, lines, layout)
    body = body_of(lines, DELIMITERS, layout)
    if body is None:  # too odd, or too short, to say more than that the first line is the header
        return Found(*find_header(source, lines), None, [])
    try:
        header, skip = find_header(source, lines)
    except DataError:
        return find_layout(source, lines, layout)
    rows = [row for row in _rows(lines, header.delimiter, skip) if not row.comment or _units_of(row, body)]
    plain = body.delimiter == header.delimiter and body.fields == len(header.names) and body.factors < 0
    above = [header.names, *(row.cells for row in rows if row.at < body.start)]
    plain = plain and not any(map(kind_of, above)) and _of_pairs(header.names, body) == header.names
    plain = plain and any(is_data(row.cells, body.fields, body.numeric) for row in rows[:2])
    if not plain or _names_of_units(header.names) or _goes_on(header.names, rows[:1], body):
        return find_layout(source, lines, layout)
    at, first, _ = rows[0]
    if not is_data(first, body.fields, body.numeric) and (_is_text(first) or _names_of_units(first)):
        return find_layout(source, lines, layout)
    notes = [_COMMENTED.format(max(k for k in range(skip) if lines[k].strip()) + 1)] if header.line_is_data else []
    return Found(header, at, None, notes)


def _goes_on(names: Sequence[str], below: Sequence[Row], body: Body) -> bool:
    """Whether a header is a row of numbers and words itself: a number has a fraction, or a word stands below, too.

    Columns that are called by numbers are called by whole ones.
    """
    if not is_data(names, body.fields, body.numeric):
        return False
    words = [k for k in range(body.fields) if names[k].strip() not in MISSING and not is_number(names[k])]
    again = any(len(row.cells) == body.fields and row.cells[k].strip() == names[k] for row in below for k in words)
    return again or any("." in names[k] for k in body.numeric)


_COMMENTED = "the comment in line {} is taken as the header"


def _rows(lines: Sequence[str], delimiter: str, start: int, stop: int | None = None) -> list[Row]:
    """The lines of a header, from `start` to before `stop`, in which something stands; None: those of a body."""
    each = enumerate(lines[start:], start) if stop is None else closed(lines, start, stop)
    of_lines = ((at, is_comment(line), line) for at, line in each if line.strip())
    said = ((at, comment, uncommented(line) if comment else line) for at, comment, line in of_lines)
    return [Row(at, fields_of(line, delimiter), comment) for at, comment, line in said if line]


def _units_of(row: Row, body: Body) -> bool:
    """Whether it is a unit for every channel."""
    return len(row.cells) == body.fields and _names_of_units(row.cells)


def _is_text(fields: Sequence[str]) -> bool:
    """Whether something stands there, and nothing of it is a number."""
    there = [cell for cell in fields if cell.strip() not in MISSING]
    return bool(there) and not any(map(is_number, there))


def find_layout(source: str, lines: Sequence[str], layout: CsvLayout) -> Found:
    """Header, units and the first line of data of a file that begins with these lines.

    Raises
    ------
    DataError : there are no rows of numbers, or [csv] points to lines that are none.
    """
    skipped = layout.skip_rows or 0
    above = max(skipped, layout.header or 0, layout.units_row or 0)
    if above >= max(len(lines), 1):
        raise DataError(f"{source}: [csv] names a line that the file does not have", f"it has {len(lines)}")
    body = body_of(lines[above:], DELIMITERS, layout)
    if body is None:
        raise DataError(
            f"{source}: no rows of numbers are found in its first {len(lines)} lines",
            "say where they are: [csv] header (the line with the names), delimiter, decimal",
        )
    body = body._replace(start=body.start + above)
    rows = _rows(lines, body.delimiter, skipped, body.start)
    if rows and _torn(rows[-1].cells, body, lines):
        what = f"line {rows[-1].at + 1} names {len(rows[-1].cells)} columns, and the rows have {body.fields} fields"
        why = "decimal commas between commas, it seems"
        raise DataError(f"{source}: {what}: {why}", "export it with semicolons between columns, or with decimal points")
    told = layout.header is not None or layout.units_row is not None
    found = _as_told(lines, layout, body) if told else _keyed(rows, body) or _above(rows, body)
    return found._replace(factors=factors_in(rows, body))


def _torn(names: Sequence[str], body: Body, lines: Sequence[str]) -> bool:
    """Whether what separates columns tears numbers with a decimal comma into whole ones: two for each, or each but one.

    That one is a count, or a stamp in whole units; texts are not torn.
    """
    words = body.fields - len(body.numeric)
    whole = 2 * (len(names) - words) - len(body.numeric)
    if body.delimiter != "," or not _is_text(names) or whole not in (0, 1):
        return False
    rows = [fields_of(line, ",") for line in lines[body.start :][:FEW]]
    parts = [row[k].strip() for row in rows if len(row) == body.fields for k in body.numeric[1 + whole :: 2]]
    return len(body.numeric) > 1 and all(part.isascii() and part.isdigit() for part in parts)


def _as_told(lines: Sequence[str], layout: CsvLayout, body: Body) -> Found:
    row = layout.units_row
    units = [*map(of_unit, fields_of(uncommented(lines[row - 1]), body.delimiter))] if row else None
    names = _numbered(body.fields)
    if layout.header:
        names = _fitted([text.strip() for text in fields_of(lines[layout.header - 1], body.delimiter)], body)
    elif layout.header is None:
        names = _above(_rows(lines, body.delimiter, 0, (row or 1) - 1), body).header.names
    return Found(Header(names, body.delimiter), body.start, units, [])


def _keyed(rows: Sequence[Row], body: Body) -> Found | None:
    """A preamble whose rows begin with what they say: `Name; a; Name; b`, `Unit; mm; Unit; V`."""
    rows = [row._replace(cells=as_wide(row.cells, body)) for row in rows]
    told = (k for k, (_, row, _) in enumerate(rows) if key_of(row) in NAME_KEYS and len(row) == body.fields)
    full = [k for k in told if all(rows[k].cells[place].strip() for place in body.numeric)]
    if not full:
        return None
    at = next((k for k in full if differ(rows[k].cells)), full[-1])  # else it is of groups
    named = rows[at].cells
    units = next((row for _, row, _ in rows if key_of(row) in KEYS["unit"] and len(row) == body.fields), None)
    label, times, names = key_of(named), 0, []
    for place, cell in enumerate(named):
        is_time = key_of([cell]) == label and place in body.numeric  # else it stands before the rows
        times += is_time
        names.append(("time" if times == 1 else f"time {times}") if is_time else cell.strip())
    names = in_groups(names, rows[at - 1].cells if at else [])
    shown = None if units is None else [*map(of_unit, units)]
    where = f"line {rows[at].at + 1} names the channels, the {body.start} lines above the numbers are no data"
    return Found(Header(names, body.delimiter), body.start, shown, [where])


def _above(rows: Sequence[Row], body: Body) -> Found:
    """Names and units from the rows right above the body that are as wide as it; comments where nothing else is."""
    rows, units = without_descriptions(rows, body)
    each = lines_of_each(rows)
    rows = [row for row in rows if row not in each.values()]
    wide = _wide([row for row in rows if not row.comment or _units_of(row, body)], body)
    if all(row.comment or all(map(is_unit, row.cells)) for row in wide):  # no names but in a comment
        whole = [row for row in rows if len(row.cells) == body.fields and not any(map(is_number, row.cells))]
        said = [row for row in rows if row in wide or (row.comment and row in whole)]  # `; Channels 1` names none
        wide = _wide(said, body) or wide
    wide, notes = wide or _few(rows, body), list[str]()
    own = [row.cells for row in wide]
    if len(wide) == 2 and not _names_of_units(wide[1].cells):
        named = wide[1]._replace(cells=in_groups(wide[1].cells, wide[0].cells))
        wide = wide if _describes(wide[0], wide[1], body) else [named]
    alone = len(wide) == 1 or (bool(wide) and _names_of_units(wide[1].cells))
    if alone and (over := [row for row in rows if row.at < wide[0].at and not row.comment]):
        wide[0] = wide[0]._replace(cells=in_groups(wide[0].cells, over[-1].cells))
    if not wide:
        notes.append("it has no header: its columns are called by their number, 1, 2, ...")
        return Found(Header(_numbered(body.fields), body.delimiter), body.start, None, notes)
    at, names, comment = wide[0]
    if len(wide) == 2:
        below = _fitted(wide[1].cells, body)
        if _names_of_units(below):
            units = [*map(of_unit, below)]
            notes.append(f"line {wide[1].at + 1} is taken as units, not data")
        else:
            units = [of_unit(cell) if is_unit(cell) else "" for cell in below]
            both = zip(_fitted(names, body), below, strict=True)
            names = [name if is_unit(cell) or not cell else f"{name} {cell}" for name, cell in both]
    before, names = names, _of_pairs(names, body)
    notes += [f"line {at + 1} names pairs of columns, a time and a value each"] * (names != before)
    if len(names) < body.fields - 1:
        notes.append(f"line {at + 1} names {len(names)} of {body.fields} columns, the others are called by number")
    elif any(map(str.strip, names[body.fields :])):
        notes.append(f"line {at + 1} names {len(names)} columns, the rows have {body.fields}: the last is left out")
    if comment:
        notes.append(_COMMENTED.format(at + 1))
    elif at > 0 and wide[0].cells in own:
        notes.append(f"line {at + 1} is taken as the header, what is above it is left out")
    names, units = with_lines(each, _fitted(names, body), units)
    return Found(Header(names, body.delimiter), body.start, units, notes)


def _wide(rows: Sequence[Row], body: Body) -> list[Row]:
    """The last two rows, or the last one, that are as wide as the body and text, by and large."""
    wide, first = list[Row](), ""
    if rows and len(rows[-1].cells) == body.fields > 1 and not any(map(str.strip, rows[-1].cells[1:])):
        first, rows = rows[-1].cells[0].strip(), rows[:-1]  # pandas has the name of the index below all others
    for row in reversed(rows):
        there = {k for k, cell in enumerate(row.cells) if cell.strip()}
        few = 2 * len(there) < body.fields and not there.issuperset(body.numeric)  # notes may stand beside a table
        if abs(len(row.cells) - body.fields) > 1 or few or all(map(is_number, row.cells)):
            break
        wide.insert(0, row._replace(cells=[cell.strip() for cell in row.cells]))
        if len(wide) == 2:
            break
    if first and wide and not wide[0].cells[0]:
        wide[0].cells[0] = first
    return wide


def _few(rows: Sequence[Row], body: Body) -> list[Row]:
    """The row right above the numbers if it names some of the columns and says nothing else; not one of words."""
    last = rows[-1] if rows else Row(-1, [], True)
    names = [cell.strip() for cell in last.cells]
    alone = last.at == body.start - 1 and not last.comment and body.delimiter != " " and not kind_of(names)
    known = 1 < len(names) < body.fields and all(names) and differ(names)
    known = known and not any(is_number(name) or re.search("[:=]", name) for name in names)
    return [last._replace(cells=names)] * (alone and known)


def _of_pairs(names: list[str], body: Body) -> list[str]:
    """`a/time, a` where each name is above a pair, whose first rises: `a,,b,`; `a,b`. Of `a,b,,` the first two are."""
    there, clocks = [name for name in names if name], range(0, body.fields, 2)
    paired = 2 * len(there) == body.fields and set(clocks) <= set(body.rising) and len(body.rising) < body.fields
    paired = paired and there in (names, names[::2], names[1::2])
    if not paired or any(is_time(name) or is_count(name) or re.search("[:=]", name) for name in there):
        return names
    return [full for name in there for full in (f"{name}/time", name)]


def _names_of_units(row: Sequence[str]) -> bool:
    """Whether most of what stands there are units."""
    there = [unit for unit in map(of_unit, row) if unit]
    return bool(there) and sum(map(is_unit, there)) >= 0.5 * len(there)


def _describes(names: Row, below: Row, body: Body) -> bool:
    """Whether the lower of two rows of text adds to the names of the upper one, and the upper is none of a preamble."""
    alike = len(names.cells) == len(below.cells) == body.fields and not (names.comment or below.comment)
    return alike and below.at == names.at + 1 and len(set(names.cells)) == body.fields and all(names.cells)


def _fitted(names: Sequence[str], body: Body) -> list[str]:
    """As many names as there are fields: a delimiter at the end of rows or of the header alone is none.

    The number of the row has no name in what R and pandas print: a header that is one short begins after it, unless its
    first name is that of a count, or of a time that the second field cannot be.
    """
    short = body.counted and len(names) == body.fields - 1
    if short and not is_count(names[0]) and (1 in body.rising or not is_time(names[0])):
        return [ROW, *names]
    return [*names[: body.fields], *_numbered(body.fields)[len(names) :]]


def _numbered(fields: int) -> list[str]:
    return [str(k + 1) for k in range(fields)]
