"""Two channels that are one quantity: asked for and measured, seen by two sensors, or averaged."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.facts import SPANS, lag_of
from dsd_cli.signals.log import Array

#: Two channels are one quantity, asked for and measured, where one leaves less than this share of the other,
TWINS = 0.05
#: or in half of the rows, those in which a step has been followed, less than this share of its square, while it moves:
#: its variance in these rows is more than this share of all.
SETTLED, MOVED = 0.01, 0.25
#: And their variances are alike within this factor.
ALIKE = 2.0
#: An average over some samples is compared with that of another channel where the log has so many of them one after the
#: other: both in the same numbers, these are not alike by chance. Rows that are looked at for that.
WINDOWS, COMPARED = 5, 16_000
#: Longest time by which a measured motion comes after the one that was asked for, samples.
LONGEST = 200


def lead_of(x: Array, y: Array) -> int | None:
    """By how many samples x is ahead of y, shape (n,) each; None: they are not one quantity, asked for and measured.

    A reference is followed with the gain 1, and what makes the axis move is not: a voltage or a torque stands in other
    numbers than the motion it leads to.
    """
    power = float(np.var(x))
    if power <= 0.0 or not 1.0 / ALIKE < float(np.var(y)) / power < ALIKE:
        return None
    lag = lag_of(x - x.mean(), y - y.mean(), LONGEST)
    a, b = (x[: x.size - lag], y[lag:]) if lag >= 0 else (x[-lag:], y[:lag])
    apart = (b - a) ** 2
    half = float(np.median(apart))
    # where both rest nothing is followed
    settled = half < SETTLED * power and float(np.var(a[apart <= half])) > MOVED * power
    return lag if settled or float(np.mean(apart)) < TWINS * power else None


def averages(x: Array, y: Array) -> bool:
    """Whether y is x with its noise averaged over the samples before: what is slow in both is the same."""
    x, y = x[:COMPARED], y[:COMPARED]
    if not float(np.var(y)) < float(np.var(x)):
        return False
    sums = [np.concatenate([[0.0], np.cumsum(one - x[0])]) for one in (x, y)]
    for span in SPANS:
        if x.size < WINDOWS * span:
            return False
        lead = lead_of(*((one[span:] - one[:-span]) / span for one in sums))
        if lead is not None:
            return lead >= 0
    return False
