"""Power over frequency, of signals and of the sensor's noise; whether a motion repeats itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array

SensorKind = Literal["position", "velocity", "d_hat"]

#: Exponent of w from which on the fall of a density is no motion's; ratio of the ends of the bands that are compared,
#: half an octave, and frequencies in one at least.
_STEEP, _WIDTH, _FEWEST_BINS = 5.0, math.sqrt(2.0), 2
#: Bands below that fall, an octave and a half, in which a log that passed a low-pass holds something.
_BROAD = 3
#: Rows of a segment at most, and segments that a short signal is still cut into.
SEGMENT, FEWEST_SEGMENTS = 2048, 6


class Density(NamedTuple):
    """Power density by angle w = 2 pi f T in (0, pi], both of shape (m,); white noise of variance s2 has density s2."""

    angle: Array
    power: Array

    def at(self, angle: Array) -> Array:
        """The density interpolated, shape of `angle`."""
        return np.interp(angle, self.angle, self.power)


def density(parts: Sequence[Array], segment: int = SEGMENT) -> Density:
    """Mean periodogram (Welch: Hann, half overlap) of stretches of one signal; one shorter than a segment is its own,
    filled up with zeros: of tests in pieces the short ones are those that accelerate."""
    longest = max(len(x) for x in parts)
    size = max(min(segment, 2 * longest // (FEWEST_SEGMENTS + 1)) // 2 * 2, 8)
    powers, weight = np.zeros(size // 2), 0.0
    for x in parts:
        own = min(size, len(x))
        window = np.hanning(own + 1)[:-1]
        for start in range(0, len(x) - own + 1, max(own // 2, 1)):
            piece = x[start : start + own]
            powers += np.abs(np.fft.rfft((piece - piece.mean()) * window, size)[1:]) ** 2
            weight += float(np.sum(window**2))
    angle = 2.0 * np.pi * np.arange(1, size // 2 + 1) / size
    return Density(angle, powers / max(weight, 1e-300))


def bend(angle: Array) -> Array:
    """d = 2 - 2 cos w, the power gain of one difference."""
    return np.asarray(2.0 - 2.0 * np.cos(angle))


class SensorNoise(NamedTuple):
    """Noise of a measured acceleration: its density is `scale` times a shape that the kind of sensor sets.

    kind : "position" is differenced twice (d^2), "velocity" once (d); "d_hat" has passed Q, whose inverse gives
        ((1-p)^2 + p d) / (1-p)^2 with the pole p. scale : (rad/s2)^2 or (m/s2)^2. end : angle above which the log
        holds nothing, for u and motion passed a low-pass; pi where they did not. counted : where a position goes in
        counts, its density at equal steps of the angle up to pi, in units of that of white noise of `scale`.
    """

    kind: SensorKind
    pole: float
    scale: float
    end: float = math.pi
    counted: tuple[float, ...] = ()

    def density(self, angle: Array) -> Array:
        """Density of the noise, shape of `angle`."""
        return np.asarray(self.scale * self._shape(angle))

    def made(self, count: int, random: np.random.Generator) -> Array:
        """Noise of this kind, shape (count,)."""
        return self.of_white(random.normal(size=count + 2))

    def of_white(self, white: Array) -> Array:
        """What white noise of variance 1 on the channel, shape (n + 2,), adds to the acceleration, shape (n,)."""
        if self.kind == "position":
            found = np.diff(white, 2)
        elif self.kind == "velocity":
            found = np.diff(white)[1:]
        else:
            found = (white[2:] - self.pole * white[1:-1]) / (1.0 - self.pole)
        return np.asarray(np.sqrt(self.scale) * found)

    def _shape(self, angle: Array) -> Array:
        d = bend(angle)
        if self.counted:
            known = np.arange(1, len(self.counted) + 1) * (np.pi / len(self.counted))
            return d * d * np.interp(angle, known, self.counted)
        if self.kind == "position":
            return d * d
        if self.kind == "velocity":
            return d
        return (np.square(1.0 - self.pole) + self.pole * d) / np.square(1.0 - self.pole)


def sensor_noise(
    kind: SensorKind, accelerations: Sequence[Array], pole: float = 0.0, white: Sequence[Array] = (), ends: float = 0.0
) -> SensorNoise:
    """The noise of the sensor behind these accelerations, from where motion has ended in their spectrum.

    white : noise of variance 1, interpolated as the channel was; () if it was not. Less of it is left up there.
    ends : angle at which u ends; the log does not end below it.
    """
    unit, found = SensorNoise(kind, pole, 1.0), density(accelerations)
    top = POLICY.noise_from_share * math.pi
    end = math.pi if white else max(last_angle(found), ends)
    if end < top:  # a low-pass took the noise away: no more of it is known than that the band may reach up to there
        return unit._replace(scale=_read(unit, found, end / _WIDTH, end) / POLICY.signal_over_noise, end=end)
    scale = _read(unit, found, top)
    return unit._replace(scale=scale / (_read(unit, density([unit.of_white(x) for x in white]), top) if white else 1.0))


def last_angle(found: Density) -> float:
    """Angle up to which a signal holds anything: beyond it its density falls as no motion's does; pi if it does not.

    A jump of the acceleration has a density of w^-2, a jump of its slope w^-4, and what a sensor adds does not fall.
    A steeper fall, all the way to the top, is that of a low-pass, or of the side lobes of the window (w^-6) beside
    the lines of an exact motion: below a low-pass there is something for it to take.
    """
    edges, power = [math.pi], list[float]()
    while np.count_nonzero(inside := (found.angle > edges[-1] / _WIDTH) & (found.angle <= edges[-1])) >= _FEWEST_BINS:
        power.append(float(np.median(found.power[inside])))
        edges.append(edges[-1] / _WIDTH)
    steep = [not below < above * _WIDTH**_STEEP for above, below in pairwise(power)]
    first = steep.index(False) if False in steep else len(steep)
    if not power or power[0] == 0.0 or any(steep[first:][:_BROAD]) or len(steep) < first + _BROAD:
        return math.pi
    return edges[first + 1]


class Lost(NamedTuple):
    """What a low-pass took from the motion of a log; 0 where it passed none.

    speed : rms of what is missing, rad/s or m/s. way : on which a reversal is smeared, rad or m. reach : samples to
        either side over which it is: a quarter of the last period that is left. hz : the last frequency.
    """

    speed: float
    way: float
    reach: int
    hz: float


NOTHING_LOST = Lost(0.0, 0.0, 0, math.inf)


def lost_motion(accelerations: Sequence[Array], sample_time: float, end: float) -> Lost:
    """Above the last frequency that is left, jumps of the acceleration had a density that falls as w^-2. end : as in
    `SensorNoise`."""
    if end == math.pi:
        return NOTHING_LOST
    found = density(accelerations)
    inside = (found.angle >= end / _WIDTH) & (found.angle <= end)
    speed = sample_time * math.sqrt(float(np.median(found.power[inside])) / (3.0 * math.pi * end))
    reach, usual = math.ceil(0.5 * math.pi / end), math.sqrt(float(np.mean(np.concatenate(accelerations) ** 2)))
    return Lost(speed, 0.5 * usual * (reach * sample_time) ** 2, reach, end / (2.0 * math.pi * sample_time))


def _read(unit: SensorNoise, found: Density, low: float, high: float = math.pi) -> float:
    inside = (found.angle >= low) & (found.angle <= high)
    return float(np.median(found.power[inside] / unit.density(found.angle[inside])))


#: Samples of the speed that are compared; longer logs are averaged down to so many.
_SAMPLES = 20_000


def cycle_of(speed: Array, sample_time: float) -> float:
    """s after which a speed is about the same again, throughout; by its correlation with itself at each lag.

    Infinite where the motion does not repeat itself. What is a cycle later is the same again: so such a motion
    identifies no delay beyond it, and no line in time at one of its harmonics from a force that depends on the motion.
    A mean speed is the same at any time, and says nothing of that.
    """
    speed = speed - speed.mean()
    speed /= max(float(np.abs(speed).max(initial=0.0)), 1e-300)  # whose squares are numbers
    step = -(-len(speed) // _SAMPLES)
    speed = speed[: len(speed) // step * step].reshape(-1, step).mean(axis=1)
    most = int(len(speed) / POLICY.least_cycles)
    if most < 2 or not np.any(speed):
        return math.inf
    spectrum = np.fft.rfft(speed, 2 * len(speed))
    sums = np.fft.irfft(spectrum * np.conj(spectrum))[: most + 1]
    power = np.concatenate([[0.0], np.cumsum(speed**2)])
    ends = np.sqrt(power[-1 : -most - 2 : -1] * (power[-1] - power[: most + 1]))  # rms of both parts that are compared
    alike = sums / np.maximum(ends, 1e-300)
    gone = np.flatnonzero(alike < POLICY.cycle_left)
    if not gone.size:
        return math.inf
    later = alike[gone[0] :]
    again = later >= max(POLICY.cycle_alike, float(later.max()) - (1.0 - POLICY.cycle_alike))
    if not again.any():
        return math.inf
    first = int(np.argmax(again))
    last = first + int(np.argmin(np.append(again[first:], False)))
    lag = int(gone[0]) + first + int(np.argmax(later[first:last]))
    times = max((len(alike) - 1) // lag, 1)  # so many cycles later it is known to that part of a sample
    begin = times * lag - times // 2
    return (begin + int(np.argmax(alike[begin : times * lag + times // 2 + 1]))) / times * step * sample_time
