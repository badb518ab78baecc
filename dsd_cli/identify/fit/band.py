"""The band in which forces are balanced, as far up as the acceleration stands above its sensor's noise; and the
spectrum of what a complete balance leaves in it, with the filter that makes that white.

    S(w) = F + J^2 N_a(w),      F, J^2 >= 0

N_a is the noise of the measured acceleration, whose shape the sensor sets; F is what forces do that no model follows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.recordings.spectrum import SensorNoise, density
from dsd_cli.signals.log import Array
from dsd_cli.signals.once import once
from dsd_cli.signals.passes import every

#: Rows per second by the band's end: the low-pass falls from the end of the band to twice that, so that what folds back
#: stays out of the band.
ROWS_PER_BAND_HZ = 3.0
#: Kaiser window of the low-pass: 53 dB; its half width, in periods of the band's end.
_SHAPE, _HALF_PERIODS = 5.0, 1.6
#: Neighbouring frequencies over which the ratio of signal and noise is averaged, as a share of the frequency.
_AVERAGED = 0.1
_CHUNK = 4096
#: Share of the fastest log's rms speed from which on another is as fast.
_FAST = 0.5


@dataclass(frozen=True)
class Band:
    """A low-pass without phase, and every how many samples a row is taken of what passes it.

    hz : end of the band.
    step : samples from row to row.
    taps : impulse response, shape (2 half + 1,), symmetric, sum 1.
    """

    hz: float
    step: int
    taps: Array
    sample_time: float

    @property
    def half(self) -> int:
        """Samples that a row reaches to either side."""
        return len(self.taps) // 2

    def centres(self, first: int, count: int) -> NDArray[np.int_]:
        """Samples at which rows stand that reach neither before `first` nor beyond `count`."""
        return np.arange(first + self.half, count - self.half, self.step)

    def rows(self, x: Array, first: int) -> Array:
        """x of shape (n,) low-passed at `centres`."""
        return every(x[first:], self.taps, self.step, max(-((first + 2 * self.half - len(x)) // self.step), 0))

    def angles(self, count: int) -> Array:
        """`count` angles of rows, w = 2 pi f step T in (0, pi)."""
        return np.asarray((np.arange(count) + 0.5) * np.pi / count)

    @once
    def folded_gain(self, count: int) -> Array:
        """|H| at all angles of samples that fold onto `angles(count)` of rows, shape (step, count), by one transform.

        Row i of the result: between i pi and (i + 1) pi, w = 2 pi f step T.
        """
        size = count * self.step
        half_a_bin = np.exp(-0.5j * np.pi / size * np.arange(len(self.taps)))
        found = np.abs(np.fft.fft(self.taps * half_a_bin, 2 * size)[:size]).reshape(self.step, count)
        found[1::2] = found[1::2, ::-1]
        return np.asarray(found)

    def gain(self, row_angles: Array) -> Array:
        """|H| at angles of rows."""
        k = np.arange(-self.half, self.half + 1)
        return np.asarray(np.abs(np.cos(np.outer(row_angles / self.step, k)) @ self.taps))


def band_of(hz: float, sample_time: float) -> Band:
    """The low-pass that ends there."""
    rate = 1.0 / sample_time
    half = max(int(np.ceil(_HALF_PERIODS * rate / hz)), 1)
    k = np.arange(-half, half + 1)
    taps = np.sinc(2.0 * 1.5 * hz * sample_time * k) * np.kaiser(len(k), _SHAPE)
    return Band(hz, max(int(rate / (ROWS_PER_BAND_HZ * hz)), 1), taps / taps.sum(), sample_time)


def chosen_band(accelerations: Sequence[Array], noise: SensorNoise, sample_time: float) -> Band:
    """The widest band over whose end the acceleration stands above the sensor's noise.

    accelerations : as measured, of every stretch; `noise` : the sensor's.
    """
    duration = telling_length([(accelerations, noise)]) * sample_time
    found = density(accelerations)
    allowed = found.angle <= 2.0 * np.pi * POLICY.highest_share
    angle, power = found.angle[allowed], found.power[allowed]
    ratio = power / np.maximum(noise.density(angle), 1e-300)
    sums = np.concatenate([[0.0], np.cumsum(ratio)])
    index = np.arange(len(ratio))
    reach = np.maximum((_AVERAGED * index).astype(int), 1)
    low, high = np.maximum(index - reach, 0), np.minimum(index + reach + 1, len(ratio))
    above = np.flatnonzero((sums[high] - sums[low]) / (high - low) > POLICY.signal_over_noise)
    end = angle[above[-1]] if above.size else angle[0]
    least = max(POLICY.least_band_hz, POLICY.least_band_periods / duration)
    return band_of(
        min(max(float(end) / (2.0 * np.pi * sample_time), least), POLICY.highest_share / sample_time), sample_time
    )


def telling_length(logs: Sequence[tuple[Sequence[Array], SensorNoise]]) -> int:
    """Samples of a stretch in which the axis accelerates: half of the squares of (accelerations, sensor's noise) of all
    logs, beyond that noise, are in stretches no longer than this. Of tests in pieces the longest are slow ramps."""
    lengths, squares = [], []
    for accelerations, noise in logs:
        of_sensor = float(np.mean(noise.density(np.linspace(0.0, np.pi, _CHUNK))))
        lengths += [len(x) for x in accelerations]
        squares += [max(float(x @ x) - len(x) * of_sensor, 0.0) for x in accelerations]
    order = np.argsort(lengths)
    sums = np.cumsum(np.array(squares)[order])
    return lengths[order[np.searchsorted(sums, 0.5 * sums[-1])]] if sums[-1] > 0.0 else max(lengths)


def own_band(recording: Recording) -> Band:
    """The band that its sensor and its motion allow."""
    return chosen_band([p["acceleration"] for p in recording.pieces], recording.sensor.noise, recording.sample_time)


def own_bands(recordings: Sequence[Recording]) -> list[Band]:
    """Of each recording its own, but no wider than those of the ones that move fast: in a crawl the counts of an
    encoder, a line at their rate, look like motion."""
    bands = [own_band(r) for r in recordings]
    speeds = [math.sqrt(float(np.mean(np.concatenate([p["velocity"] for p in r.pieces]) ** 2))) for r in recordings]
    widest = max(b.hz for b, v in zip(bands, speeds, strict=True) if v >= _FAST * max(speeds))
    return [band if band.hz <= widest else band_of(widest, band.sample_time) for band in bands]


def nearest_bands(bands: Sequence[Band], recordings: Sequence[Recording]) -> list[Band]:
    """Bands in which recordings that no fit saw are judged: of those of the fit the ones nearest to their own."""

    def nearest(recording: Recording) -> Band:
        own = own_band(recording).hz
        return min(bands, key=lambda band: abs(math.log(band.hz / own)))

    return [nearest(r) if len(bands) > 1 else bands[0] for r in recordings]


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
