"""The discrete pieces that observer and prediction share: Q as a recursion, and means of the delayed u."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from dsd_cli.effects.memory import one_pole
from dsd_cli.signals.log import Array, Log

#: A delay this close to a whole number of samples, as a share of it, is that number: 0.3 / 0.001 is 299.99999999999994.
_WHOLE = 1e-9

#: Time constants after which Q has forgotten how it began: 0.7 % of that is left.
SETTLED = 5.0

#: Steps of the stamps that are within this share of T of the sample time are a regular clock, rounded when printed.
_REGULAR = 0.01


def lowpass(x: Array, pole: float, initial: float) -> Array:
    """Q of one pole: y_k = (1-p) x_k + p y_{k-1}, y_{-1} = initial; the same bits as that line in a loop.

    Parameters
    ----------
    x : shape (n,).
    pole : p = exp(-T / tau); 0 is no filter.
    initial : the value before the first sample, for carrying on from an earlier chunk.
    """
    return lowpass_irregular(x, np.full(len(x), pole), initial)


def lowpass_irregular(x: Array, poles: Array, initial: float) -> Array:
    """As `lowpass` with a pole of its own for every sample, p_k = exp(-T_k / tau), shape (n,)."""
    return one_pole(poles, (1.0 - poles) * x, initial)


def poles_of(intervals: Iterable[float], time_constant: float) -> Array:
    """p_k = exp(-T_k / tau), by math.exp: np.exp may differ in the last bit, and step and run must not.

    Where a stamp goes back, nothing passes.
    """
    if time_constant <= 0.0:
        return np.zeros(len(list(intervals)))
    intervals = list(intervals)
    pole = {interval: math.exp(-max(interval, 0.0) / time_constant) for interval in set(intervals)}  # few, as a rule
    return np.array([pole[interval] for interval in intervals], dtype=np.float64)


def delay_taps(delay: float, sample_time: float) -> tuple[int, float]:
    """L = (n + f) T: whole samples n and fraction f in [0, 1); `_kernel.c` has the same rule."""
    samples = delay / sample_time
    nearest = math.floor(samples + 0.5)
    if abs(samples - nearest) < _WHOLE * (1.0 + nearest):
        return nearest, 0.0
    return math.floor(samples), samples - math.floor(samples)


def delayed_mean(u: Array, delay: float, sample_time: float) -> Array:
    """Mean of the held u(t - L) over the interval that ends at each sample: (1-f) u_{k-1-n} + f u_{k-2-n}.

    Exact for any real L. u before the array is held at u_0. Shape (n,); entry k is the interval [t_{k-1}, t_k).
    """
    whole, fraction = delay_taps(delay, sample_time)
    if len(u) == 0:
        return np.array(u, dtype=np.float64)
    before = min(whole + 2, len(u) + 2)  # a longer delay reaches no sample
    held = np.concatenate([np.full(before, u[0]), u])
    newer = held[1 : 1 + len(u)]
    if fraction == 0.0:
        return newer
    return (1.0 - fraction) * newer + fraction * held[: len(u)]


def delayed_mean_irregular(u: Array, t: Array, delay: float) -> Array:
    """As `delayed_mean` over the true intervals of irregular stamps t, shape (n,); u is held between stamps.

    The mean is a difference of the integral of u, which is piecewise linear; before t_0 u is held at u_0.
    """
    if len(u) < 2:
        return np.array(u, dtype=np.float64)
    steps = np.diff(t)
    integral = np.concatenate([[0.0], np.cumsum((u[:-1] - u[0]) * steps)])  # of u - u_0: 0 before the log
    shifted = np.interp(t - delay, t, integral)
    means = u[0] + np.diff(shifted) / steps
    return np.concatenate([[u[0]], means])


def irregular_stamps(log: Log) -> Array | None:
    """The stamps of a log whose clock jitters, shape (n,); None for a regular clock."""
    if "t" not in log or len(log) < 2:
        return None
    t = log["t"]
    allowed = _REGULAR * log.sample_time + 4 * np.finfo(float).eps * float(np.abs(t).max())
    return t if bool(np.any(np.abs(np.diff(t) - log.sample_time) > allowed)) else None


def two_interval_mean(x: Array, intervals: Array) -> Array:
    """Mean over the last two intervals, weighted by their lengths (aperture 2); the first two samples stay."""
    mean = x.copy()
    if len(x) > 2:
        now, before = intervals[2:], intervals[1:-1]
        mean[2:] = (now * x[2:] + before * x[1:-1]) / (now + before)
    return mean
