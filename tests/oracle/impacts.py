"""A motor and a load with play between hard flanks: impacts are events, solved exactly from one to the next.

SI. Forces are constant in each interval; nothing else acts. Independent of the rig, whose contacts are springs.
"""

import math
from typing import NamedTuple

import numpy as np

#: rad/s of closing speed, below which a load that is pressed on stays on its flank.
REST = 1e-3


class Masses(NamedTuple):
    """motor, load : kg m2. gap : rad, of the whole play. bounce : coefficient of restitution."""

    motor: float
    load: float
    gap: float
    bounce: float = 0.4


def run(masses: Masses, force: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(position, speed of the motor, side) at the end of each interval, shape (n,) each, from rest in the middle.

    side : -1 or 1 of the flank that is pressed on then, 0 in between.
    """
    rows = []
    q, v, apart, closing, side = 0.0, 0.0, 0.0, 0.0, 0
    for f in force.tolist():
        q, v, apart, closing, side = _interval(masses, f, step, (q, v, apart, closing, side))
        rows.append((q, v, side))
    found = np.array(rows).T
    return found[0], found[1], found[2]


def _interval(m: Masses, f: float, left: float, state: tuple) -> tuple:
    q, v, apart, closing, side = state
    while left > 0.0:
        if side and f * side < 0.0:
            side = 0
        if side:  # pressed together
            a = f / (m.motor + m.load)
            return q + v * left + 0.5 * a * left**2, v + a * left, 0.5 * side * m.gap, 0.0, side
        a = f / m.motor
        until, flank = _next(m, apart, closing, a, left)
        q, v = q + v * until + 0.5 * a * until**2, v + a * until
        apart, closing, left = apart + closing * until + 0.5 * a * until**2, closing + a * until, left - until
        if flank:
            apart, change = 0.5 * flank * m.gap, -(1.0 + m.bounce) * closing
            v += change * m.load / (m.motor + m.load)
            closing += change
            if abs(closing) < REST and f * flank > 0.0:
                v -= closing * m.load / (m.motor + m.load)
                closing, side = 0.0, flank
    return q, v, apart, closing, side


def _next(m: Masses, apart: float, closing: float, a: float, left: float) -> tuple[float, int]:
    """(s until a flank is met, which one), or (left, 0)."""
    found = (left, 0)
    for flank in (-1, 1):
        c = apart - 0.5 * flank * m.gap
        for t in _roots(0.5 * a, closing, c):
            meets = (closing + a * t) * flank > 0.0
            if meets and 0.0 <= t < found[0]:
                found = (t, flank)
    return found


def _roots(a: float, b: float, c: float) -> list[float]:
    if a == 0.0:
        return [-c / b] if b else []
    inside = b * b - 4.0 * a * c
    if inside < 0.0:
        return []
    far = -0.5 * (b + math.copysign(math.sqrt(inside), b))
    return [far / a, *([c / far] if far else [])]
