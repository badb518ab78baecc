"""How the logged u is against the one that moved the axis: late, or smoothed; and the logs without that.

A u that is late and one that is smoothed show in one number. Between two whole steps of delay the drive is
u - s (u - u one step later); s in [0, 1] is a delay. Of a fit that is free to choose it, s < 0 is a u that comes
earlier: at delay 0 it was logged too late, and at a longer one the axis got u + T du/dt with T = -s steps, which is
what a first-order filter of time constant T took off. A u behind a filter longer than the delay shows as the first, and
as the second once it is moved.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dsd_cli.identify.fit.bank import SHARE, Terms
from dsd_cli.identify.fit.blocks import condensed
from dsd_cli.identify.fit.direction import LEAST_LATE, certainly_late, explains_most
from dsd_cli.identify.fit.row_weights import residual_of_u
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import LATE, SMOOTHED, earlier, unfiltered
from dsd_cli.identify.recordings.recording import Mended, Recording
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.signals import delay_of, enough, gains, innovations, left, signals_of
from dsd_cli.identify.search.task import posed
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

_WHY_SMOOTHED = "Is it logged behind a filter, or does the sensor sit behind something soft?"
_WHY_LATE = "Another clock, a filtered u, or the mean of the interval that ends at each stamp? dsd check measures it."
#: Share of a recording that u may be late by, to be taken on time.
_MOST_LATE = 0.1
#: Shortest filter that is said, samples: a clock that was made even smooths u by one.
_SHORTEST = 2.0
#: Rows at the full rate that show one.
_FEWEST = 300
#: Longest filter that is looked for, s.
_LONGEST = 0.05


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
    passed, s; 0 if there is none. explained : of a filter, whether all that was found is needed beside it. alike :
    whether it is so in each log.
    """

    late: float = 0.0
    smoothed: float = 0.0
    explained: bool = False
    alike: bool = False

    @property
    def said(self) -> str:
        """What is wrong with u; "" if nothing."""
        if self.smoothed:
            return f"u is smoothed by about {self.smoothed * 1e3:.2g} ms against what moved the axis"
        return f"u is later than the motion that it causes, by about {self.late * 1e3:.2g} ms" if self.late else ""

    @property
    def question(self) -> str:
        """That, and what the user may ask himself."""
        return f"{self.said}. {_WHY_SMOOTHED if self.smoothed else _WHY_LATE}"


def command_time(search: Search, whole: Fit, settings: Settings) -> CommandTime:
    """Late where the delay stands at 0 and less would explain most of what is left; smoothed where a filter explains
    much of what all that was found leaves."""
    if len(search.taps) < 2:
        return CommandTime()
    freed = _best_freed(search, whole.terms, whole.tap)
    if freed.tap > 0 or not _certain(search, freed):
        return _behind_filter(search, whole, freed)
    residual = residual_of_u(whole, search.solver.bank)
    at_zero = whole.tap == 0 and float(whole.total[SHARE]) == 0.0
    free = search.problem.blocks.rows - len(whole.total)
    if not at_zero or not explains_most(freed.left, float(residual @ residual), free):
        return CommandTime()
    step, recordings = search.equations.sample_time, search.problem.recordings
    late = CommandTime(freed.lead, alike=_alike(search, whole.terms, freed))
    if freed.lead < _SHORTEST * step or not _short(freed.lead, recordings):
        return late
    moved = [earlier(r, math.ceil(freed.lead / step) * step) for r in recordings]
    there = posed(moved, search.problem.model, settings, 0.0)
    fit = there.refined(there.fit(whole.terms, there.refit.tap))
    behind = _behind_filter(there, fit, _best_freed(there, fit.terms, fit.tap))
    return behind if behind.smoothed else late


def _behind_filter(search: Search, whole: Fit, freed: _Freed) -> CommandTime:
    """Smoothed, if a filter explains much of what a set leaves, in the motion as well. freed : with the earliest u."""
    added, residual = search.added(whole.terms), residual_of_u(whole, search.solver.bank)
    if (
        freed.tap == 0
        or not _certain(search, freed)
        or freed.lead < _SHORTEST * search.equations.sample_time
        or freed.left > (1.0 - POLICY.clear_fall) ** 2 * float(residual @ residual)
    ):
        return CommandTime()
    terms = whole.terms
    for term in reversed(added):
        rest = tuple(t for t in terms if t != term)
        without = _best_freed(search, rest, whole.tap)
        if (without.left - freed.left) / search.noise.nats < search.price((term,)) + POLICY.least_gain:
            terms, freed = rest, without
    if not _by_motion(search, search.fit(terms, whole.tap), freed):
        return CommandTime()
    step = search.solver.bank.tap_time
    constant = step / math.log1p(step / freed.lead)  # of a u that is held
    return CommandTime(0.0, constant, bool(added) and terms == whole.terms, _alike(search, terms, freed))


def _by_motion(search: Search, late: Fit, freed: _Freed) -> bool:
    """Whether the motion after u shows the filter by no more than the past of each sample.

    A controller puts the steps of a coarse position into u, and the acceleration has them: in rows that look to both
    sides u goes with du/dt. So does what a stop leaves.
    """
    part = search.excerpt or search
    fit = part.fit(late.terms, late.tap)
    plain, early = (
        signals_of(part, fit, d, _FEWEST) for d in (delay_of(part, fit), freed.tap * part.solver.bank.tap_time)
    )
    if plain is None or early is None:
        return False
    rows = [np.column_stack([s.rows(x) for x in (s.force, s.shift, *s.given)]) for s in (plain, early)]
    fresh = innovations(left(rows[0], plain.target), plain.step, plain.sliding)
    target = fresh(plain.target)
    return enough(gains(*(left(fresh(x), target) for x in rows)))


def _certain(search: Search, freed: _Freed) -> bool:
    return certainly_late(freed.lead, freed.error, search.equations.sample_time)


def _best_freed(search: Search, terms: Terms, tap: int) -> _Freed:
    """At the delay beyond that of a fit at which least is left: the fit takes a filter off its delay."""
    bank = search.solver.bank
    reach = max(round(_LONGEST / bank.tap_time), 1)
    return min((_freed(search, terms, n) for n in search.taps if tap <= n <= tap + reach), key=lambda f: f.left)


def _freed(search: Search, terms: Terms, tap: int, log: int | None = None) -> _Freed:
    """Least squares without a bound on the share, of one log or of all."""
    bank = search.solver.bank
    rows = np.stack(bank.rows(terms, tap, keep=False))
    rows = rows if log is None else rows[:, bank.equations.logs_of_rows == log]
    few = condensed([*rows])
    inverse = np.linalg.pinv(few[1:].T, rcond=rows.shape[1] * np.finfo(float).eps)
    theta = inverse @ few[0]
    left = rows[0] - theta @ rows[1:]
    variance = float(inverse[SHARE] @ inverse[SHARE] * np.mean(left**2) * search.noise.inflation)
    return _Freed(tap, -float(theta[SHARE]) * bank.tap_time, math.sqrt(variance) * bank.tap_time, left)


def _alike(search: Search, terms: Terms, found: _Freed) -> bool:
    """Whether u comes as much earlier in each log as in all: one value of [signals] is of none where it does not."""
    logs = range(len(search.problem.recordings))
    each = [_freed(search, terms, found.tap, i) for i in logs] if len(logs) > 1 else []
    near = (1.0 - LEAST_LATE) * search.equations.sample_time
    return all(abs(f.lead - found.lead) < max(POLICY.told_deviations * f.error, near) for f in each)


def _short(seconds: float, recordings: Sequence[Recording]) -> bool:
    """Whether that is a small share of each."""
    return all(seconds <= _MOST_LATE * max(len(p) * p.sample_time for p in r.pieces) for r in recordings)


def on_time(
    time: CommandTime, model: PlantModel, recordings: Sequence[Recording], holdout: Sequence[Recording]
) -> Mended | None:
    """The recordings with u as it acted, where it is late or smoothed in all alike and that can be had; the delay of
    the model stays: of u that is late by more than the delay nothing says how much of it is delay."""
    every = (*recordings, *holdout)
    kind, mend = (SMOOTHED, unfiltered) if time.smoothed else (LATE, earlier)
    by_u = any(kind in r.taken_off or "reconstructed" in r.provenance.get("velocity", "") for r in every)
    off = time.smoothed or time.late + model.delay
    if not time.alike or by_u or not _short(off, every):
        return None
    if time.smoothed:
        said = (
            f"Here it counts as unfiltered: set signals.u_filter = {off:.3g} (so much more if it has one); an"
            " actuator_lag looks just like the filter and is not identifiable then"
        )
    else:
        rest = f" with the delay of [model], {model.delay * 1e3:.2g} ms," if model.delay else ""
        said = f"Here{rest} it counts as {1e3 * off:.3g} ms earlier: take that off signals.u_shift; the delay itself"
        said += " is not identifiable then"
    moved, aside = (tuple(mend(r, off) for r in some) for some in (recordings, holdout))
    return Mended(moved, aside, (f"{time.question} {said}",))


def was_late(mended: Mended) -> bool:
    """Whether u was late or smoothed, and is not now: how much of its delay that took nothing says."""
    return any({LATE, SMOOTHED} & {*r.taken_off} for r in mended.recordings)
