"""Reference motions and drive excitations of commissioning runs, as a servo axis makes them; NumPy only."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

START = 0.1  # s; the first move begins this long after the first row of the log
LONGEST_MOVE = 1.0  # s; slow moves are shortened to this, or one of them would fill the log


@dataclass(frozen=True)
class Motion:
    """How one machine is moved: trapezoidal moves between two soft ends, and a signal added to the command."""

    speed: float  # rad/s, the fastest move
    acceleration: float  # rad/s2, the hardest ramp
    span: float  # rad, the moves stay within +-span
    shortest: float  # rad, the smallest move
    slowest: float  # share of `speed` that the slowest moves have
    injection: float = 0.0  # N m rms added to the command
    band: tuple[float, float] = (0.5, 20.0)  # Hz, of the injection
    chirp: bool = False  # the injection is a sweep through `band` instead of a multisine


def reference(motion: Motion, times: Array, duration: float, seed: int) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration (rad, rad/s, rad/s2) at `times`; at rest at 0 before `START`."""
    rng = np.random.default_rng([seed, 11])
    spans, accelerations = [START], [0.0]
    position, elapsed = 0.0, START
    while elapsed < duration:
        length, ramp, cruise, acceleration = _move(motion, position, rng)
        dwell = float(rng.choice([0.02, rng.uniform(0.05, 0.25)]))
        sign = np.sign(length)
        spans += [ramp, cruise, ramp, dwell]
        accelerations += [sign * acceleration, 0.0, -sign * acceleration, 0.0]
        position += length
        elapsed += 2 * ramp + cruise + dwell
    return _integrate(np.array(spans), np.array(accelerations), times)


def _move(motion: Motion, position: float, rng: np.random.Generator) -> tuple[float, float, float, float]:
    """Length with its sign, ramp time, cruise time, acceleration of one move that stays within the span."""
    room = motion.span - position if rng.uniform() < 0.5 - 0.45 * position / motion.span else -motion.span - position
    reach = min(abs(room), motion.span * 1.5)
    length = min(reach, motion.shortest * (max(reach / motion.shortest, 1.0)) ** rng.uniform(0.15, 1.0))
    speed = motion.speed * motion.slowest ** (rng.uniform() ** 2.2)  # more fast moves than slow ones
    acceleration = motion.acceleration * rng.uniform(0.35, 1.0)
    length = min(length, speed * LONGEST_MOVE)
    speed = min(speed, np.sqrt(length * acceleration))
    ramp = speed / acceleration
    return float(np.sign(room)) * length, ramp, length / speed - ramp, acceleration


def _integrate(spans: Array, accelerations: Array, times: Array) -> tuple[Array, Array, Array]:
    """Exact motion under piecewise constant acceleration."""
    starts = np.concatenate([[0.0], np.cumsum(spans)])
    speeds = np.concatenate([[0.0], np.cumsum(accelerations * spans)])
    places = np.concatenate([[0.0], np.cumsum(speeds[:-1] * spans + 0.5 * accelerations * spans**2)])
    piece = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(spans) - 1)
    inside = np.maximum(times - starts[piece], 0.0)
    a = np.where(times < 0.0, 0.0, accelerations[piece])
    v = np.where(times < 0.0, 0.0, speeds[piece] + a * inside)
    return places[piece] + speeds[piece] * inside + 0.5 * a * inside**2, v, a


def injection(motion: Motion, times: Array, duration: float, seed: int) -> Array:
    """The signal added to the command (N m): nothing, a multisine with random phases, or a logarithmic sweep."""
    if motion.injection == 0.0:
        return np.zeros_like(times)
    rng = np.random.default_rng([seed, 12])
    low, high = motion.band
    inside = np.clip(times, 0.0, None)
    if motion.chirp:
        rate = np.log(high / low) / duration
        shape = np.sqrt(2.0) * np.sin(2 * np.pi * low * (np.exp(rate * inside) - 1.0) / rate)
    else:
        tones = np.geomspace(low, high, 14) * rng.uniform(0.95, 1.05, 14)
        phases = rng.uniform(0.0, 2 * np.pi, 14)
        shape = np.sum([np.sin(2 * np.pi * f * inside + p) for f, p in zip(tones, phases, strict=True)], axis=0)
        shape *= np.sqrt(2.0 / 14)
    return motion.injection * shape * np.clip(inside / START, 0.0, 1.0)
