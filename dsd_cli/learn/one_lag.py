"""One time constant in the place of several, and whether the log shows it."""

from __future__ import annotations

import math

import numpy as np

from dsd_cli.effects.lagging import LAGGED
from dsd_cli.learn.families import lags_of
from dsd_cli.learn.judge import Judge, LawFit, standard_error
from dsd_cli.signals.golden import golden_section

#: Steps in which one time constant is narrowed down: to 1 % of the way between two.
_NARROWED = 10


def is_shown(judge: Judge, fit: LawFit) -> bool:
    """Whether the last law, if it is one with lags, is slower than the band: a shorter lag than the shortest that this
    shows is a push at every turn, and so is what an axis takes that sticks for a moment that the sensor does not show.
    """
    last = fit.laws[-1]
    if last.family.effect is not LAGGED:
        return True
    one = with_one_lag(judge, fit).laws[-1]
    return bool(one.law.time_constants[0] >= last.law.time_constants[0])


def with_one_lag(judge: Judge, fit: LawFit) -> LawFit:
    """The fit with one time constant in the place of each law's several, where that explains the log as well: many lags
    beside each other are large and opposite, and another motion does not have them so."""
    for i, law in enumerate(fit.laws):
        if law.family.effect is not LAGGED or len(law.rows) < 2:
            continue
        one = _one_lag(judge, fit, i)
        fit = one if one.loss - fit.loss <= standard_error(fit.losses, one.losses) else fit
    return fit


def _one_lag(judge: Judge, fit: LawFit, at: int) -> LawFit:
    """The fit with the best single lag as law `at`."""
    law = fit.laws[at]
    times = np.log(law.law.time_constants)

    def alone(time: float) -> LawFit:
        one = lags_of(law.family, judge.balance, (math.exp(time),))
        assert one is not None
        return judge.fit((*fit.laws[:at], one, *fit.laws[at + 1 :]))

    apart = float(times[1] - times[0])
    near = min(times.tolist(), key=lambda time: alone(time).loss)
    return alone(golden_section(lambda time: alone(time).loss, near - apart, near + apart, _NARROWED))
