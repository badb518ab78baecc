"""What a config makes of a table's rows as they are read: in files, in memory and live alike."""

from __future__ import annotations

from collections.abc import Mapping

from dsd_cli.files.command import Command, as_it_acted
from dsd_cli.files.counter_stamps import counted_on
from dsd_cli.files.remade import Made, as_observed
from dsd_cli.files.scaled import scaled
from dsd_cli.files.table_source import TableSource
from dsd_cli.files.unwrapped import unwrapped
from dsd_cli.files.windowed import Window, windowed


def as_read(
    table: TableSource,
    command: Command,
    window: Window,
    factors: Mapping[str, float],
    *,
    offsets: Mapping[str, float] | None = None,
    made: Made | None = None,
    time_scale: float,
    sample_time: float | None,
    unwrap: bool = True,
) -> TableSource:
    """The rows of the window, with u as and when it acted, stamps and a position that go on where they wrap, scaled,
    and with d_hat as this package makes it.

    Parameters
    ----------
    factors : channel -> what its column is multiplied by. offsets : channel -> what is taken off it before that.
    made : how a logged d_hat was made; None is as here.
    time_scale : s per unit of the stamps. sample_time : s from row to row, where there are no stamps.
    unwrap : not where the wraps themselves are looked for.

    Raises
    ------
    DataError : while it is read: no row in the window, or none with a u that the command names.
    """
    table = counted_on(table)
    part = windowed(as_it_acted(table, command, time_scale, sample_time), window, time_scale, sample_time)
    whole = scaled(unwrapped(part, factors.get("position", 1.0)) if unwrap else part, factors, offsets)
    return as_observed(whole, made or Made(), time_scale, sample_time)
