"""How far up in frequency a sensor shows the acceleration: signal against noise, from the log itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from dsd_cli.identify.checks.stretches import Stretch
from dsd_cli.identify.recordings.smoothing import noise_of
from dsd_cli.signals.encoder import encoder_step
from dsd_cli.signals.log import Array

Source = Literal["position", "velocity"]

#: Within the band the noise of the acceleration is at most this share of its power: it biases an inertia by as much.
NOISE_SHARE = 0.02
#: And the last third of an octave of the band still holds this many times the power of the noise.
LOCAL_RATIO = 4.0
#: The band never goes beyond this share of the sample rate: differences of samples are no derivatives there.
HIGHEST = 0.15
#: The velocity is taken where its band is so many times wider.
_CLEARLY = 1.3
#: Seconds of a segment of the spectrum, and its bounds in samples.
_SEGMENT, _SHORTEST, _LONGEST = 4.0, 64, 8192
#: A channel that changes in less than this share of the samples is coarse.
_RARE = 0.02
#: The noise is looked for above this share of the sample rate.
_NOISE_ABOVE = 0.04


@dataclass(frozen=True)
class Band:
    """What one sensor shows of the acceleration.

    source : the channel that is differentiated.
    cutoff : Hz, end of the band.
    noise : standard deviation of the channel's noise, taken as white; its unit.
    step : of the encoder; 0 if the channel is not quantised.
    acceleration, acceleration_noise : rms within the band, rad/s2 or m/s2.
    speed_noise : standard deviation of the speed within the band, rad/s or m/s.
    """

    source: Source
    cutoff: float
    noise: float
    step: float
    acceleration: float
    acceleration_noise: float
    speed_noise: float


def find_band(stretches: Sequence[Stretch]) -> Band | None:
    """That of the position, unless the velocity shows clearly more; None if neither shows any acceleration.

    A velocity is often the position's own difference, half a sample late, or filtered.
    """
    position, velocity = _band(stretches, "position"), _band(stretches, "velocity")
    if position is None or velocity is None:
        return position or velocity
    return velocity if velocity.cutoff > _CLEARLY * position.cutoff else position


def difference(x: Array, T: float, source: Source) -> Array:
    """Acceleration at each sample by differences of the samples beside it; 0 at both ends."""
    a = np.zeros(x.size)
    if source == "position":
        a[1:-1] = (x[2:] - 2.0 * x[1:-1] + x[:-2]) / T**2
    else:
        a[1:-1] = (x[2:] - x[:-2]) / (2.0 * T)
    return a


def _band(stretches: Sequence[Stretch], source: Source) -> Band | None:
    channels = [x for s in stretches if (x := getattr(s, source)) is not None]
    if not channels or not any(np.ptp(x) > 0.0 for x in channels):
        return None
    T = stretches[0].T
    f, power = _spectrum([difference(x, T, source) for x in channels], T)
    gain = _gain(f, T, source)
    step = max(encoder_step(x) or _rare_step(x) for x in channels)
    level = 2.0 * T * (step * step) / 12.0  # of a huge step infinite: nothing is seen
    if step == 0.0:  # each sees some signal as noise: the spectrum jumps, the high differences smooth motion
        rms = max(noise_of(x) for x in channels)
        level = min(_white_level(f, power, gain, T), 2.0 * T * (rms * rms))
    noise = level * gain
    cutoff = _cutoff(f, power, noise, T)
    if cutoff is None:
        return None
    inside, width = f <= cutoff, f[1]
    to_speed = (2.0 * np.pi * f[inside]) ** 2 if source == "position" else np.ones(int(inside.sum()))
    return Band(
        source,
        cutoff,
        float(np.sqrt(level / (2.0 * T))),
        step,
        float(np.sqrt(np.sum(power[inside]) * width)),
        float(np.sqrt(np.sum(noise[inside]) * width)),
        float(np.sqrt(level * np.sum(to_speed) * width)),
    )


def _rare_step(x: Array) -> float:
    """The step of a channel that hardly ever changes: so coarse that it is quantised whatever its steps are."""
    changes = np.abs(np.diff(x))
    changes = changes[changes > 0.0]
    return float(changes.min()) if 0 < changes.size < _RARE * x.size else 0.0


def _spectrum(channels: Sequence[Array], T: float) -> tuple[Array, Array]:
    """(Hz, power density) by Hann windows that overlap by half, averaged over all channels."""
    longest = max(x.size for x in channels)
    size = int(np.clip(_SEGMENT / T, _SHORTEST, min(_LONGEST, max(longest // 4, _SHORTEST))))
    size = min(size, longest)
    window = np.hanning(size + 2)[1:-1]
    total, count = np.zeros(size // 2 + 1), 0
    for x in channels:
        if x.size >= size:
            segments = np.lib.stride_tricks.sliding_window_view(x, size)[:: max(size // 2, 1)]
            total += np.sum(np.abs(np.fft.rfft(window * segments)) ** 2, axis=0)
            count += len(segments)
    density = total * 2.0 * T / (max(count, 1) * np.sum(window**2))
    return np.asarray(np.fft.rfftfreq(size, T), dtype=np.float64), density


def _gain(f: Array, T: float, source: Source) -> Array:
    """Power gain of `difference` for white noise of the channel."""
    w = 2.0 * np.pi * f * T
    return (2.0 - 2.0 * np.cos(w)) ** 2 / T**4 if source == "position" else np.sin(w) ** 2 / T**2


def _white_level(f: Array, power: Array, gain: Array, T: float) -> float:
    """Density of white noise on the channel: what the quietest stretch of the upper spectrum allows."""
    levels = [float(np.mean(power[low:high]) / np.mean(gain[low:high])) for low, high in _octaves(f, _NOISE_ABOVE / T)]
    return min(levels, default=0.0)


def _octaves(f: Array, above: float) -> list[tuple[int, int]]:
    """Thirds of octaves from there up to 0.45 of the sample rate, as slices."""
    top, edges = 0.9 * f[-1], [max(above, f[1])]
    while edges[-1] < top:
        edges.append(max(edges[-1] * 2.0 ** (1.0 / 3.0), edges[-1] + 2.0 * f[1]))
    at = np.searchsorted(f, np.minimum(edges, top))
    return [(a, b) for a, b in pairwise(at.tolist()) if b > a]


def _cutoff(f: Array, power: Array, noise: Array, T: float) -> float | None:
    """Hz; None where the noise is above the limits from the lowest frequencies on."""
    if not power[1:].sum() > 0.0:
        return None
    highest = HIGHEST / T
    share = np.cumsum(noise[1:]) / np.maximum(np.cumsum(power[1:]), 1e-30 * power[1:].sum())
    allowed = np.flatnonzero((share <= NOISE_SHARE) & (f[1:] <= highest))
    octaves = _octaves(f, f[1])
    clear = [f[b - 1] for a, b in octaves if power[a:b].sum() > LOCAL_RATIO * noise[a:b].sum()]
    if allowed.size == 0 or not clear:
        return None
    return float(min(f[1 + allowed[-1]], max(clear), highest))
