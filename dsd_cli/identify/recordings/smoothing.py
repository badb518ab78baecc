"""A log on a regular clock, for all that follows counts in samples; and smoothing without phase that removes no more
than the noise of the channel explains (discrepancy principle).

On irregular stamps position and speed are taken from a cubic spline through the samples, and the command from its
integral, which is exact. A spline takes off the highest frequencies of white noise a quarter and more, and those are
where noise is read. So a synthetic noise goes the same way, as "white" of the log: what is lost of it is lost of the
sensor's.

The local cubics are own code: `scipy.signal.savgol_filter` knows no irregular stamps, and its import takes 1 s of CPU,
forty times what they cost on 20 s at 1 kHz.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.policy import POLICY
from dsd_cli.plant.filtering import irregular_stamps
from dsd_cli.signals.encoder import encoder_step
from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.passes import passed
from dsd_cli.signals.spread import rms, robust_deviation

#: Mean of a smooth signal over the interval between the inner two of six samples (exact for quintics: by cubics through
#: four it is 0.5 % less at an eighth of the sample rate, and near a resonance J a and a spring leave 20 times u).
MEAN_OF_SIX = np.array([11.0, -93.0, 802.0, 802.0, -93.0, 11.0]) / 1440.0
#: u as it was sampled: what the maker of a logged d_hat has put into it.
SAMPLED_U = "sampled_u"
#: Seed of the white noise that is interpolated as the channels are.
_SEED = 20261122
#: Slope of the polynomial through seven samples; a difference of two is 10 % less at an eighth of the sample rate.
_SLOPE_OF_SEVEN = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
#: Half widths that are tried, samples; 0 leaves the channel as it is.
HALF_WIDTHS = (0, 2, 3, 4, 6, 8, 11, 15, 20, 28)
#: Steps of the stamps that differ by less than this share are a regular clock, rounded when printed.
_REGULAR = 0.02
#: Share of the noise up to which a change between samples is none: a spline ripples around an encoder at rest.
_RESTING = 1e-3
_ORDER = 3
#: Rows that move, at least.
_FEWEST = 10
#: The widest window is this part of the channel.
_WIDEST_PART = 4
#: Differences of these orders remove what is smooth and leave white noise, amplified by a known factor; what is not
#: smooth only adds, so that the smallest answer is the best.
_DIFFERENCES = (2, 4, 6)


@dataclass(frozen=True)
class Smoothed:
    """A channel and its slope, shape (n,) each, with the standard deviation of the noise that is left in them.

    sharp : a slope for forces that a fast motion makes, where nothing is smoothed; beside a stop it is not 0.
    value_noise, slope_noise : in the widest window; value_spread, slope_spread : in that of each sample, shape (n,).
    """

    value: Array
    slope: Array
    half_width: int
    value_noise: float
    slope_noise: float
    value_spread: Array
    slope_spread: Array
    sharp: Array | None = None


class ChannelNoise(NamedTuple):
    """size : standard deviation of white noise on a channel. quantised : it is that of an encoder's steps."""

    size: float
    quantised: bool


def channel_noise(x: Array, logged: Array | None = None, white: Array | None = None) -> ChannelNoise:
    """The noise of a channel.

    x : shape (n,). logged, white : where x was interpolated, the channel as it was, shape (m,), and white noise of
        variance 1 that was interpolated alike, shape (n,): neither steps nor highest frequencies are left in x.
    """
    quantised = encoder_step(x if logged is None else logged) > 0.0
    if logged is None or white is None:
        return ChannelNoise(noise_of(x), quantised)
    return ChannelNoise(noise_of(logged) if quantised else noise_of(x) / noise_of(white), quantised)


def smooth(x: Array, t: Array, known: ChannelNoise | None = None) -> Smoothed:
    """Local cubics over the widest window that takes out no more than noise.

    x, t : shape (n,); t in s may be irregular. known : None reads the noise from x.
    """
    noise, quantised = known or channel_noise(x)
    stamps = _Stamps.of(t)
    found = _Adapted(x, stamps, noise)
    chosen, least = 0, POLICY.noise_misjudged
    moving = _moving(x, noise) if noise > 0.0 else None
    for half in HALF_WIDTHS[1:]:
        if 2 * half + 1 > len(x) // _WIDEST_PART or moving is None:
            break
        candidate, slope = _local(x, stamps, half)
        removed = (x - candidate)[moving]
        size = (rms(removed) if quantised else robust_deviation(removed)) / (noise * _kept(half))
        if size > POLICY.smoothing_growth * least:
            break
        chosen, least = half, min(least, max(size, 1.0))
        found.widen(half, candidate, slope)
    value_noise = _spread(chosen, 0, noise, stamps) if chosen else noise
    slope_noise = _spread(max(chosen, 1), 1, noise, stamps)
    exact = not chosen and stamps.regular
    sharp = np.convolve(extended(x, 3), _SLOPE_OF_SEVEN[::-1], mode="valid") / stamps.step if exact else None
    spreads = found.spreads, found.slope_spreads
    return Smoothed(found.value, found.slope, chosen, value_noise, slope_noise, *spreads, sharp)


class _Stamps(NamedTuple):
    """t in s, shape (n,), the usual step, and whether all are that."""

    t: Array
    step: float
    regular: bool

    @classmethod
    def of(cls, t: Array) -> _Stamps:
        steps = np.diff(t)
        step = float(np.median(steps))
        return cls(t, step, bool(np.ptp(steps) < _REGULAR * step))


class _Adapted:
    """Value and slope in the widest window that the noise allows at every sample, and the standard deviations of the
    noise in both; shape (n,) each.

    Around a sudden change, wider windows differ from narrower ones by more than noise; there they end (the rule of
    intersecting confidence intervals).
    """

    def __init__(self, x: Array, stamps: _Stamps, noise: float) -> None:
        self._stamps, self._noise = stamps, noise
        self._alive = np.ones(len(x), dtype=bool)
        self._last = noise, _spread(1, 1, noise, stamps)
        self.value, self.slope = x, _local(x, stamps, 1)[1]
        self.spreads, self.slope_spreads = (np.full(len(x), spread) for spread in self._last)

    def widen(self, half: int, wider: Array, wider_slope: Array) -> None:
        """To this half width, where it may; value and slope in such windows, shape (n,) each."""
        strange = np.abs(wider - self.value) > POLICY.windows_agree * self._last[0]
        strange |= np.abs(wider_slope - self.slope) > POLICY.windows_agree * self._last[1]
        self._alive &= ~widened(strange, half)
        alive, noise = self._alive, self._noise
        self._last = _spread(half, 0, noise, self._stamps), _spread(half, 1, noise, self._stamps)
        self.value, self.slope = np.where(alive, wider, self.value), np.where(alive, wider_slope, self.slope)
        self.spreads, self.slope_spreads = (
            np.where(alive, spread, old)
            for spread, old in zip(self._last, (self.spreads, self.slope_spreads), strict=True)
        )


def _spread(half: int, derivative: int, noise: float, stamps: _Stamps) -> float:
    """Standard deviation that the noise leaves in a value (0) or slope (1)."""
    return noise * float(np.sqrt(np.sum(_weights(half, derivative) ** 2))) / stamps.step**derivative


def widened(marks: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """True up to `reach` samples beside every mark."""
    sums = np.cumsum(np.concatenate([np.zeros(reach + 1), marks, np.zeros(reach)]))
    return np.asarray(sums[2 * reach + 1 :] > sums[: -(2 * reach + 1)])


def noise_of(x: Array) -> float:
    """Standard deviation of the noise of a channel: of an encoder's steps, else of its high differences."""
    step = encoder_step(x)
    if step > 0.0:
        return step / float(np.sqrt(12.0))
    if len(x) <= max(_DIFFERENCES):
        return 0.0
    return min(robust_deviation(np.diff(x, m)) / math.sqrt(math.comb(2 * m, m)) for m in _DIFFERENCES)


def _moving(x: Array, noise: float) -> Array:
    """Rows where the channel changes: an encoder at rest shows no quantisation noise (interpolated, hardly any)."""
    moving = np.ones(len(x), dtype=bool)
    moving[1:] = np.abs(np.diff(x)) > _RESTING * noise
    return moving if moving.sum() > _FEWEST else np.ones(len(x), dtype=bool)


def _local(x: Array, stamps: _Stamps, half: int) -> tuple[Array, Array]:
    """Value and slope (per s) of local polynomials at every sample, in the true stamps; shape (n,) each."""
    t, step, regular = stamps
    windows, padded_x = 2 * half + 1, extended(x, half)
    if regular:
        value, slope = (np.convolve(padded_x, _weights(half, d)[::-1], mode="valid") for d in (0, 1))
        return value, slope / step
    padded_t = extended(t, half)
    view = np.lib.stride_tricks.sliding_window_view
    tau = (view(padded_t, windows) - t[:, None]) / step
    order = min(_ORDER, 2 * half)
    powers = tau[..., None] ** np.arange(order + 1)
    gram = np.einsum("nwi,nwj->nij", powers, powers)
    moments = np.einsum("nwi,nw->ni", powers, view(padded_x, windows))
    fitted = np.linalg.solve(gram, moments[..., None])[..., 0]
    return fitted[:, 0], fitted[:, 1] / step


def extended(x: Array, half: int) -> Array:
    """The ends continued by point reflection."""
    return np.concatenate([2.0 * x[0] - x[half:0:-1], x, 2.0 * x[-1] - x[-2 : -half - 2 : -1]])


@cache
def _weights(half: int, derivative: int) -> Array:
    """Least-squares weights of a local polynomial at its centre (Savitzky-Golay), shape (2 half + 1,)."""
    k = np.arange(-half, half + 1, dtype=np.float64)
    order = min(_ORDER, 2 * half)
    return np.asarray(np.linalg.pinv(np.vander(k, order + 1, increasing=True))[derivative])


def _kept(half: int) -> float:
    """Share of white noise that a smoothing of this width takes out, as rms."""
    return float(np.sqrt(max(1.0 - _weights(half, 0)[half], 0.0)))


def regularised(piece: Log) -> Log:
    """The piece on a regular clock, u its mean from each sample to the next; with "white" where it was interpolated,
    and with `SAMPLED_U` where u was measured and d_hat logged."""
    stamps = irregular_stamps(piece)
    if piece.u_hold == "sampled":
        own = {SAMPLED_U: piece["u"]} if "d_hat" in piece else {}
        piece = replace(piece, channels={**piece.channels, **own, "u": passed(piece["u"], MEAN_OF_SIX, 2)})
    if stamps is None:
        return piece
    from scipy.interpolate import CubicSpline

    step = float(stamps[-1] - stamps[0]) / max(round((stamps[-1] - stamps[0]) / piece.sample_time), 1)
    grid = stamps[0] + step * np.arange(int((stamps[-1] - stamps[0]) / step * (1.0 + 1e-12)) + 1)
    kept = {name: x for name, x in piece.channels.items() if name not in ("t", "u")}
    kept["white"] = np.random.default_rng(_SEED).normal(size=len(stamps))
    channels = {name: CubicSpline(stamps, x)(grid) for name, x in kept.items()}
    channels |= {"t": grid, "u": mean_held(piece["u"], stamps, np.append(grid, grid[-1] + step))}
    return replace(piece, channels=channels, sample_time=step)


def mean_held(u: Array, stamps: Array, edges: Array) -> Array:
    """Mean of a u that is held between stamps, over the intervals between edges."""
    steps = np.diff(stamps)
    integral = np.concatenate([[0.0], np.cumsum(u[:-1] * steps)])
    ends = np.append(stamps, max(edges[-1], stamps[-1]) + steps[-1])
    integral = np.append(integral, integral[-1] + u[-1] * (ends[-1] - stamps[-1]))
    return np.asarray(np.diff(np.interp(edges, ends, integral)) / np.diff(edges))
