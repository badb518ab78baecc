"""The band in which forces are balanced: as far up as the acceleration stands above its sensor's noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

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
