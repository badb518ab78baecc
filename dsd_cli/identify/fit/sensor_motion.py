"""The motion that the sensor of the acceleration saw, noise and all: it drives a load that hangs on the motor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dsd_cli.identify.recordings.sensor import Sensor
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
