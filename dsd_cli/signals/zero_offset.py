"""The zero of a sensor that is not 0: of a voltage of 0 to 3.3 V at half of that, of a servo's pulse at 1500 us."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.log import Array

#: Samples from the first on in which an axis that begins at rest is at rest, and the share of the range that its
#: channel strays by there.
FIRST, STILL = 20, 0.05
#: Share of the range that the channel goes to either side of it at least.
EITHER_SIDE = 0.1


def zero_offset(x: Array) -> float | None:
    """What a channel begins with, if it rests there, goes to both sides of it and never comes to 0; shape (n,)."""
    low, high = (float(x.min()), float(x.max())) if x.size else (0.0, 0.0)
    begin, span = x[:FIRST], high - low
    if not span > 0.0:  # it does not move, or has no number somewhere
        return None
    rest = float(np.mean(begin))
    if low <= 0.0 <= high or np.ptp(begin) > STILL * span or min(rest - low, high - rest) < EITHER_SIDE * span:
        return None
    return rest
