"""The spectrum of what a complete balance of forces leaves, and the filter that makes it white.

    S(w) = F + J^2 N_a(w),      F, J^2 >= 0

N_a is the noise of the measured acceleration, whose shape the sensor sets; F is what forces do that no model follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dsd_cli.identify.fit.band import Band
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.spectrum import SensorNoise, density
from dsd_cli.signals.log import Array

#: Rows of a segment of the periodogram; rounds of the multiplicative update, each of which lowers the cost.
_SEGMENT, _ROUNDS = 128, 200
#: Parts of a spectrum that are alike if it is flat; the largest of noise, in units of its rms (spikes are none).
_PARTS, _CREST = 4, 8.0
#: Half length of the whitening filter, rows, and frequencies at which its response is specified.
HALF, _POINTS = 12, 256


class ForceNoise(NamedTuple):
    """Levels of the two parts of S: `flat` is F of samples, `sensor` is J^2 as residuals show it; unit of u squared."""

    flat: float
    sensor: float

    def density(self, band: Band, noise: SensorNoise, row_angles: Array) -> Array:
        """That of rows, of which one stands for so many samples, at their angles."""
        return np.asarray((self.flat + self.sensor * noise.density(row_angles / band.step)) / band.step)


def fitted_noise(parts: Sequence[tuple[Sequence[Array], Band, SensorNoise]]) -> ForceNoise:
    """The two levels, from (rows that a fit leaves, not whitened, by stretch; band; sensor's noise) of each log.

    The forces that no model follows, and J, are those of the axis: a log in which it hardly moves shows less of them,
    and is not the surer for it.
    """
    powers, shapes, rows = [], [], []
    for residual, band, noise in parts:
        found = density(residual, _SEGMENT)
        inside = found.angle <= end_of(band)
        angle, gain = found.angle[inside], band.gain(found.angle[inside]) ** 2
        powers.append(np.maximum(band.step * found.power[inside] / gain, 1e-300))
        shapes.append(np.stack([np.ones(len(angle)), np.maximum(noise.density(angle / band.step), 1e-300)]))
        rows.append(np.full(len(angle), sum(len(x) for x in residual) / len(angle)))
    power, shape, weight = np.concatenate(powers), np.concatenate(shapes, axis=1), np.concatenate(rows)
    levels = 0.5 * np.average(power, weights=weight) / np.average(shape, axis=1, weights=weight)
    for _ in range(_ROUNDS):
        inverse = 1.0 / (levels @ shape)
        levels = levels * np.sqrt((shape @ (weight * power * inverse**2)) / (shape @ (weight * inverse)))
    return ForceNoise(float(levels[0]), float(levels[1]))


def end_of(band: Band) -> float:
    """Angle of rows at the end of the band."""
    return 2.0 * np.pi * band.hz * band.step * band.sample_time


def whitening(levels: ForceNoise, band: Band, noise: SensorNoise) -> Array:
    """Impulse response over rows, shape (2 HALF + 1,), symmetric, with |W|^2 = 1 / S within the band."""
    angle = band.angles(_POINTS)
    s = levels.density(band, noise, np.minimum(angle, end_of(band)))
    s = np.maximum(s, POLICY.flattest * float(np.mean(s)))
    response = 1.0 / np.sqrt(s)
    k = np.arange(-HALF, HALF + 1)
    taps = np.cos(np.outer(k, angle)) @ response / _POINTS
    return np.asarray(taps * (0.5 + 0.5 * np.cos(np.pi * k / (HALF + 1))))


def response(taps: Array, row_angles: Array) -> Array:
    """Frequency response of symmetric taps."""
    k = np.arange(len(taps)) - len(taps) // 2
    return np.asarray(np.cos(np.outer(row_angles, k)) @ taps)


def passed_variance(taps: Array, band: Band, noise: SensorNoise) -> float:
    """Variance that the sensor's noise leaves in a row of the acceleration, after low-pass and these taps."""
    angle = band.angles(_POINTS)
    # the low-pass is not perfect: what folds back from above half the rate of rows is counted by its own angle
    fold = np.arange(band.step)[:, None]
    true = fold * np.pi + np.where(fold % 2 == 0, angle, np.pi - angle)
    total = np.sum(band.folded_gain(_POINTS) ** 2 * noise.density(true / band.step), axis=0)
    return float(np.mean(total * response(taps, angle) ** 2) / band.step)


def structured_share(residual: Sequence[Array], band: Band) -> float:
    """Share of the power of these rows (not whitened) that stands above any non-decreasing spectrum.

    That share is no measuring noise: what sensors add to a force rises with frequency or is flat.
    """
    power = _in_band(residual, band)
    if not power.sum() > 0.0:
        return 0.0
    count = max(len(power) // 4, 1)
    bands = np.array([part.mean() for part in np.array_split(power, count)])
    floor = np.minimum.accumulate(bands[::-1])[::-1]
    return float(np.maximum(bands - POLICY.stands_out * floor, 0.0).sum() / bands.sum())


def white_to_the_end(residual: Sequence[Array], band: Band, u: Sequence[Array]) -> bool:
    """Whether these rows (not whitened) are white in the band, as no law of the motion is, and u is nearly as strong
    above it, up to half the sample rate: nearer to what is left than to what it is in the band, for noise that a slower
    logger folds down is not flat. A u that is white itself is stronger: what a law of it leaves is white as well."""
    power, found = _in_band(residual, band), density(u)
    higher = found.angle > 2.0 * end_of(band) / band.step
    above, below = found.power[higher], found.power[~higher]
    if not power.sum() > 0.0 or min(len(power), len(above)) < _PARTS:
        return False
    bends = np.abs(np.concatenate([np.diff(x, 2) for x in u]))
    if float(bends.max()) > _CREST * float(np.sqrt(np.mean(bends**2))):  # spikes
        return False
    inside, beyond = ([part.mean() for part in np.array_split(x, _PARTS)] for x in (band.step * power, above))
    level = float(np.mean(inside))
    white = max(inside) < POLICY.stands_out * level < POLICY.stands_out**2 * min(*inside, *beyond)
    return bool(white and max(beyond) ** 2 < level * float(below.mean()))


def _in_band(residual: Sequence[Array], band: Band) -> Array:
    """Density of rows at the angles within the band, as before the low-pass; zeros where they are too few."""
    found = density(residual, _SEGMENT)
    inside = found.angle <= end_of(band)
    enough = sum(len(x) for x in residual) >= POLICY.least_segments * _SEGMENT / 2
    return np.asarray(enough * found.power[inside] / band.gain(found.angle[inside]) ** 2)
