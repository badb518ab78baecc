"""The likelihood of the delay with the best inertia at every delay, and what it says about both.

Model of a window (docs/how/beyond.md): y = alpha z(L) + noise, with alpha = Jn / J. u is held between samples, so
that z is exactly linear between two delays a sample apart: z(L + f T) = z + f D with D = z(L + T) - z(L). Delay and
inertia are thus a linear regression of y on (z, D), solved in closed form.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.signals.log import Array

#: Below this share of |z|^2 what tells the delay apart is rounding.
ROUNDING = 1e-11


class Sums(NamedTuple):
    """Sums over the windows that end at n samples.

    yy, votes : shape (n,); votes is how many samples voted.
    zz, zy : of z z and z y, shape (n, G, E): per delay and combination of effect values.
    adjacent : of z(L) z(L + T), shape (n, G - 1, E).
    """

    yy: Array
    votes: Array
    zz: Array
    zy: Array
    adjacent: Array


class Fit(NamedTuple):
    """The best delay and alpha per sample, and all that the data do not exclude; shapes (n,) unless said otherwise.

    Attributes
    ----------
    lag, lag_std : delay in steps above the first of the lattice; infinite std where the window says nothing of it.
    alpha, alpha_std : Jn / J.
    combination : index of the effect values.
    square : residual sum of squares at the best fit.
    variance : of the noise, as used.
    lag_range, alpha_range : lowest and highest value that is possible: less than `confidence` + ln(G) nats worse.
    other_combination : whether another combination is possible.
    excess : of the best alpha at each delay over `square`, in nats, shape (n, G): the profile.
    """

    lag: Array
    lag_std: Array
    alpha: Array
    alpha_std: Array
    combination: NDArray[np.intp]
    square: Array
    variance: Array
    lag_range: tuple[Array, Array]
    alpha_range: tuple[Array, Array]
    other_combination: NDArray[np.bool_]
    excess: Array


class Peak(NamedTuple):
    """The best fit of one interval of the lattice, or of one of its points; each of shape (n,)."""

    lag: Array
    alpha: Array
    square: Array
    lag_unit: Array
    alpha_unit: Array


#: By how much more than white noise of this variance the residual of the fits varies; shapes (n,).
Excess = Callable[[Peak, NDArray[np.intp], Array], Array]


def fit(sums: Sums, rho: float, confidence: float, known_alpha: float | None, excess_of: Excess | None = None) -> Fit:
    """Profile likelihood of every window.

    `known_alpha` : where the grid has one inertia, so that only the delay is estimated. `excess_of` : takes peak,
    combination and variance.
    """
    n, delays, _ = sums.zz.shape
    peak, combination, alphas, squares = best(sums, known_alpha)
    rows = np.arange(n)
    free = (delays > 1) + (known_alpha is None)
    variance = np.maximum(rho * rho, peak.square / np.maximum(sums.votes - free, 1.0))
    if excess_of is not None:
        variance = variance * excess_of(peak, combination, variance)
    reach = np.sqrt(2.0 * confidence)
    sigma = np.sqrt(variance)
    lag_std, alpha_std = peak.lag_unit * sigma, peak.alpha_unit * sigma
    excess = (squares - peak.square[:, None, None]) / (2.0 * variance[:, None, None])
    excess = np.maximum(excess - _rounding(sums, variance)[:, None, None], 0.0)
    # the best of many delays is better than the right one by chance alone: ln(delays) is what it costs to look at all
    allowed = confidence + np.log(delays)
    near = excess < allowed
    lags = _lag_range(near.any(axis=2), peak.lag, np.where(delays > 1, reach * lag_std, 0.0))
    alpha_range = _alpha_range(sums, alphas, excess, near, sigma, allowed)
    spread = np.where(np.isfinite(alpha_std), reach * alpha_std, 0.0)  # without a finite one the points say it
    alpha_range = np.minimum(alpha_range[0], peak.alpha - spread), np.maximum(alpha_range[1], peak.alpha + spread)
    if known_alpha is not None:
        alpha_range = peak.alpha, peak.alpha
    others = near.any(axis=1)
    others[rows, combination] = False
    return Fit(
        peak.lag,
        lag_std,
        peak.alpha,
        alpha_std,
        combination,
        peak.square,
        variance,
        lags,
        alpha_range,
        others.any(axis=1),
        excess.min(axis=2),
    )


def best(sums: Sums, known_alpha: float | None) -> tuple[Peak, NDArray[np.intp], Array, Array]:
    """The best fit, its combination of effect values, and alpha and square at every delay, shape (n, G, E)."""
    n, delays, combinations = sums.zz.shape
    alphas, squares = _at_points(sums, known_alpha)
    flat = squares.reshape(n, -1)
    first = flat.argmin(axis=1)
    at, combination = first // combinations, first % combinations
    rows = np.arange(n)
    peak = Peak(at.astype(float), alphas[rows, at, combination], flat[rows, first], *_alone(sums, at, combination))
    if known_alpha is not None:
        peak = peak._replace(alpha_unit=np.zeros(n))
    if delays > 1:
        peak = _refined(sums, peak, at, combination, known_alpha)
    return peak, combination, alphas, squares


def _rounding(sums: Sums, variance: Array) -> Array:
    """Nats by which two sums of this size may differ for no other reason than rounding."""
    return np.asarray(1e-15 * (sums.votes + 10.0) * sums.yy / (2.0 * variance))


def _at_points(sums: Sums, known_alpha: float | None) -> tuple[Array, Array]:
    """alpha = max(S_zy / S_zz, 0) and the residual sum of squares at every delay, both shape (n, G, E)."""
    yy = sums.yy[:, None, None]
    if known_alpha is not None:
        squares = yy - 2.0 * known_alpha * sums.zy + known_alpha**2 * sums.zz
        return np.full_like(sums.zz, known_alpha), np.maximum(squares, 0.0)
    push = np.maximum(sums.zy, 0.0)  # a negative inertia is none
    alphas = np.divide(push, sums.zz, out=np.zeros_like(push), where=sums.zz > 0.0)
    return alphas, np.maximum(yy - push * alphas, 0.0)


def _alone(sums: Sums, at: Array, combination: Array) -> tuple[Array, Array]:
    """Standard deviations of lag and alpha for a noise of 1, where the delay is known."""
    zz = sums.zz[np.arange(len(at)), at, combination]
    with np.errstate(divide="ignore"):
        return np.zeros(len(at)), 1.0 / np.sqrt(zz)


def _refined(sums: Sums, peak: Peak, at: Array, combination: Array, known_alpha: float | None) -> Peak:
    """The better of the intervals on both sides of the best delay of the lattice; else that delay itself."""
    last = sums.zz.shape[1] - 2
    sides = [_interval(sums, np.clip(at + step, 0, last), combination, known_alpha, peak) for step in (-1, 0)]
    # at the best delay itself the slope to either side could be the one: the less certain is taken
    lag_unit = np.maximum(sides[0].lag_unit, sides[1].lag_unit)
    out = peak._replace(lag_unit=lag_unit, alpha_unit=np.maximum(sides[0].alpha_unit, sides[1].alpha_unit))
    for side in sides:
        better = side.square < out.square
        out = Peak(*(np.where(better, new, old) for new, old in zip(side, out, strict=True)))
    return out


def _interval(sums: Sums, n: Array, combination: Array, known_alpha: float | None, peak: Peak) -> Peak:
    """Least squares of y on z and D in the interval from delay n; an infinite square where its best is outside."""
    rows = np.arange(len(n))
    zz, z1 = sums.zz[rows, n, combination], sums.zz[rows, n + 1, combination]
    adjacent = sums.adjacent[rows, n, combination]
    c0 = sums.zy[rows, n, combination]
    c1 = sums.zy[rows, n + 1, combination] - c0
    cross, slope = adjacent - zz, np.maximum(z1 - 2.0 * adjacent + zz, 0.0)
    slope = np.where(slope > ROUNDING * zz, slope, 0.0)
    det = zz * slope - cross**2
    det = np.where(det > ROUNDING * zz * zz, det, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        if known_alpha is None:
            alpha, c = (slope * c0 - cross * c1) / det, (zz * c1 - cross * c0) / det
            fraction, square = c / alpha, sums.yy - alpha * c0 - c * c1
        else:
            alpha = np.full_like(zz, known_alpha)
            fraction = (c1 / known_alpha - cross) / slope
            middle = zz + 2.0 * fraction * cross + fraction**2 * slope
            square = sums.yy - 2.0 * known_alpha * (c0 + fraction * c1) + known_alpha**2 * middle
        inside = (alpha > 0.0) & (fraction >= 0.0) & (fraction <= 1.0) & np.isfinite(square)
        alpha, fraction = np.where(inside, alpha, peak.alpha), np.where(inside, fraction, peak.lag - n)
        middle = zz + 2.0 * fraction * cross + fraction**2 * slope
        lag_unit, alpha_unit = _units(middle, slope, det, alpha, known_alpha is None)
    square = np.where(inside, np.maximum(square, 0.0), np.inf)
    return Peak(n + fraction, alpha, square, lag_unit, alpha_unit)


def _units(middle: Array, slope: Array, det: Array, alpha: Array, both: bool) -> tuple[Array, Array]:
    """Standard deviations of lag and alpha for a noise of 1: the inverse of the Fisher information.

    `middle`, `slope`, `det`: of z(L) z(L), of D D, and of the matrix of both.
    """
    if not both:
        return 1.0 / np.sqrt(alpha**2 * slope), np.zeros_like(alpha)
    lag = np.sqrt(middle / (alpha**2 * det))
    # without any slope (a constant u) the delay is unknown and disturbs alpha not at all
    return lag, np.where(slope > 0.0, np.sqrt(slope / det), 1.0 / np.sqrt(middle))


def _lag_range(near: Array, lag: Array, reach: Array) -> tuple[Array, Array]:
    """First and last delay that is near, and what the standard deviation adds; in steps of the lattice."""
    some = near.any(axis=1)
    low = np.where(some, near.argmax(axis=1), np.inf)
    high = np.where(some, near.shape[1] - 1 - near[:, ::-1].argmax(axis=1), -np.inf)
    return np.minimum(low, lag - reach), np.maximum(high, lag + reach)


def _alpha_range(
    sums: Sums, alphas: Array, excess: Array, near: Array, sigma: Array, allowed: float
) -> tuple[Array, Array]:
    """The projection of the likelihood region on alpha: at every near delay what is left of the nats."""
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = sigma[:, None, None] * np.sqrt(2.0 * np.maximum(allowed - excess, 0.0) / sums.zz)
    low = np.where(near, alphas - reach, np.inf).min(axis=(1, 2))
    high = np.where(near, alphas + reach, -np.inf).max(axis=(1, 2))
    return np.nan_to_num(low, nan=-np.inf, posinf=np.inf), np.nan_to_num(high, nan=np.inf, neginf=-np.inf)
