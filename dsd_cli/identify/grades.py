"""How well a log identifies a value: identified, weak or not, by its relative standard error."""

from __future__ import annotations

import math
from typing import Literal

Grade = Literal["identified", "weak", "not"]

#: Relative standard errors up to which a value is identified, and weak.
IDENTIFIED, WEAK = 0.1, 0.5
#: A delay is known well enough within these shares of a sample.
DELAY_IDENTIFIED, DELAY_WEAK = 0.5, 2.0


def grade(size: float, error: float, sample_time: float = math.nan) -> Grade:
    """Of a value of that size; with `sample_time` (s) of a delay, which fractions of a sample say well enough."""
    limits = (IDENTIFIED * size, WEAK * size)
    if math.isfinite(sample_time):
        limits = (max(limits[0], DELAY_IDENTIFIED * sample_time), max(limits[1], DELAY_WEAK * sample_time))
    return "identified" if error < limits[0] else "weak" if error < limits[1] else "not"
