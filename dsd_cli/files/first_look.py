"""A first look at an unknown log: its columns and their units, and what they are by their names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dsd_cli.errors import DataError, source_name
from dsd_cli.files.formats.base import CLOCK
from dsd_cli.files.formats.known import HEAD_BYTES, format_of, is_bag, open_container
from dsd_cli.files.formats.names import places
from dsd_cli.files.recognise import Recognised, recognise
from dsd_cli.files.table_source import read_head
from dsd_cli.files.tables_in import is_stream, open_table


@dataclass(frozen=True)
class FirstLook:
    """`columns` of the log with their `units`, and channel -> column for those that are recognised.

    `clock`: the file stamps its rows.
    """

    columns: tuple[str, ...]
    units: Mapping[str, str]
    found: Mapping[str, Recognised]
    clock: bool = False


def first_look(path: str) -> FirstLook:
    """What a log says about itself.

    Raises
    ------
    DataError : it cannot be read, or can be read only once.
    """
    if is_stream(path):
        raise DataError(f"{source_name(path)}: can be read only once", "write it to a file first")
    kind = format_of(path, b"" if is_bag(path) else read_head(path, HEAD_BYTES))
    if kind is not None:
        file = open_container(path, kind)
        known = places(file.groups)
        units = {place.full: place.group.units.get(place.channel, "") for place in known}
        names = list(dict.fromkeys(place.full for place in known if place.channel != CLOCK or not place.group.clock))
        clock, found = any(group.clock for group in file.groups), recognise(names, units)
        return FirstLook(tuple(names), units, _without_time(found) if clock else found, clock)
    table = open_table(path, {}, ())
    names = [name for name in dict.fromkeys(table.column_names) if name]
    units = _units_row(path, recognise(names))
    return FirstLook(tuple(names), units, recognise(names, units))


def _without_time(found: dict[str, Recognised]) -> dict[str, Recognised]:
    """The stamps that the file keeps by itself are the time."""
    return {channel: one for channel, one in found.items() if channel != "time"}


def _units_row(path: str, found: Mapping[str, Recognised]) -> dict[str, str]:
    """Column -> unit, of a CSV file with a row of units under its header."""
    from dsd_cli.files.csv_in import CsvTable

    columns = {one.channel: one.column for one in found.values()}
    try:
        table = CsvTable(path, columns, tuple(columns))
    except (DataError, UnicodeError):  # no CSV
        return {}
    return table.units


def time_unit_of(step: float, first: float = 0.0) -> str:
    """The unit in which a sample time of that number is one of a servo log, and `first`, a stamp, is of our days."""
    from dsd_cli.signals.clock import EPOCHS, FASTEST, SLOWEST, UNITS, YEAR, YEARS

    for unit, begins in EPOCHS.items():
        scale = UNITS.get(unit, 1.0)
        if YEARS[0] <= begins + first * scale / YEAR <= YEARS[1] and FASTEST <= step * scale <= SLOWEST:
            return unit
    if FASTEST <= step <= SLOWEST:
        return "s"
    return next((unit for unit, scale in UNITS.items() if FASTEST <= step * scale <= SLOWEST), "s")
