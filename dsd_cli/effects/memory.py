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
COMPILED = compiled_module("dsd_cli.effects._memory", "load_row")

#: How deep in contact the damping is fully there, as a share of gap/2. It fades in, so that the force is continuous: a
#: jump would be at another instant for every step length.
FULL_DAMPING = 0.1
#: Runge-Kutta steps of the load are at most this long, in radians of its own oscillation.
STEP = 0.2
#: And with a gap; a step within which a contact begins or ends is cut into so many.
STEP_WITH_GAP, PARTS = 0.1, 8
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
    """Spring and damper between motor and load, per inertia of the load.

    square : wa^2, rad2/s2. drag : 2 zeta wa, rad/s. half_gap : rad or m that the load may be off without a force.
    rate : wa, rad/s, the load's own frequency while the motor is held.
    """

    square: float
    drag: float
    half_gap: float
    rate: float

    @classmethod
    def of(cls, frequency: float, damping: float, gap: float = 0.0) -> Coupling:
        """From Hz, the damping ratio, and the total play."""
        rate = 2.0 * math.pi * frequency
        return cls(rate * rate, 2.0 * damping * rate, 0.5 * gap, rate)

    @property
    def shape(self) -> dict[str, float]:
        """Hz, the damping ratio, and the total play: the inverse of `of`."""
        return {
            "frequency": self.rate / (2.0 * math.pi),
            "damping": 0.5 * self.drag / self.rate,
            "gap": 2.0 * self.half_gap,
        }

    def pull(self, apart: float, closing: float) -> float:
        """Acceleration of the load; apart = motor less load, closing = its rate. A contact pushes and never pulls."""
        if self.half_gap == 0.0:
            return self.square * apart + self.drag * closing
        if apart > self.half_gap:
            return self._contact(apart - self.half_gap, closing)
        if apart < -self.half_gap:
            return -self._contact(-apart - self.half_gap, -closing)
        return 0.0

    def regime(self, apart: float, closing: float) -> int:
        """The law that holds: 0 no force, +-1 the damping fades in, +-2 it is fully there; the sign is the flank."""
        depth = abs(apart) - self.half_gap
        if self.half_gap == 0.0 or depth <= 0.0 or self.pull(apart, closing) == 0.0:
            return 0
        return (1 if apart > 0.0 else -1) * (1 if depth < FULL_DAMPING * self.half_gap else 2)

    def _contact(self, depth: float, closing: float) -> float:
        share = depth * (1.0 / (FULL_DAMPING * self.half_gap))
        return max(self.square * depth + self.drag * closing * (share if share < 1.0 else 1.0), 0.0)

    def steps(self, interval: float) -> int:
        """Runge-Kutta steps of the load in an interval of s."""
        longest = STEP_WITH_GAP if self.half_gap > 0.0 else STEP
        return min(max(math.ceil(self.rate * interval / longest), 1), MOST_STEPS)

    def repeated(self, count: int, body: Callable[..., tuple[float, float]], q: float, v: float) -> tuple[float, float]:
        """(q, v) after `body(i, q, v)` for i = 0, 1, ...: the one loop, so that an export has it as a loop, too."""
        for i in range(count):
            q, v = body(i, q, v)
        return q, v

    def over(self, motor: Motor, s: float, h: float, q: float, v: float) -> tuple[float, float]:
        """Position and speed of the load h after s; a step within which the law changes is cut."""
        q_end, v_end, smooth = self.step(motor, s, h, q, v)
        if smooth:
            return q_end, v_end
        part = h / PARTS
        return self.repeated(PARTS, lambda j, q, v: self.step(motor, s + j * h / PARTS, part, q, v)[:2], q, v)

    def step(self, motor: Motor, s: float, h: float, q: float, v: float) -> tuple[float, float, bool]:
        """(position, speed) of the load h later, and whether one law of the coupling holds throughout."""
        laws, plays = [], self.half_gap > 0.0

        def pull(s: float, position: float, speed: float) -> float:
            place, rate = motor.at(s)
            if plays:
                laws.append(self.regime(place - position, rate - speed))
            return self.pull(place - position, rate - speed)

        a1 = pull(s, q, v)
        v2 = v + 0.5 * h * a1
        a2 = pull(s + 0.5 * h, q + 0.5 * h * v, v2)
        v3 = v + 0.5 * h * a2
        a3 = pull(s + 0.5 * h, q + 0.5 * h * v2, v3)
        v4 = v + h * a3
        a4 = pull(s + h, q + h * v3, v4)
        q = q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
        v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if not plays:
            return q, v, True
        pull(s + h, q, v)
        return q, v, self.alike(laws)

    def alike(self, laws: list[int]) -> bool:
        """Whether all of them are one."""
        return all(law == laws[0] for law in laws)


class Load(NamedTuple):
    """The load at the end of an interval, and the mean motor speed and length of that interval."""

    position: float
    velocity: float
    motor_velocity: float
    interval: float


class Motor(NamedTuple):
    """Motion of the motor in an interval of s in [0, T]: mean of its end positions, mean speed, acceleration."""

    position: float
    velocity: float
    slope: float
    interval: float

    def at(self, s: float) -> tuple[float, float]:
        """(position, speed)."""
        since = s - 0.5 * self.interval
        position = self.position + self.velocity * since + 0.5 * self.slope * s * (s - self.interval)
        return position, self.velocity + self.slope * since


def load_acceleration(
    position: Any, velocity: Any, interval: Any, coupling: Coupling, state: Load | None, compiled: Any = COMPILED
) -> tuple[Any, Load]:
    """(mean acceleration of the load per interval, load at the end), for floats or arrays of shape (n,).

    The motor's position and velocity are means of the interval's ends, and within it the motor moves along a parabola
    whose bend is taken from the change of speed since the interval before. `state` None: the load begins at rest
    relative to the motor, at the end of the first row. An interval of 0 is this instant, and moves nothing.
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
    q, v = _run(coupling, Motor(position, velocity, slope, interval), state.position, state.velocity)
    return (v - state.velocity) / interval, Load(q, v, velocity, interval)


def _run(coupling: Coupling, motor: Motor, q: float, v: float) -> tuple[float, float]:
    """Position and speed of the load after the interval, by classical Runge-Kutta steps."""
    steps = coupling.steps(motor.interval)
    h = motor.interval / steps
    q, v = coupling.repeated(steps, lambda i, q, v: coupling.over(motor, i * h, h, q, v), q, v)
    return q, v


def driven_motor(push: Array, interval: float, coupling: Coupling, share: float, step: float) -> Array:
    """Mean acceleration of the motor per interval, s_m J a = F - (1 - s_m) J a_l; parameters as `driven_load`."""
    return np.asarray(push - share / (1.0 - share) * driven_load(push, interval, coupling, share, step))


def driven_load(
    push: Array, interval: float, coupling: Coupling, share: float, step: float, compiled: Any = COMPILED
) -> Array:
    """Mean acceleration of the load per interval where a force drives the motor: two masses, no sensor, from rest.

        c' = F / (s_m J) - a_l / s_m,    a_l = pull(motor less load, c),    s_m = 1 - share

    Parameters
    ----------
    push : F / (s_m J), what the motor would do alone, constant in each interval, shape (n,), of equal intervals in s.
    share : the load's, of the inertia J of both. step : longest Runge-Kutta step, radians of the free vibration; one
        within which a contact begins or ends is cut.
    """
    own = 1.0 - share
    steps = min(max(math.ceil(coupling.rate / math.sqrt(own) * interval / step), 1), MOST_STEPS)
    push = np.ascontiguousarray(push, dtype=np.float64)
    out = np.empty_like(push)
    if compiled is not None:
        compiled.driven(push, tuple(coupling), own, interval, steps, out)
        return out
    h, lighter, apart, closing = interval / steps, 1.0 / own, 0.0, 0.0
    for k, f in enumerate(push.tolist()):
        total = 0.0
        for _ in range(steps):
            q, v, mean, smooth = _pair_step(coupling, f, lighter, h, apart, closing)
            if not smooth:
                q, v, mean = apart, closing, 0.0
                for _ in range(PARTS):
                    q, v, part, _ = _pair_step(coupling, f, lighter, h / PARTS, q, v)
                    mean += part / PARTS
            apart, closing, total = q, v, total + mean
        out[k] = total / steps
    return out


def _pair_step(
    coupling: Coupling, push: float, lighter: float, h: float, q: float, v: float
) -> tuple[float, float, float, bool]:
    """(motor less load, its rate, mean pull on the way, whether one law of the coupling holds throughout)."""
    p1 = coupling.pull(q, v)
    a1 = push - p1 * lighter
    q2, v2 = q + 0.5 * h * v, v + 0.5 * h * a1
    p2 = coupling.pull(q2, v2)
    a2 = push - p2 * lighter
    q3, v3 = q + 0.5 * h * v2, v + 0.5 * h * a2
    p3 = coupling.pull(q3, v3)
    a3 = push - p3 * lighter
    q4, v4 = q + h * v3, v + h * a3
    p4 = coupling.pull(q4, v4)
    a4 = push - p4 * lighter
    laws = {coupling.regime(*at) for at in ((q, v), (q2, v2), (q3, v3), (q4, v4))}
    q = q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
    v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    return q, v, (p1 + 2.0 * p2 + 2.0 * p3 + p4) / 6.0, len(laws) == 1
