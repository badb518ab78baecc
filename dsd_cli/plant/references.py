"""What the plant shall follow: each reference gives r and r' at the samples t_k = k T."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from dsd_cli.errors import UsageError
from dsd_cli.signals.log import Array

#: A stamp this close (in samples) to a point in time counts as being there.
_THERE = 1e-6


class Trajectory(NamedTuple):
    """position r and rate r', each of shape (n,); the sum of rate * T is the change of r where r jumps."""

    position: Array
    rate: Array


class Reference(Protocol):
    """Anything that can be sampled."""

    def sample(self, samples: int, sample_time: float) -> Trajectory: ...


@dataclass(frozen=True)
class Step:
    """0 before `time` (s), `amplitude` from there on; r' is amplitude / T at the one sample of the step."""

    time: float = 0.0
    amplitude: float = 1.0

    def sample(self, samples: int, sample_time: float) -> Trajectory:
        at = math.ceil(min(self.time / sample_time, samples) - _THERE)
        position, rate = np.zeros(samples), np.zeros(samples)
        position[at:] = self.amplitude
        rate[at : at + 1] = self.amplitude / sample_time
        return Trajectory(position, rate)


@dataclass(frozen=True)
class Sine:
    """amplitude sin(frequency (t - start)) from `start` (s) on; frequency in rad/s."""

    frequency: float
    amplitude: float = 1.0
    start: float = 0.0

    def sample(self, samples: int, sample_time: float) -> Trajectory:
        t, on = _since(self.start, samples, sample_time)
        angle = self.frequency * t
        return Trajectory(on * self.amplitude * np.sin(angle), on * self.amplitude * self.frequency * np.cos(angle))


@dataclass(frozen=True)
class Multisine:
    """Sines of one amplitude at `frequencies` (rad/s), with phases drawn from `seed`; 0 before `start` (s)."""

    frequencies: tuple[float, ...]
    amplitude: float = 1.0
    seed: int = 0
    start: float = 0.0

    def sample(self, samples: int, sample_time: float) -> Trajectory:
        phases = np.random.default_rng(self.seed).uniform(0.0, 2.0 * np.pi, len(self.frequencies))
        t, on = _since(self.start, samples, sample_time)
        position, rate = np.zeros(samples), np.zeros(samples)
        for frequency, phase in zip(self.frequencies, phases, strict=True):
            position += on * self.amplitude * np.sin(frequency * t + phase)
            rate += on * self.amplitude * frequency * np.cos(frequency * t + phase)
        return Trajectory(position, rate)


@dataclass(frozen=True)
class Trapezoids:
    """To and fro over `distance` with trapezoidal speed, at rest for `dwell` (s) at both ends, from `start` (s) on.

    speed : the greatest one, rad/s or m/s; not reached if the distance is short.
    acceleration : rad/s2 or m/s2.
    """

    distance: float
    speed: float
    acceleration: float
    dwell: float = 0.0
    start: float = 0.0

    def __post_init__(self) -> None:
        for name in ("distance", "speed", "acceleration"):
            if not getattr(self, name) > 0.0:
                raise UsageError(f"reference.{name} = {getattr(self, name):g}", "must be above 0")

    def sample(self, samples: int, sample_time: float) -> Trajectory:
        t, on = _since(self.start, samples, sample_time)
        peak = min(self.speed, math.sqrt(self.distance * self.acceleration))
        ramp = peak / self.acceleration
        move = ramp + self.distance / peak
        turn = move + self.dwell
        back = np.floor(t / turn).astype(np.int64) % 2 == 1
        moved, speed = self._one_move(np.clip(t % turn, 0.0, move), peak, move)
        position = np.where(back, self.distance - moved, moved)
        return Trajectory(on * position, on * np.where(back, -speed, speed))

    def _one_move(self, t: Array, peak: float, move: float) -> tuple[Array, Array]:
        """Position and speed of one move, t in [0, move]."""
        speed = np.minimum(np.minimum(self.acceleration * t, self.acceleration * (move - t)), peak)
        ramp = peak / self.acceleration
        rising = 0.5 * self.acceleration * t**2
        cruising = peak * (t - 0.5 * ramp)
        falling = self.distance - 0.5 * self.acceleration * (move - t) ** 2
        return np.where(t < ramp, rising, np.where(t <= move - ramp, cruising, falling)), speed


@dataclass(frozen=True)
class Samples:
    """Given values, one per sample; the last is held. r' is the backward difference."""

    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.values or not all(math.isfinite(value) for value in self.values):
            raise UsageError("reference column", "needs at least one value, and only finite ones")

    def sample(self, samples: int, sample_time: float) -> Trajectory:
        held = np.minimum(np.arange(samples), len(self.values) - 1)
        position = np.asarray(self.values, dtype=np.float64)[held]
        return Trajectory(position, np.diff(position, prepend=position[:1]) / sample_time)


@dataclass(frozen=True)
class Logged(Samples):
    """A reference as a log has it, whose rate is not logged: r' is the central difference where r is smooth, for the
    backward one is late by half a sample; where r jumps it is the backward one.
    """

    def sample(self, samples: int, sample_time: float) -> Trajectory:
        position, before = super().sample(samples, sample_time)
        after = np.append(before[1:], before[-1:])
        smooth = np.abs(after - before) < 0.5 * np.abs(before).max()
        return Trajectory(position, np.where(smooth, 0.5 * (before + after), before))


@dataclass(frozen=True)
class Planned:
    """A motion as `dsd plan` writes it: position and its rate, one per sample, shape (n,); at rest behind it."""

    position: Array
    rate: Array

    def sample(self, samples: int, sample_time: float) -> Trajectory:
        at = np.minimum(np.arange(samples), len(self.position) - 1)
        beyond = np.arange(samples) >= len(self.position)
        return Trajectory(self.position[at], np.where(beyond, 0.0, self.rate[at]))


def _since(start: float, samples: int, sample_time: float) -> tuple[Array, Array]:
    """(time since `start`, 1 from `start` on and 0 before), each of shape (samples,)."""
    t = sample_time * np.arange(samples) - start
    return np.maximum(t, 0.0), (t >= -_THERE * sample_time).astype(np.float64)
