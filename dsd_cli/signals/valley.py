"""The least of a smooth function of one variable near a place that is about right, by Brent's method.

Own code, for `scipy.optimize` takes 0.4 s of CPU to import, more than all that is searched along lines in a diagnosis,
and stops by the place alone: here it is known what difference of the value matters.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

#: Part of the wider side that a step takes where no parabola tells it.
_GOLDEN = (3.0 - math.sqrt(5.0)) / 2.0


class Point(NamedTuple):
    """A place and the value there."""

    x: float
    f: float


def least_near(f: Callable[[float], float], low: float, high: float, start: Point, enough: float, most: int) -> Point:
    """The least that was met in low < x < high, from `start` on, whose value is known.

    enough : what a further step must bring: by the parabola through the three best points, or where that has no bottom
        between the ends by how much these differ. most : evaluations at most.
    """
    best, second = start, Point(start.x, math.inf)
    third = second
    last = before = high - low  # lengths of the last two steps
    for _ in range(most):
        step, fall = _bottom(best, second, third)
        inside = low < best.x + step < high
        if (fall if inside else third.f - best.f) <= enough:
            break
        if not (inside and abs(step) < 0.5 * before):
            step = _GOLDEN * (high - best.x if high - best.x > best.x - low else low - best.x)
        before, last = last, abs(step)
        new = Point(best.x + step, f(best.x + step))
        inner, outer = (new, best) if new.f <= best.f else (best, new)
        low, high = (low, outer.x) if outer.x > inner.x else (outer.x, high)
        if inner is new:
            best, second, third = new, best, second
        elif new.f <= second.f:
            second, third = new, second
        else:
            third = new
    return best


def _bottom(one: Point, two: Point, three: Point) -> tuple[float, float]:
    """(step from the first point to the bottom of the parabola through all, how much lower it is); infinite without."""
    if math.isinf(three.f):
        return math.inf, math.inf
    slope, other = ((p.f - one.f) / (p.x - one.x) for p in (two, three))
    bend = (slope - other) / (two.x - three.x)
    step = 0.5 * (two.x - one.x - slope / bend) if bend > 0.0 else math.inf
    return step, bend * step**2
