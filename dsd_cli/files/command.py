"""u as the axis got it: what [signals] says of how it was logged is undone."""

from __future__ import annotations

from typing import NamedTuple

from dsd_cli.files.shifted import Shift, shifted
from dsd_cli.files.table_source import TableSource
from dsd_cli.files.unfiltered import unfiltered
from dsd_cli.signals.log import Hold


class Command(NamedTuple):
    """hold : how u lives between the samples. shift : s, see `shifted`. filter : s, see `unfiltered`."""

    hold: Hold = "held"
    shift: float = 0.0
    filter: float = 0.0


def as_it_acted(table: TableSource, command: Command, time_scale: float, sample_time: float | None) -> TableSource:
    """The table with the filter of u undone, then u moved in time; arguments as there."""
    found = unfiltered(table, command.filter, time_scale, sample_time)
    return shifted(found, Shift(command.shift, command.hold), time_scale, sample_time)
