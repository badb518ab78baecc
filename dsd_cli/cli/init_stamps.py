"""Which of several stamps of the same rows says when their samples were taken, and what unit they are in."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dsd_cli.files.first_look import FirstLook, time_unit_of
from dsd_cli.files.recognise import Recognised
from dsd_cli.files.sample import Table
from dsd_cli.signals.clock import TIME_SCALE
from dsd_cli.signals.log import Array

#: Stamps are better than others where their steps vary by less than this share of what the steps of those do.
EVENER = 0.5


def with_even_stamps(look: FirstLook, table: Table) -> tuple[FirstLook, list[str]]:
    """The look with the most even of the columns that are called a time, and what to say of it.

    A message is stamped when it was measured, and when it came: what lies between is never even.
    """
    time = look.found.get("time")
    values = {one.name: one.values for one in table.channels if one.values is not None}
    if time is None or time.column not in values:
        return look, []
    uneven = {name: _unevenness(values[name]) for name in (time.column, *time.others) if name in values}
    best = min(uneven, key=lambda name: uneven[name])
    if not uneven[best] < EVENER * uneven[time.column]:
        return look, []
    others = tuple(name for name in (time.column, *time.others) if name != best)
    found = Recognised("time", best, look.units.get(best, ""), others)
    told = f'"{best}" is the time: its steps vary less than those of "{time.column}"'
    return replace(look, found={**look.found, "time": found}), [told]


def _unevenness(stamps: Array) -> float:
    """Standard deviation of the steps as a share of their mean; infinite where these do not all rise."""
    steps = np.diff(stamps[np.isfinite(stamps)])
    return float(np.std(steps) / np.mean(steps)) if steps.size and np.all(steps > 0.0) else math.inf


def unit_of_stamps(time: Recognised, table: Table | None) -> str:
    """As the log says it, or as the steps make it likely."""
    there = finite_stamps(time.column, table)
    there = there if there.size else np.zeros(1)
    return time.time_unit or time_unit_of(step_in(there), float(there[0]), float(np.ptp(there)))


def is_count_of_rows(time: Recognised | None, table: Table | None, apart: float | None) -> bool:
    """Whether what is called the time, in a unit that nobody says, counts by one where the file says that its rows are
    `apart`, s, and that is no such step."""
    if time is None or time.time_unit or not apart:
        return False
    steps = np.diff(finite_stamps(time.column, table))
    counts = steps.size > 0 and bool(np.all(steps == 1.0))
    return counts and not math.isclose(TIME_SCALE[unit_of_stamps(time, table)], apart, rel_tol=1e-6)


def finite_stamps(column: str, table: Table | None) -> Array:
    """Of a column of the rows that were looked at; none where it is in no one table."""
    channels = () if table is None else table.channels
    stamps = next((one.values for one in channels if one.name == column), None)
    return np.zeros(0) if stamps is None else np.asarray(stamps[np.isfinite(stamps)])


def step_in(stamps: Array) -> float:
    """The usual step forward of stamps; 1 where there is none."""
    steps = np.diff(stamps)
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if steps.size else 1.0
