"""What a log itself must have before any verdict on it can be sure: a u that is not late, and a direction of motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dsd_cli.identify.fit.bank import SHARE
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Search


@dataclass(frozen=True)
class Limits:
    """late : s by which u is later than the motion that it causes; 0 if it is not. told : share of the samples in
    motion whose direction the sensor tells, 0 to 1."""

    late: float
    told: float

    @property
    def surest(self) -> float:
        """Upper bound on the probability of any verdict."""
        return POLICY.surest if self.told >= POLICY.least_told_direction else POLICY.surest_untold

    @property
    def said(self) -> tuple[str, ...]:
        """One sentence each."""
        found = []
        if self.late:
            found.append(
                f"u is later than the motion that it causes, by about {self.late * 1e3:.2g} ms (dsd check measures it):"
                " another clock, or a filtered u? Shift the column of u by that and ask again"
            )
        if self.told < POLICY.least_told_direction:
            found.append(
                f"the sensor tells the direction of the motion in {100.0 * self.told:.0f} % of the samples in which the"
                " axis moves: friction cannot be told from other forces; a finer encoder or faster moves would help"
            )
        return tuple(found)


def limits_of(search: Search, whole: Fit) -> Limits:
    """Of the recordings of a search, beside the set that was found."""
    stretches = search.equations.stretches
    sign, free = (np.concatenate(x) for x in zip(*((s.sign, s.free) for s in stretches), strict=True))
    moving = free > 0.0
    return Limits(_late(search, whole), float(np.mean(np.abs(sign[moving]))) if moving.any() else 1.0)


def _late(search: Search, fit: Fit) -> float:
    """s by which u is late where the delay of a fit stands at 0 and less would explain more, by what is of use."""
    if fit.tap > 0 or float(fit.total[SHARE]) > 0.0 or len(search.taps) < 2:
        return 0.0
    late, error, left, before = _freed(search, fit)
    certain = late > max(POLICY.value_deviations * error, search.equations.sample_time)
    if not certain or left > (1.0 - POLICY.least_fall) ** 2 * before:
        return 0.0
    return max(late, _freed(search, search.solver.fit(search.problem.beside, 0))[0])


def _freed(search: Search, fit: Fit) -> tuple[float, float, float, float]:
    """(s by which u is late if the delay may have any sign, its standard error; squares then, and as they are)."""
    bank = search.solver.bank
    rows = np.stack(bank.design(fit.terms, fit.tap).rows)
    kept = [i for i, theta in enumerate(fit.total) if theta != 0.0 or i == SHARE]
    x, at = rows[1:][kept], kept.index(SHARE)
    theta = np.linalg.lstsq(x.T, rows[0], rcond=None)[0]
    left, before = rows[0] - theta @ x, rows[0] - fit.total @ rows[1:]
    variance = float(np.linalg.pinv(x @ x.T)[at, at] * np.mean(left**2) * search.noise.inflation)
    late, error = -float(theta[at]) * bank.tap_time, math.sqrt(variance) * bank.tap_time
    return late, error, float(left @ left), float(before @ before)
