"""How often the test for changes alarms where nothing changes (docs/how/beyond.md, "When did it change?")."""

from __future__ import annotations

import math

from dsd_cli.detect.profile.changes import QUIET


def false_alarms_per_hour(
    threshold: float, window: int, sample_time: float, time_constant: float = 0.0, free: int = 2
) -> float:
    """What to expect of a log without changes, white noise of rho.

    2 nats(t) is a chi-squared process of `free` degrees of freedom whose correlation falls like 1 - 3 |t| / (2 M): it
    passes 2 h in (3 / M) h P(chi2 > 2 h) clusters per sample (Pickands), less what falls between two samples
    (Siegmund's nu), less what the variance that is never below rho^2 takes, and none while the test is blind.

    Parameters
    ----------
    threshold : h, nats.
    window : M, samples; `sample_time`, `time_constant` of Q in s.
    free : axes of the grid with more than one value (that an effect has few values makes fewer alarms).
    """
    if free == 0:
        return 0.0
    h, tail = threshold, _chi_squared_tail(threshold, free)
    between_samples = math.exp(-0.583 * math.sqrt(6.0 * h / window))
    rate = 3.0 * h * tail * between_samples * _of_variance(h, 2 * window) / window  # per sample
    blind = window + QUIET * time_constant / sample_time
    return rate / (1.0 + rate * blind) * 3600.0 / sample_time


def _chi_squared_tail(h: float, freedom: int) -> float:
    """P(chi2 > 2 h)."""
    tail, degrees = (math.exp(-h), 2) if freedom % 2 == 0 else (math.erfc(math.sqrt(h)), 1)
    while degrees < freedom:
        tail += math.exp(0.5 * degrees * math.log(h) - h - math.lgamma(0.5 * degrees + 1.0))
        degrees += 2
    return tail


def _of_variance(h: float, samples: int) -> float:
    """Mean of V exp(-h (V - 1)), V = max(1, W), W normal about 1 with the standard deviation of a mean square.

    The test takes for the variance the residual of its windows where that is above rho^2.
    """
    spread = math.sqrt(2.0 / max(samples - 4, 1))
    a = h * spread
    if a > 30.0:  # e^(a^2 / 2) overflows; its product with the tail is 1 / (a sqrt(2 pi)) then
        upper = 1.0 / (a * math.sqrt(2.0 * math.pi))
    else:
        upper = 0.5 * math.exp(0.5 * a * a) * math.erfc(a / math.sqrt(2.0))
    return 0.5 + (1.0 - spread * a) * upper + spread / math.sqrt(2.0 * math.pi)
