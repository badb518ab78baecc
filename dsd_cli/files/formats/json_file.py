"""JSON, one document or one record a line: arrays by their names, arrays of records, arrays of rows, values by row.

Tests beside each other that have the same columns (WPILib SysId keeps four of them) are one table, one after the other
as their stamps have it, and each its own one, too.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.files.content import text_of
from dsd_cli.files.csv_cells import stamps_in
from dsd_cli.files.formats.base import (
    FEWEST,
    InMemory,
    check_size,
    lists_in,
    named_by,
    only_one,
    sample_times_said,
)
from dsd_cli.files.formats.long_form import form_by_texts, turned
from dsd_cli.files.formats.messages import LONGEST_ARRAY, fields
from dsd_cli.signals.log import Array

#: Bytes of memory to a byte of text, once it is read.
UNPACKED = 12
#: Columns of the rows that WPILib's SysId writes, by how many there are (its data format, version 1).
SYSID = {
    4: ("timestamp", "voltage", "position", "velocity"),
    9: (
        *("timestamp", "left voltage", "right voltage", "left position", "right position"),
        *("left velocity", "right velocity", "angle", "angular rate"),
    ),
}
#: What it calls the units of its positions.
SYSID_UNITS = {"meters": "m", "rotations": "turn", "radians": "rad", "degrees": "deg", "inches": "in", "feet": "ft"}
#: Keys of what a channel says of itself.
_NAMES, _UNITS = ("name", "label", "signal", "channel"), ("unit", "units")
_SAMPLES = ("data", "values", "samples", "y")
#: What the part of a document is called in which it speaks of itself.
_OF_ITSELF = {"metadata", "meta", "header", "info", "attributes", "config", "settings", "simulation"}
#: Rows have no more numbers.
MOST_FIELDS = 1000
Table = dict[str, Array]


class JsonFile(InMemory):
    """A JSON document or JSON lines; see `Container`."""

    def __init__(self, path: str) -> None:
        content = text_of(path)
        check_size(path, float(UNPACKED * len(content)))
        document = _parsed(path, content.decode("utf-8-sig"))
        found: dict[str, Table] = {}
        of_sysid = isinstance(document, Mapping) and document.get("sysid") is True
        _collect(document, "", found, SYSID if of_sysid else {})
        joined = _joined([table for name, table in found.items() if len(table) > 1 and not _beside_arrays(name, found)])
        channels = dict(joined)
        for name, table in found.items():
            channels |= {f"{name}/{column}" if name else column: values for column, values in table.items()}
        units: dict[str, str] = {}
        channels = named_by(channels, lists_in(document), units)
        units |= _units(document, list(channels)) if isinstance(document, Mapping) else {}
        super().__init__(channels, units=units)
        self.sample_time = only_one(_sample_times(document))
        if joined:
            parts = sum(table.keys() == joined.keys() for table in found.values())
            self.notes.append(f"{parts} tests with the same columns are read one after the other")


def _parsed(path: str, text: str) -> Any:
    """The document; of JSON lines a list of records, the last line left out where it is cut."""
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        lines = [(at, line) for at, line in enumerate(text.splitlines(), start=1) if line.strip()]
        if not lines or (error.lineno == 1 and error.msg != "Extra data"):
            raise DataError(f"{path}, line {error.lineno}: is not JSON ({error.msg})", "is it whole?") from None
    except RecursionError:
        raise DataError(f"{path}: is nested too deeply for a log") from None
    records = []
    for count, (at, line) in enumerate(lines, start=1):
        try:
            records.append(json.loads(line))
        except (json.JSONDecodeError, RecursionError):
            if count == len(lines) and records:
                break
            raise DataError(f"{path}, line {at}: is not JSON", "mend or delete the line") from None
    return records


def _collect(value: Any, name: str, found: dict[str, Table], rows_of: Mapping[int, Sequence[str]]) -> None:
    """Every table in the document, by the path to it."""
    value = _called(_listed(value))
    if isinstance(value, Mapping):
        arrays = {str(key): column for key, part in value.items() if (column := _numbers(part)) is not None}
        if arrays:
            found.setdefault(name, {}).update(arrays)
        for key, part in value.items():
            if str(key) not in arrays and isinstance(part, Mapping | list):
                _collect(part, f"{name}/{key}" if name else str(key), found, rows_of)
    elif _are_tests(value):
        for at, part in enumerate(value, start=1):
            _collect(part, f"{name}/{at}" if name else str(at), found, rows_of)
    elif isinstance(value, list) and value:
        table = _records(value) if isinstance(value[0], Mapping) else _rows(value, rows_of)
        if table:
            found.setdefault(name, {}).update(table)


def _called(value: Any) -> Any:
    """Name (with unit) -> samples of a list of channels that say what they are called; anything else as it is.

    >>> _called([{"name": "Torque", "unit": "Nm", "data": [0.1, ...]}, ...])  # {"Torque [Nm]": [0.1, ...], ...}
    """
    if not (isinstance(value, list) and all(isinstance(one, Mapping) for one in value)):
        return value
    found: dict[str, Any] = {}
    for one in value:
        samples = [one[key] for key in _SAMPLES if isinstance(one.get(key), list) and _numbers(one[key]) is not None]
        name = next((one[key] for key in _NAMES if isinstance(one.get(key), str)), "")
        unit = next((one[key] for key in _UNITS if isinstance(one.get(key), str)), "")
        if not name or len(samples) != 1 or len(samples[0]) <= LONGEST_ARRAY:
            return value
        found[f"{name} [{unit}]" if unit else name] = samples[0]
    return found if len(found) == len(value) > 1 and len(set(map(len, found.values()))) == 1 else value


def _are_tests(value: Any) -> bool:
    """Whether it is a list of tests, each with its samples in arrays; short ones are of one message."""
    if not (isinstance(value, list) and value and isinstance(value[0], Mapping)):
        return False
    arrays = (part for part in value[0].values() if isinstance(part, list) and len(part) > LONGEST_ARRAY)
    return any(_numbers(part) is not None for part in arrays)


def _numbers(value: Any) -> Array | None:
    """A list of numbers, or of stamps in words, null where one is missing; None for anything else."""
    value = _listed(value)
    if isinstance(value, list) and value and all(isinstance(one, str | None) for one in value):
        return stamps_in(value)
    if not isinstance(value, list) or not value or not any(isinstance(one, int | float) for one in value[:10]):
        return None
    if any(not isinstance(one, int | float) and one is not None for one in value):
        return None
    return np.array([np.nan if one is None else one for one in value], dtype=np.float64)


def _listed(value: Any) -> Any:
    """The values of what has numbers of rows for keys, as pandas writes columns; anything else as it is."""
    if not isinstance(value, Mapping) or not value or not all(key.isascii() and key.isdigit() for key in value):
        return value
    rows = list(value.values())
    records = all(
        isinstance(row, Mapping) and not any(isinstance(x, Mapping | list) for x in row.values()) for row in rows
    )
    if not records and any(isinstance(row, Mapping | list) for row in rows):  # trials that have numbers for names
        return value
    return [value[key] for key in sorted(value, key=int)]


def _rows(rows: list[Any], rows_of: Mapping[int, Sequence[str]]) -> Table:
    """Rows of numbers; signals that lie in few long rows are turned."""
    width = len(rows[0]) if isinstance(rows[0], list) else 0
    if not width or any(not isinstance(row, list) or len(row) != width for row in rows):
        return {}
    columns = [_numbers(list(column)) for column in zip(*rows, strict=True)]
    if len(rows) < width and width > MOST_FIELDS:
        columns = [_numbers(row) for row in rows]
    names = rows_of.get(len(columns)) or [str(k + 1) for k in range(len(columns))]
    return {name: column for name, column in zip(names, columns, strict=True) if column is not None}


def _records(records: list[Any]) -> Table:
    """Records of named numbers, to any depth; numbers and stamps in quotes are some, other texts may name a value."""
    maps = [record for record in records if isinstance(record, Mapping)]
    flat = [dict(fields(record)) for record in maps]
    names = list(dict.fromkeys(name for record in flat for name in record))[:MOST_FIELDS]
    table = {name: np.array([record.get(name, np.nan) for record in flat], dtype=np.float64) for name in names}
    texts: dict[str, list[str]] = {}
    for key in [key for key, value in maps[0].items() if isinstance(value, str)]:
        cells = [cell if isinstance(cell := record.get(key), str) else None for record in maps]
        if (column := stamps_in(cells)) is not None:
            table[key] = np.where(np.isnan(column), table.get(key, np.nan), column)
        else:
            texts[key] = [cell or "" for cell in cells]
    long = form_by_texts(table, texts)
    return table if long is None else turned("", long, table, texts)[0]


def _beside_arrays(name: str, found: Mapping[str, Table]) -> bool:
    """Whether a table is a matrix beside arrays as long: signals of one log (qpos, qvel beside time), and no test."""
    around = found.get(name.rpartition("/")[0], {}) if name else {}
    lengths = {column.size for column in found[name].values()}
    return all(map(str.isdigit, found[name])) and not lengths.isdisjoint(x.size for x in around.values())


def _sample_times(document: Any) -> set[float]:
    """The s between samples that a document says beside its samples, or in what it says of itself; the step of a
    controller or of a filter is another."""
    said, left = set[float](), [document]
    while left:
        one = left.pop()
        if isinstance(one, Mapping):
            said |= sample_times_said(one)
            left += [value for key, value in one.items() if str(key).lower() in _OF_ITSELF or _has_samples(value)]
    return said


def _has_samples(value: Any) -> bool:
    return isinstance(value, Mapping) and any(isinstance(one, list) and len(one) >= FEWEST for one in value.values())


def _joined(tables: list[Table]) -> Table:
    """Tables of the same columns, one after the other in the order of their first numbers; {}: there are not two."""
    for first in tables:
        alike = [table for table in tables if table.keys() == first.keys()]
        if len(alike) > 1:
            clock = next(iter(first))
            if all(np.all(np.diff(table[clock]) > 0.0) for table in alike):
                alike.sort(key=lambda table: float(table[clock][0]))
            return {name: np.concatenate([table[name] for table in alike]) for name in first}
    return {}


def _units(document: Mapping[str, Any], channels: Sequence[str]) -> dict[str, str]:
    """Channel -> unit: `units` of the document, by channel, or of SysId's positions."""
    told = document.get("units")
    if isinstance(told, Mapping):
        return {name: str(told[last]) for name in channels if (last := name.rpartition("/")[2]) in told}
    if document.get("sysid") is not True or not isinstance(told, str):
        return {}
    of_position = SYSID_UNITS.get(told.lower(), told)
    units = {"timestamp": "s", "voltage": "V", "position": of_position, "velocity": f"{of_position}/s"}
    return {name: unit for name in channels for word, unit in units.items() if name.endswith(word)}
