"""The clock of a log: its sample time, and whether the stamps keep to it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import SHORTEST

#: The clock is settled from this many rows with a finite stamp ...
CLOCK_ROWS = 16
#: ... or from the finite ones among this many rows.
CLOCK_PATIENCE = 256
#: Stamps farther than this share of T from their place are jitter.
JITTER = 0.01
#: A regular log keeps to its clock much better than that from the start: stamps by a timer stay within 0.05 % on real
#: drives, stamps taken by a computer are off by 1 % and more, now and then in the first rows already.
REGULAR = 0.002

SLOWEST, FASTEST = 0.2, 5e-6  # s; sample times outside are worth a word
UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9, "100ns": 1e-7}
#: s per unit of a time column.
TIME_SCALE = {"s": 1.0, **UNITS}
#: Years of which logs are, s in one, and the year in which stamps of a unit begin: Unix, and FILETIME of Windows.
YEARS, YEAR = (1990, 2100), 31_556_952.0
EPOCHS = {"s": 1970, "ms": 1970, "us": 1970, "ns": 1970, "100ns": 1601}


class Clock(NamedTuple):
    """`sample_time` and `median` in s; `regular`: every step of the clock rows is within 0.2 % of the sample time."""

    sample_time: float
    median: float
    regular: bool


def clock_window(stamps: Array) -> int | None:
    """How many rows settle the clock; None: more are needed. Depends on the rows only, not on how they came in."""
    finite = np.flatnonzero(np.isfinite(stamps[:CLOCK_PATIENCE]))
    if finite.size >= CLOCK_ROWS:
        return int(finite[CLOCK_ROWS - 1]) + 1
    return CLOCK_PATIENCE if stamps.size >= CLOCK_PATIENCE else None


def settle_clock(stamps: Array) -> Clock:
    """Sample time from the first stamps (s): the mean of the steps within 50 % of the median positive step.

    Raises
    ------
    DataError : the stamps do not advance, or by less than any sample time: there is none to be had from them.
    """
    finite = stamps[np.isfinite(stamps)]
    with np.errstate(over="ignore"):
        steps = np.diff(finite)
    steps = steps[(steps > 0) & np.isfinite(steps)]
    if steps.size == 0:
        if finite.size and finite[-1] < finite[0]:
            what = f"time goes backwards from row to row, from {finite[0]:g} s to {finite[-1]:g} s"
            raise DataError(f"no sample time can be found: {what}", "sort the rows by their time, the first one first")
        found = "no finite time stamp" if finite.size == 0 else f"time stays at {finite[-1]:g} s"
        raise DataError(
            f"no sample time can be found: {found} in the first {stamps.size} row(s)",
            "set signals.time to the right column, or signals.sample_time",
        )
    median = float(np.sort(steps)[(steps.size - 1) // 2])  # one of the steps, never the middle of two
    if median < SHORTEST:
        raise DataError(
            f"no sample time can be found: the stamps are {median:g} s apart",
            "set signals.time to the right column and signals.time_unit to its unit, or signals.sample_time",
        )
    usual = steps[np.abs(steps - median) <= 0.5 * median]
    rounding = float(stamp_rounding(float(np.abs(finite).max())))
    mean = float(usual.mean())
    regular = bool(np.all(np.abs(usual - mean) <= REGULAR * mean + rounding))
    return Clock(plain(mean, rounding / usual.size), median, regular)  # of the mean only the ends are rounded


def stamp_rounding(magnitude: Array | float) -> Array | float:
    """By how much the difference of two float64 stamps of this size may be off."""
    return 4 * np.finfo(float).eps * magnitude


def plain(value: float, within: float) -> float:
    """0.001 instead of 0.000999991: the shortest number where the stamps, which say it to `within`, cannot distinguish
    the two."""
    shorter = (float(f"{value:.{digits}g}") for digits in range(1, 7))
    return next((short for short in shorter if abs(short - value) <= within + 1e-12 * value), value)


def suspicious(sample_time: float) -> str | None:
    """A sentence when hardly any servo log has this sample time (s)."""
    if FASTEST <= sample_time <= SLOWEST:
        return None
    for unit, scale in UNITS.items():
        if FASTEST <= sample_time * scale <= SLOWEST:
            return f'sample time {sample_time:g} s: is the time column in {unit}? set signals.time_unit = "{unit}"'
    return f"sample time {sample_time:g} s: is signals.time_unit right?"
