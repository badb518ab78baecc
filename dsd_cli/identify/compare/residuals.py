"""Is the residual noise? Correlation with its own past and with u, each with what chance alone would give.

At 1 kHz everything is significant; so each answer comes with its size: the share of the residual's variance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsd_cli.signals.log import Array

#: Two-sided 99 % point of the normal distribution, and the level of the tests.
POINT, LEVEL = 2.5758293035489004, 0.01
#: Share of the variance from which an effect is worth a model.
LARGE = 0.05
#: Order of the autoregression that says how much of the residual its own past predicts.
_ORDER = 20


@dataclass(frozen=True)
class ResidualTests:
    """What the residual shows of structure.

    white : the autocorrelation is that of white noise (Ljung-Box over all lags, level 1 %).
    independent_of_u : no correlation with u now or before (largest over all lags, level 1 %).
    samples, effective_samples : n, and the number of independent ones for the correlation with u (Bartlett's formula).
    lags : 1, 2, ... samples, of `autocorrelation`; `correlation_with_u` begins with lag 0.
    band, band_u : 99 % of single correlations lie within, were there no dependence.
    predictable_share : of the variance, from the residual's own past (autoregression).
    largest, largest_lag : the largest autocorrelation, and its lag in s.
    largest_with_u, largest_lag_with_u : the same with u; u comes first by this lag.
    """

    white: bool
    independent_of_u: bool
    samples: int
    effective_samples: float
    lags: int
    band: float
    band_u: float
    predictable_share: float
    largest: float
    largest_lag: float
    largest_with_u: float
    largest_lag_with_u: float
    autocorrelation: tuple[float, ...]
    correlation_with_u: tuple[float, ...]

    @property
    def widest(self) -> float:
        """Within it the largest autocorrelation of white noise lies in 99 of 100 logs."""
        return _joint_point(self.lags) / math.sqrt(self.samples)

    @property
    def widest_with_u(self) -> float:
        """Within it the largest correlation with u lies in 99 of 100 logs, were there no dependence."""
        return _joint_point(self.lags + 1) / math.sqrt(self.effective_samples)

    @property
    def remembers(self) -> bool:
        """Not white, and by enough to matter."""
        return not self.white and self.predictable_share >= LARGE

    @property
    def follows_u(self) -> bool:
        """Correlated with u, and by enough to matter."""
        return not self.independent_of_u and self.largest_with_u**2 >= LARGE


def residual_tests(errors: Sequence[Array], commands: Sequence[Array], interval: float, lags: int) -> ResidualTests:
    """Tests over stretches without gaps.

    errors, commands : residual and u of each stretch, shape (n_i,).
    interval : sample time, s.
    lags : how far to look, samples; at most a quarter of the longest stretch.
    """
    e, u = ([x - np.concatenate(parts).mean() for x in parts] for parts in (errors, commands))
    n, longest = sum(map(len, e)), max(map(len, e))
    lags = max(min(lags, longest // 4), 1)
    reach = max(longest // 4, lags)
    own, own_u = _correlations(e, e, reach), _correlations(u, u, reach)
    cross = _correlations(e, u, lags)
    auto = own[1 : lags + 1]
    effective = _effective_samples(own, own_u, n)
    band_u = POINT / math.sqrt(effective)
    most, most_u = int(np.argmax(np.abs(auto))), int(np.argmax(np.abs(cross)))
    return ResidualTests(
        white=_looks_white(auto, n),
        independent_of_u=bool(np.abs(cross[most_u]) <= _joint_point(lags + 1) / math.sqrt(effective)),
        samples=n,
        effective_samples=effective,
        lags=lags,
        band=POINT / math.sqrt(n),
        band_u=band_u,
        predictable_share=_predictable_share(own, n),
        largest=float(auto[most]),
        largest_lag=(most + 1) * interval,
        largest_with_u=float(cross[most_u]),
        largest_lag_with_u=most_u * interval,
        autocorrelation=tuple(auto.tolist()),
        correlation_with_u=tuple(cross.tolist()),
    )


def _correlations(xs: Sequence[Array], ys: Sequence[Array], lags: int) -> Array:
    """sum x_k y_{k-lag} / sqrt(sum x^2 sum y^2) for lag 0..lags, over all stretches; 0 where one of them is 0."""
    total = np.zeros(lags + 1)
    for x, y in zip(xs, ys, strict=True):
        size = 1 << (len(x) + lags).bit_length()
        products = np.fft.irfft(np.fft.rfft(x, size) * np.conj(np.fft.rfft(y, size)), size)
        reach = min(lags, len(x) - 1)
        total[: reach + 1] += products[: reach + 1]
    scale = math.sqrt(sum(float(x @ x) for x in xs) * sum(float(y @ y) for y in ys))
    return total / scale if scale > 0.0 else np.zeros(lags + 1)


def _effective_samples(own: Array, other: Array, n: int) -> float:
    """Bartlett: var r = 1/n sum_j rho_e(j) rho_u(j), so 1/n_eff.

    Autocorrelations of the residual that are within chance count as 0, else their noise would add up; the tail is
    tapered. Never more than n.
    """
    significant = np.where(np.abs(own) > POINT / math.sqrt(n), own, 0.0)
    taper = 1.0 - np.arange(len(own)) / len(own)
    total = 1.0 + 2.0 * float(np.sum((significant * other * taper)[1:]))
    return min(max(n / max(total, 1.0), 2.0), float(n))


def _joint_point(count: int) -> float:
    """Normal point that the largest of `count` correlations passes with probability `LEVEL` at most (Sidak)."""
    from statistics import NormalDist

    single = 1.0 - (1.0 - LEVEL) ** (1.0 / count)
    return NormalDist().inv_cdf(1.0 - 0.5 * single)


def _looks_white(auto: Array, n: int) -> bool:
    """Ljung and Box (1978): n (n+2) sum r_k^2 / (n-k) is chi-square with as many degrees as lags."""
    lag = np.arange(1, len(auto) + 1)
    statistic = n * (n + 2.0) * float(np.sum(auto**2 / (n - lag)))
    return statistic <= _chi_square_point(len(auto))


def _chi_square_point(degrees: int) -> float:
    """Upper point of chi-square at `LEVEL` (Wilson and Hilferty 1931; within 1 % from 2 degrees on)."""
    from statistics import NormalDist

    spread = 2.0 / (9.0 * degrees)
    return degrees * (1.0 - spread + NormalDist().inv_cdf(1.0 - LEVEL) * math.sqrt(spread)) ** 3


def _predictable_share(own: Array, n: int) -> float:
    """R^2 of an autoregression from the autocorrelations (Yule-Walker), less what chance gives it."""
    order = min(_ORDER, len(own) - 1, n // 20)
    if order < 1 or own[0] <= 0.0:
        return 0.0
    index = np.abs(np.subtract.outer(np.arange(order), np.arange(order)))
    matrix = own[index] + 1e-9 * np.eye(order)
    share = float(own[1 : order + 1] @ np.linalg.solve(matrix, own[1 : order + 1]))
    return min(max(1.0 - (1.0 - share) * (n - 1) / (n - order - 1), 0.0), 1.0)
