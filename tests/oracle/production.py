"""A machine that makes one part after the other: the same jerk-limited move again and again, with dwells.

Position loop over a speed loop with an integrator and feed-forward of the torque, at 4 kHz; friction is a steep but
continuous function of speed, so that the axis creeps through each dwell, and an encoder of 20 bits sees that it does.
The log has every fourth sample, and the drive's own speed: the difference over 1 ms, half a millisecond late.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Of the drive, s; steps of the plant in one of them.
TICK, STEPS = 1.0 / 4000.0, 4
#: Of the encoder, rad; samples of the drive from one row of the log to the next.
COUNT, ROW = 2.0 * np.pi / 2**20, 4


@dataclass(frozen=True)
class Axis:
    """inertia in kg m2, delay of u in drive samples, friction in N m, drag in N m s/rad."""

    inertia: float = 6e-4
    delay: int = 12
    friction: float = 0.16
    drag: float = 0.0

    @property
    def late(self) -> float:
        """s by which u acts late."""
        return self.delay * TICK


def _move(way: float, speed: float, acceleration: float) -> Array:
    """Speed of one trapezoid, its corners rounded over 20 ms."""
    ramp = min(speed / acceleration, np.sqrt(way / acceleration))
    top = ramp * acceleration
    lasts = ramp + way / top
    t = np.arange(0.0, lasts, TICK)
    v = np.clip(np.minimum(acceleration * t, acceleration * (lasts - t)), 0.0, top)
    v = np.convolve(v, np.ones(80) / 80.0)
    return v * way / (v.sum() * TICK)


def _programme(kind: str, seconds: float) -> Array:
    """Speed wanted: "index" goes on by a sixth of a turn each time, "shuttle" there and back."""
    if kind == "index":
        one = np.concatenate([_move(np.pi / 3.0, 24.0, 1500.0), np.zeros(700)])
    else:
        there = _move(8.0, 40.0, 1200.0)
        one = np.concatenate([there, np.zeros(1000), -there, np.zeros(600)])
    count = round(seconds / TICK)
    return np.tile(one, count // len(one) + 1)[:count]


def logged(kind: str, axis: Axis, seconds: float = 12.0) -> dict[str, Array]:
    """Channels t, u, position and velocity of such a machine, 1 kHz."""
    wanted = np.convolve(_programme(kind, seconds), np.ones(16) / 16.0, "same")
    place, rate = np.cumsum(wanted) * TICK, np.gradient(wanted, TICK)
    bandwidth = min(2.0 * np.pi * 18.0, 0.35 / max(axis.late, TICK))
    gain, outer, creep = axis.inertia * bandwidth, 0.25 * bandwidth, 2e-4 * float(np.abs(wanted).max())
    q, v, seen, slow, held, h = 0.0, 0.0, 0.0, 0.0, 0.0, TICK / STEPS
    u, position = np.zeros(len(wanted)), np.zeros(len(wanted))
    for i in range(len(wanted)):
        counted = round(q / COUNT) * COUNT
        slow += 0.25 * ((counted - seen) / TICK - slow)
        seen, position[i] = counted, counted
        error = outer * (place[i] - counted) + wanted[i] - slow
        held += error * TICK * bandwidth / 8.0
        u[i] = gain * (error + held) + 0.95 * axis.inertia * rate[i]
        force = u[i - axis.delay] if i >= axis.delay else 0.0
        for _ in range(STEPS):
            v += h * (force - axis.friction * np.tanh(v / creep) - axis.drag * v) / axis.inertia
            q += h * v
    speed = np.zeros(len(wanted))
    speed[ROW:] = (position[ROW:] - position[:-ROW]) / (ROW * TICK)
    channels = {"t": TICK * np.arange(len(wanted)), "u": u, "position": position, "velocity": speed}
    return {name: x[::ROW] for name, x in channels.items()}
