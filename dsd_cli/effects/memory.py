"""Recursions of effects with memory: compiled where the build had a compiler, else the loops that stand here.

`_memory.c` does the same operations in the same order, but takes the steps of a load under one law at once, which
differs by rounding. So does the row of a load in a simulation; those of other effects always run here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from dsd_cli.signals.compiled import compiled_module
from dsd_cli.signals.log import Array

#: The compiled module, or None where the build had no compiler.
COMPILED = compiled_module("dsd_cli.effects._memory")

#: Steps are at most this long, in radians of the oscillation of motor against load, and in time constants of a damper
#: by which speeds become alike: at 2.8 of those the fourth order diverges.
STEP, SETTLING = 0.2, 1.0
#: Beginnings and ends of contacts that are found in a step: a contact lasts longer than one, a touch need not.
EVENTS = 6
#: And no interval is cut into more steps than this.
MOST_STEPS = 10_000


def one_pole(keep: Array, add: Array, before: float, compiled: Any = COMPILED) -> Array:
    """y_k = keep_k y_{k-1} + add_k with y_{-1} = before; every array of shape (n,)."""
    keep, add = np.ascontiguousarray(keep, dtype=np.float64), np.ascontiguousarray(add, dtype=np.float64)
    out = np.empty_like(add)
    if compiled is not None:
        compiled.one_pole(keep, add, float(before), out)
        return out
    y = float(before)
    for k, (a, b) in enumerate(zip(keep.tolist(), add.tolist(), strict=True)):
        out[k] = y = a * y + b
    return out


def before_each(values: Array, before: float) -> Array:
    """`values` one row later: what was there when each row began."""
    return np.concatenate([[before], values[:-1]])


class Coupling(NamedTuple):
    """Spring and damper between motor and load, per inertia of the load; with play a contact pushes and never pulls.

    square : wa^2, rad2/s2. drag : 2 zeta wa, rad/s. half_gap : rad or m that the load may be off without a force.
    rate : wa, rad/s, the load's own frequency while the motor is held. slowing : by which the load's own Coulomb
    friction slows it while it slides, rad/s2 or m/s2.

    A contact is the spring and the damper at once (Kelvin and Voigt), so that a load bounces with the same restitution
    however fast it comes: the force jumps when a contact begins, and is 0 where it ends. Motion is solved from one such
    instant to the next. Motor less load is `apart`, its rate `closing`, and

        closing' = push - lighter pull(apart, closing)

    with a push that is constant on the way: the acceleration of the motor, for a load behind it (lighter 1).
    """

    square: float
    drag: float
    half_gap: float
    rate: float
    slowing: float = 0.0

    @classmethod
    def of(cls, frequency: float, damping: float, gap: float = 0.0, slowing: float = 0.0) -> Coupling:
        """From Hz, the damping ratio, the total play, and what the load's own friction takes of its speed."""
        rate = 2.0 * math.pi * frequency
        return cls(rate * rate, 2.0 * damping * rate, 0.5 * gap, rate, slowing)

    @property
    def shape(self) -> dict[str, float]:
        """Hz, the damping ratio, and the total play: the inverse of `of`."""
        return {
            "frequency": self.rate / (2.0 * math.pi),
            "damping": 0.5 * self.drag / self.rate,
            "gap": 2.0 * self.half_gap,
            "slowing": self.slowing,
        }

    def rubbed(self, h: float, speed: float) -> float:
        """What the load's own friction takes of its speed in h: no more than all of it, for then the load sticks."""
        most = self.slowing * h
        return most if speed > most else -most if speed < -most else speed

    def pull(self, apart: float, closing: float) -> float:
        """Acceleration of the load."""
        if self.half_gap == 0.0:
            return self.square * apart + self.drag * closing
        side = self.side(apart, closing)
        return self.square * (apart - side * self.half_gap) + self.drag * closing if side != 0.0 else 0.0

    def side(self, apart: float, closing: float) -> float:
        """The flank that pushes, 1 or -1; 0: none."""
        flank = -1.0 if apart < 0.0 else 1.0
        depth = flank * apart - self.half_gap
        return flank if depth >= 0.0 and self.square * depth + self.drag * flank * closing > 0.0 else 0.0

    def steps(self, interval: float, lighter: float = 1.0) -> int:
        """Steps of the load in an interval of s; `lighter` as above."""
        steps = interval * max(self.rate * math.sqrt(lighter) / STEP, self.drag * lighter / SETTLING)
        return min(max(math.ceil(steps), 1), MOST_STEPS)

    def repeated(self, count: int, body: Callable[..., tuple[Any, ...]], *start: Any) -> tuple[Any, ...]:
        """`values = body(i, *values)` for i = 0, 1, ...: the one loop, so that an export has it as a loop, too."""
        for i in range(count):
            start = body(i, *start)
        return start

    def over(self, push: float, lighter: float, h: float, apart: float, closing: float) -> tuple[float, float, float]:
        """(apart, closing, what contact took from closing) h later, for h of at most `STEP`."""
        if self.half_gap == 0.0:
            q, v = self.swung(push, lighter, h, apart, closing)
            return q, v, push * h - (v - closing)

        def body(i: Any, side: Any, left: Any, q: Any, v: Any, taken: Any) -> tuple[Any, ...]:
            return self.until_event(push, lighter, side, left, q, v, taken)

        side = self.side(apart, closing)
        _, left, q, v, taken = self.repeated(EVENTS, body, side, h, apart, closing, 0.0)
        return q + left * (v + 0.5 * left * push), v + left * push, taken

    def until_event(
        self, push: float, lighter: float, side: float, left: float, q: float, v: float, taken: float
    ) -> tuple[float, float, float, float, float]:
        """(flank that pushes, s left, apart, closing, taken) when a contact begins or ends, or no time is left."""
        if left <= 0.0:
            return side, left, q, v, taken
        if side == 0.0:
            side, s = self.touches(push, left, q, v)
            return side, left - s, q + s * (v + 0.5 * s * push), v + s * push, taken
        s = self.leaves(side * push, lighter, left, side * q - self.half_gap, side * v)
        depth, w = self.swung(side * push, lighter, s, side * q - self.half_gap, side * v)
        after = side * w
        return (
            side if s >= left else 0.0,
            left - s,
            side * (depth + self.half_gap),
            after,
            taken + push * s - (after - v),
        )

    def touches(self, push: float, left: float, q: float, v: float) -> tuple[float, float]:
        """(flank that pushes next, when) of a load that is off; 0 if none does in what is left."""
        flank = -1.0 if q < 0.0 else 1.0
        depth, w, p = flank * q - self.half_gap, flank * v, flank * push
        near, far = self.rises(depth, w, p, left), self.rises(-depth - 2.0 * self.half_gap, -w, -p, left)
        if depth >= 0.0:  # it leaves, and may be pushed again before it is out
            again = self.rises(
                self.square * depth + self.drag * w, self.square * w + self.drag * p, self.square * p, left
            )
            if again < near and depth + again * (w + 0.5 * again * p) >= 0.0:
                near = again
        if near < far:
            return flank, near
        return (-flank if far < left else 0.0), far

    def leaves(self, push: float, lighter: float, left: float, depth: float, w: float) -> float:
        """When a contact ends; `left` if it does not until then. Where it ends the force is 0, and a parabola does."""
        last, speed = self.swung(push, lighter, left, depth, w)
        force, after = self.square * depth + self.drag * w, self.square * last + self.drag * speed
        if after >= 0.0:
            return left
        rate = self.square * w + self.drag * (push - lighter * force)
        found: float = self.rises(-force, -rate, 2.0 * (force + rate * left - after) / (left * left), left)
        return found

    def rises(self, value: float, rate: float, bend: float, most: float) -> float:
        """When value + rate s + bend s^2 / 2 next rises through 0; `most` if it does not until then."""
        square = rate * rate - 2.0 * bend * value
        if square < 0.0:
            return most
        root = np.sqrt(square)
        if rate > 0.0:
            at = -2.0 * value / (rate + root)
        elif bend == 0.0:
            return most
        else:
            at = (root - rate) / bend
        return at if 0.0 <= at < most else most

    def swung(self, push: float, lighter: float, h: float, q: float, v: float) -> tuple[float, float]:
        """(apart, closing) h later on spring and damper: the fourth order of Taylor, which Runge-Kutta's is, too."""
        a = push - lighter * (self.square * q + self.drag * v)
        b = -lighter * (self.square * v + self.drag * a)
        c = -lighter * (self.square * a + self.drag * b)
        d = -lighter * (self.square * b + self.drag * c)
        place = q + h * (v + h / 2.0 * (a + h / 3.0 * (b + h / 4.0 * c)))
        return place, v + h * (a + h / 2.0 * (b + h / 3.0 * (c + h / 4.0 * d)))


class Load(NamedTuple):
    """The load at the end of an interval, and the mean motor speed and length of that interval."""

    position: float
    velocity: float
    motor_velocity: float
    interval: float


def load_acceleration(
    position: Any, velocity: Any, interval: Any, coupling: Coupling, state: Load | None, compiled: Any = COMPILED
) -> tuple[Any, Load]:
    """(mean pull on the load per interval, load at the end), for floats or arrays of shape (n,).

    The motor's position and velocity are means of the interval's ends, and within it the motor moves along a parabola
    whose bend is taken from the change of speed since the interval before. The pull is the load's acceleration but for
    its own friction. `state` None: the load begins at rest relative to the motor, at the end of the first row. An
    interval of 0 is this instant, and moves nothing.
    """
    if isinstance(position, float) or np.ndim(position) == 0:  # the simulator, in its innermost loop
        if compiled is None or state is None or not isinstance(position, float):  # an export asks with symbols
            return _load_row(position, velocity, interval, coupling, state)
        mean, after = compiled.load_row(position, velocity, interval, coupling, state)
        return mean, Load(*after)
    q, v, t = (np.ascontiguousarray(np.broadcast_to(x, position.shape), dtype=np.float64) for x in (
        position, velocity, interval))  # fmt: skip
    out = np.zeros(len(q))
    first = 0
    if state is None and len(q):
        first, state = 1, Load(float(q[0]), float(v[0]), float(v[0]), 0.0)
    if state is None or first == len(q):
        return out, state or Load(0.0, 0.0, 0.0, 0.0)
    if compiled is not None:
        return out, Load(*compiled.load(q[first:], v[first:], t[first:], tuple(coupling), tuple(state), out[first:]))
    for k in range(first, len(q)):
        out[k], state = _load_row(float(q[k]), float(v[k]), float(t[k]), coupling, state)
    return out, state


def _load_row(
    position: float, velocity: float, interval: float, coupling: Coupling, state: Load | None
) -> tuple[float, Load]:
    if state is None:
        return 0.0, Load(position, velocity, velocity, 0.0)
    if interval == 0.0:
        return coupling.pull(position - state.position, velocity - state.velocity), state
    slope = (velocity - state.motor_velocity) / (0.5 * (interval + state.interval))
    apart = position - 0.5 * interval * velocity - state.position
    closing = velocity - 0.5 * interval * slope - state.velocity
    steps = coupling.steps(interval)
    apart, _, taken, speed = over(coupling, slope, 1.0, interval, steps, apart, closing, state.velocity)
    return taken / interval, Load(position + 0.5 * interval * velocity - apart, speed, velocity, interval)


def over(
    coupling: Coupling,
    push: float,
    lighter: float,
    interval: float,
    steps: int,
    apart: float,
    closing: float,
    speed: float,
) -> tuple[float, float, float, float]:
    """(apart, closing, taken, speed of the load) after an interval; the rest as `Coupling.over`, in steps."""
    h = interval / steps
    rubs = coupling.slowing != 0.0

    def body(i: Any, q: Any, v: Any, taken: Any, *w: Any) -> tuple[Any, ...]:
        q, v, more = coupling.over(push, lighter, h, q, v)
        if not rubs:
            return q, v, taken + more
        now = w[0] + more / lighter
        rubbed = coupling.rubbed(h, now)
        return q + 0.5 * h * rubbed, v + rubbed, taken + more, now - rubbed

    apart, closing, taken, *after = coupling.repeated(steps, body, apart, closing, 0.0, *((speed,) if rubs else ()))
    return apart, closing, taken, after[0] if rubs else speed + taken / lighter
