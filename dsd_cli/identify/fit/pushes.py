"""What drives a load on the motor: the motion that the sensor saw, and what moves the axis from outside."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.recordings.sensor import Sensor
from dsd_cli.identify.recordings.spectrum import SensorNoise
from dsd_cli.signals.log import Array, Log

#: Seed of the synthetic sensor noise that calibrates the errors-in-variables correction.
_SEED = 20261121


@dataclass(frozen=True)
class SensorMotion:
    """What the measured acceleration of a stretch adds up to, and the noise of its sensor: made once a load asks.

    A load that is coupled to the motor is driven by it: with a smoother motion than the acceleration's own it would
    imitate a noise-free acceleration.
    """

    log: Log
    sensor: Sensor

    @cached_property
    def noise(self) -> Array:
        """A synthetic realisation of the sensor noise in the acceleration, shape (n,)."""
        return self.sensor.noise.made(len(self.log), np.random.default_rng(_SEED))

    @cached_property
    def motion(self) -> tuple[Array, Array]:
        """(mean speed, mean position) of each interval out of the acceleration, but for a constant speed."""
        return self._integrated(self.log["acceleration"])

    @cached_property
    def noisy(self) -> tuple[Array, Array]:
        """`motion` with `noise` on the acceleration."""
        return self._integrated(self.log["acceleration"] + self.noise)

    def _integrated(self, acceleration: Array) -> tuple[Array, Array]:
        return integrated(acceleration, self.log.sample_time, self.sensor.two_intervals)


def integrated(acceleration: Array, step: float, two_intervals: bool) -> tuple[Array, Array]:
    """Mean speed and position of each interval that accelerations add up to, from rest.

    step : s. two_intervals : each is a mean over both intervals beside its sample.
    """
    speeds = np.cumsum(acceleration) * step
    before = np.concatenate([[0.0], speeds[:-1]])
    mean = before if two_intervals else 0.5 * (before + speeds)
    ends = np.cumsum(mean) * step
    return mean, ends - 0.5 * mean * step


#: Lengths of windows, samples, and shares of the usual acceleration that the noise of their means may have.
_WINDOWS, _NOISE = (1, 3, 5, 7, 11, 15, 21, 31), (0.6, 0.25, 0.1)
#: s over which what both masses do together may drift away from what F says, and knots in that time.
_DRIFT, _KNOTS = 1.0, 20


@dataclass(frozen=True)
class Pushes:
    """What moves an axis, as its acceleration averages it; lists hold one array of shape (n,) per stretch.

    forces : F, then what a sample of delay less and each coefficient change in it: [column][stretch], unit of u.
    noise : of the acceleration. two_intervals : as of a `Stretch`. step : s. before : F per interval.
    """

    acceleration: list[Array]
    forces: list[list[Array]]
    noise: SensorNoise
    two_intervals: bool
    step: float
    before: list[Array]

    @cached_property
    def moved(self) -> list[list[Array]]:
        """Double integrals of the acceleration and of each column of forces, [column][stretch]."""
        every = [self.acceleration, *self.forces]
        return [[integrated(x, self.step, self.two_intervals)[1] for x in by] for by in every]

    @cached_property
    def counts(self) -> list[int]:
        """Slow functions of time of each stretch."""
        return [2 + int(len(x) * self.step / _DRIFT) for x in self.acceleration]

    def drift(self, stretch: int, rows: NDArray[np.int_]) -> Array:
        """Slow functions of time at these samples of a stretch, zero for the others' columns, shape (n, k)."""
        before, count = sum(self.counts[:stretch]), self.counts[stretch]
        x, basis = rows / len(self.acceleration[stretch]), np.zeros((len(rows), sum(self.counts)))
        basis[:, before : before + count] = np.stack([x, *(np.cos(np.pi * j * x) for j in range(count - 1))], axis=1)
        return basis

    def drifted(self, stretch: int, coefficients: Array) -> Array:
        """Their sum at every sample, by straight lines between knots that are close against `_DRIFT`."""
        rows = np.arange(len(self.acceleration[stretch]))
        knots = np.append(rows[:: max(int(_DRIFT / (_KNOTS * self.step)), 1)], rows[-1:])
        return np.interp(rows, knots, self.drift(stretch, knots) @ coefficients)

    def net(self, changes: Array) -> list[Array]:
        """F with these changes."""
        by_stretch = zip(*self.forces, strict=True)
        return [f + sum(c * x for c, x in zip(changes, rest, strict=True)) for f, *rest in by_stretch]

    def smooth(self, x: Array, width: int) -> Array:
        """Means over so many samples; of means again, where a position is differenced twice."""
        box = np.full(width, 1.0 / width)
        return centred(x, np.convolve(box, box) if self.two_intervals else box)

    @cached_property
    def spreads(self) -> dict[int, float]:
        """Standard deviation of the noise of each window, unit of acceleration."""
        made = self.noise.made(4096, np.random.default_rng(0))
        return {w: float(np.std(self.smooth(made, w)[2 * w : -2 * w])) for w in _WINDOWS}

    def widths(self, inertia: float) -> list[int]:
        """Windows: short ones show quick bounces, long ones small forces."""
        usual = math.sqrt(np.mean(np.concatenate(self.forces[0]) ** 2)) / inertia
        found = [next((w for w in _WINDOWS if self.spreads[w] < share * usual), 0) for share in _NOISE]
        return sorted({w for w in found if w})


def centred(x: Array, kernel: Array) -> Array:
    """Convolution with a kernel of odd length, shape of x, also where x is shorter than the kernel."""
    first = len(kernel) // 2
    return np.convolve(x, kernel)[first : first + len(x)]
