"""When the logged u is: later than the motion that it causes, or smoothed by a filter that the axis did not see.

Both show in one number. Between two whole steps of delay the drive is u - s (u - u one step later); s in [0, 1] is a
delay. Of a fit that is free to choose it, s < 0 is a u that comes earlier: at delay 0 it was logged too late, and at a
longer one the axis got u + T du/dt with T = -s steps, which is what a first-order filter of time constant T took off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dsd_cli.identify.fit.bank import SHARE, Terms, has_friction
from dsd_cli.identify.fit.row_weights import many_sure
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.long_logs import posed
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import Array

#: Shortest filter that is said, samples: a clock that was made even smooths u by one.
_SHORTEST = 2.0
#: Longest filter that is looked for, s.
_LONGEST = 0.05
#: Share of the squares that a u which is not late may leave: a missing force leans like lag, but leaves more.
_EXPLAINED = 0.25
#: Narrower bands in which a filter is asked for again, as a share, and by what share its time constant may differ
#: there: true ones of 5 ms differ by 0.8 % at most in 25 of 27 logs, what a controller makes of a coarse encoder by
#: 1.5 to 80 % in ten of ten.
_BANDS, _SAME = (0.7, 0.85), 0.01


class _Freed(NamedTuple):
    """Step of delay; s by which u comes earlier than that, its standard error; what is left of each row, weighted."""

    tap: int
    lead: float
    error: float
    residual: Array

    @property
    def left(self) -> float:
        """Weighted squares."""
        return float(self.residual @ self.residual)


@dataclass(frozen=True)
class CommandTime:
    """How the logged u is against the one that moved the axis.

    late : s by which it is later than the motion; 0 if it is not. smoothed : time constant of the filter that it has
    passed, s; 0 if there is none. imitated_by : effects of what was found that nobody needs once that is undone.
    explained : of a filter, whether all that was found is needed beside it.
    """

    late: float = 0.0
    smoothed: float = 0.0
    imitated_by: tuple[str, ...] = ()
    explained: bool = False


def command_time(search: Search, whole: Fit, settings: Settings) -> CommandTime:
    """Late where the delay stands at 0 and less would explain most of what is left; smoothed where a filter explains
    much of what all that was found leaves."""
    added = search.added(whole.terms)
    if len(search.taps) < 2 or search.problem.blocks.rows < POLICY.few_rows:
        return CommandTime()
    freed, residual = _best_freed(search, whole.terms, whole.tap), _residual(search, whole)
    before = float(residual @ residual)
    if not _certain(search, freed):
        return CommandTime()
    if freed.tap == 0:
        at_zero = whole.tap == 0 and float(whole.total[SHARE]) == 0.0
        return CommandTime(late=freed.lead if at_zero and freed.left < _EXPLAINED * before else 0.0)
    gain = _gain(search, whole, residual, freed)
    if (
        freed.lead < _SHORTEST * search.equations.sample_time
        or gain < POLICY.response_nats
        or freed.left > (1.0 - POLICY.near_fall) ** 2 * before
        or not _in_all_bands(search, whole, settings, freed.lead)
    ):
        return CommandTime()
    terms, needless = whole.terms, []
    for term in reversed(added):
        rest = tuple(t for t in terms if t != term)
        without = _best_freed(search, rest, whole.tap)
        if (without.left - freed.left) / search.noise.nats < search.price((term,)) + POLICY.least_gain:
            terms, freed = rest, without
            needless.append(term.id)
    return CommandTime(0.0, freed.lead, tuple(needless), bool(added) and not needless)


def _gain(search: Search, whole: Fit, residual: Array, freed: _Freed) -> float:
    """Nats that the earlier u gains: beside friction in rows whose direction is sure, if they are many. What a stop
    leaves goes with du/dt."""
    sure = many_sure(search.equations) if has_friction(whole.terms) else None
    rows = search.equations.kept if sure is None else sure
    before, after = residual[rows], freed.residual[rows]
    return float(before @ before - after @ after) / search.noise.nats


def _in_all_bands(search: Search, whole: Fit, settings: Settings, lead: float) -> bool:
    """Whether u comes as much earlier at lower frequencies alone, as a filter makes it.

    A controller that differentiates a coarse position puts its steps into u, and the acceleration that is had from that
    position has them as well: u then goes with du/dt, by another amount in each band.
    """
    found = search.problem.scale.model(whole)
    for share in _BANDS:
        narrower = replace(settings, band=share * settings.band)
        there = posed(search.problem.recordings, found, narrower, found.delay)
        if not abs(_best_freed(there, there.base, there.refit.tap).lead - lead) < _SAME * lead:
            return False
    return True


def _certain(search: Search, freed: _Freed) -> bool:
    return freed.lead > max(POLICY.value_deviations * freed.error, search.equations.sample_time)


def _best_freed(search: Search, terms: Terms, tap: int) -> _Freed:
    """At the delay beyond that of a fit at which least is left: the fit takes a filter off its delay."""
    bank = search.solver.bank
    reach = max(round(_LONGEST / bank.tap_time), 1)
    return min((_freed(search, terms, n) for n in search.taps if tap <= n <= tap + reach), key=lambda f: f.left)


def _freed(search: Search, terms: Terms, tap: int) -> _Freed:
    """Least squares without a bound on the share."""
    bank = search.solver.bank
    rows = np.stack(bank.design(terms, tap, keep=False).rows)
    x = rows[1:]
    inverse = np.linalg.pinv(x.T, rcond=x.shape[1] * np.finfo(float).eps)
    theta = inverse @ rows[0]
    left = rows[0] - theta @ x
    variance = float(inverse[SHARE] @ inverse[SHARE] * np.mean(left**2) * search.noise.inflation)
    return _Freed(tap, -float(theta[SHARE]) * bank.tap_time, math.sqrt(variance) * bank.tap_time, left)


def _residual(search: Search, fit: Fit) -> Array:
    """What a fit leaves of each row, weighted, shape (N,)."""
    rows = np.stack(search.solver.bank.design(fit.terms, fit.tap).rows)
    return np.asarray(rows[0] - fit.total @ rows[1:])
