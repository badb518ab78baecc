"""A first look at an unknown log: its columns and their units, and what they are by their names."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from dsd_cli.files.recognise import Recognised


@dataclass(frozen=True)
class FirstLook:
    """`columns` of the log with their `units`, and channel -> column for those that are recognised.

    `clock`: the file stamps its rows.
    """

    columns: tuple[str, ...]
    units: Mapping[str, str]
    found: Mapping[str, Recognised]
    clock: bool = False


#: s; a log of stamps that are finer than their unit, as of 0.25 ms, is no shorter.
SHORTEST = 1.0


def unit_of_dates(step: float, first: float) -> str:
    """The unit in which `first`, a stamp, is of our days and the step one of a servo log; "": there is none."""
    from dsd_cli.signals.clock import EPOCHS, FASTEST, SLOWEST, UNITS, YEAR, YEARS

    for unit, begins in EPOCHS.items():
        scale = UNITS.get(unit, 1.0)
        if YEARS[0] <= begins + first * scale / YEAR <= YEARS[1] and FASTEST <= step * scale <= SLOWEST:
            return unit
    return ""


def time_unit_of(step: float, first: float = 0.0, lasts: float = math.inf) -> str:
    """The unit in which a sample time of that number is one of a servo log, and `first`, a stamp, is of our days.

    lasts : from the first stamp to the last one.
    """
    from dsd_cli.signals.clock import FASTEST, SLOWEST, UNITS

    if unit := unit_of_dates(step, first):
        return unit
    if FASTEST <= step <= SLOWEST or (step < 1.0 and lasts * UNITS["ms"] < SHORTEST):
        return "s"
    return next((unit for unit, scale in UNITS.items() if FASTEST <= step * scale <= SLOWEST), "s")
