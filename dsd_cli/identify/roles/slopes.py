"""Which channel is the slope of another: a velocity beside its position, in whatever units, and how late it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dsd_cli.signals.log import Array

#: Samples over which both are averaged, one after the other: an encoder's steps ask for more.
SPANS = (1, 3, 9, 27, 81)
#: Windows of that span that a log must have.
FEWEST = 30
#: Longest lag that is looked for, samples.
LAGS = 40
#: A longer average is the better one from this much more of the square on.
BETTER_SLOPE = 1e-3
#: No axis goes through more than this share of its travel from one row to the next: there its position wraps.
WRAPS = 0.5


class Slope(NamedTuple):
    """w = scale * dp/dt, delayed by `lag` samples; `share` of w's square it explains, `span` samples averaged over."""

    scale: float
    share: float
    lag: int
    span: int


def slope_of(t: Array, p: Array, w: Array) -> Slope:
    """How well `w` is the slope of `p`: over spans of samples the mean of w is the increase of p by their length.

    Parameters
    ----------
    t : s (or any unit: the scale is per that), rising, shape (n,); p, w : finite, shape (n,).
    """
    best = Slope(0.0, 0.0, 0, 1)
    p = _unwrapped(p)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(t))])
    for span in SPANS:
        if t.size < FEWEST * span:
            break
        length = t[span:] - t[:-span]
        slope = (p[span:] - p[:-span]) / length
        mean = (area[span:] - area[:-span]) / length
        lag = lag_of(slope, mean, LAGS)
        a, b = (slope[: slope.size - lag], mean[lag:]) if lag >= 0 else (slope[-lag:], mean[:lag])
        power, own = float(a @ a), float(b @ b)
        if power <= 0.0 or own <= 0.0:
            continue
        scale = float(a @ b) / power
        share = scale * float(a @ b) / own
        if share > best.share + BETTER_SLOPE:
            best = Slope(scale, share, lag, span)
    return best


def _unwrapped(p: Array) -> Array:
    """The same with the steps of the rows around it where it wraps, or where a value is none of the axis's."""
    steps = np.diff(p)
    far = np.abs(steps) > WRAPS * np.ptp(p)
    if far.all():
        return p
    steps[far] = np.interp(np.flatnonzero(far), np.flatnonzero(~far), steps[~far])
    return np.concatenate([p[:1], p[0] + np.cumsum(steps)])


def lag_of(x: Array, y: Array, longest: int) -> int:
    """By how many samples y comes after x, at most `longest`: where they are most alike."""
    size = 1 << int(np.ceil(np.log2(2 * x.size)))
    across = np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)
    most = min(longest, x.size // 8)
    lags = np.r_[0 : most + 1, -most:0]
    return int(lags[int(np.argmax(np.abs(across[lags])))])
