"""Golden section: the least of a function of one variable that has one valley.

Own code, for `scipy.optimize` takes 0.4 s of CPU to import, three times what all evaluations of a diagnosis cost, and
stops by tolerance: here the number of evaluations is what is bounded.
"""

from __future__ import annotations

import math
from collections.abc import Callable

_RATIO = (math.sqrt(5.0) - 1.0) / 2.0


def golden_section(f: Callable[[float], float], low: float, high: float, steps: int) -> float:
    """Middle of the bracket that is left after so many steps, each 0.62 times the one before."""
    a, b = high - _RATIO * (high - low), low + _RATIO * (high - low)
    fa, fb = f(a), f(b)
    for _ in range(steps):
        if fa < fb:
            high, b, fb = b, a, fa
            a = high - _RATIO * (high - low)
            fa = f(a)
        else:
            low, a, fa = a, b, fb
            b = low + _RATIO * (high - low)
            fb = f(b)
    return 0.5 * (low + high)
