"""What a log itself must have before any verdict on it can be sure: a u that acts when it is logged; a direction.

A u that is late and one that is smoothed show in one number. Between two whole steps of delay the drive is
u - s (u - u one step later); s in [0, 1] is a delay. Of a fit that is free to choose it, s < 0 is a u that comes
earlier: at delay 0 it was logged too late, and at a longer one the axis got u + T du/dt with T = -s steps, which is
what a first-order filter of time constant T took off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dsd_cli.identify.fit.bank import SHARE, Terms, has_friction
from dsd_cli.identify.fit.blocks import condensed
from dsd_cli.identify.fit.direction import LATE, certainly_late, explains_most
from dsd_cli.identify.fit.row_weights import many_sure, residual_of_u
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings, constant_u
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import earlier
from dsd_cli.identify.recordings.recording import Mended, Recording
from dsd_cli.identify.search.long_logs import posed
from dsd_cli.identify.search.seen import Seen
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.discrepancy import in_common
from dsd_cli.identify.verdict.unacted_command import UnactedCommand, idle_part
from dsd_cli.signals.log import Array

#: Of a mended recording, and what a user may ask himself.
_KIND = "late u"
_WHY_LATE = "dsd check measures it: another clock, a filtered u, or the mean of the interval that ends at each stamp?"
#: Share of a recording that u may be late by, to be taken on time.
_MOST_LATE = 0.1
#: Shortest filter that is said, samples: a clock that was made even smooths u by one.
_SHORTEST = 2.0
#: Longest filter that is looked for, s.
_LONGEST = 0.05
#: Narrower bands in which a filter is asked for again, as a share, and by what share its time constant may differ
#: there: what a controller makes of a coarse encoder is another one in each band.
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
    if len(search.taps) < 2:
        return CommandTime()
    freed, residual = _best_freed(search, whole.terms, whole.tap), residual_of_u(whole, search.solver.bank)
    before = float(residual @ residual)
    if not certainly_late(freed.lead, freed.error, search.equations.sample_time):
        return CommandTime()
    if freed.tap == 0:
        at_zero = whole.tap == 0 and float(whole.total[SHARE]) == 0.0
        sure = explains_most(freed.left, before, search.problem.blocks.rows)
        return CommandTime(late=freed.lead if at_zero and sure else 0.0)
    gain = _gain(search, whole, residual, freed)
    if (
        freed.lead < _SHORTEST * search.equations.sample_time
        or gain < POLICY.response_nats
        or freed.left > (1.0 - POLICY.clear_fall) ** 2 * before
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
    few = condensed(rows)
    inverse = np.linalg.pinv(few[1:].T, rcond=rows.shape[1] * np.finfo(float).eps)
    theta = inverse @ few[0]
    left = rows[0] - theta @ rows[1:]
    variance = float(inverse[SHARE] @ inverse[SHARE] * np.mean(left**2) * search.noise.inflation)
    return _Freed(tap, -float(theta[SHARE]) * bank.tap_time, math.sqrt(variance) * bank.tap_time, left)


def _alike(search: Search, whole: Fit, late: float) -> bool:
    """Whether u is as late in each log as in all: one value for `signals.u_shift` is of none where it is not."""
    logs = range(len(search.problem.recordings))
    each = [_freed(search, whole.terms, 0, i) for i in logs] if len(logs) > 1 else []
    near = (1.0 - LATE) * search.equations.sample_time
    return all(abs(f.lead - late) < max(POLICY.told_deviations * f.error, near) for f in each)


#: Share of u that the motion must explain, whatever is missing: between that of an axis which lacks a law that no
#: catalogue has (0.55 and more) and that of the u of another axis (0.39 at most).
_LEAST_IN_COMMON = 0.45


@dataclass(frozen=True)
class Limits:
    """common : share of u that the motion explains in parts of the log that were not fitted. idle : a part of u that
    did not act, without which all is asked again. time : whether u is late or smoothed. direction : share of the
    samples in motion whose direction the sensor shows, 0 to 1. constant : whether u is, in all logs. passed : (log, Hz
    above which a low-pass took all from it)."""

    common: float
    idle: UnactedCommand | None
    time: CommandTime
    direction: float
    constant: bool = False
    passed: tuple[tuple[str, float], ...] = ()

    @property
    def surest_of_nothing(self) -> float:
        """Upper bound on the probability that no law is missing: what a low-pass took from a log, that leaves open."""
        return min(self.surest, POLICY.even) if self.passed else self.surest

    @property
    def surest(self) -> float:
        """Upper bound on the probability of any verdict."""
        return POLICY.surest if self.direction >= POLICY.least_told_direction else POLICY.even

    @property
    def blocked(self) -> str:
        """What must be mended before anything that is missing can be identified; "" if nothing."""
        if self.constant:
            return "u is constant: a load of that size explains it, whatever moves the axis"
        if self.common < _LEAST_IN_COMMON:
            return "u and the motion have too little in common: u does not seem to drive this axis"
        if self.time.late:
            return _late(self.time)
        return _smoothed(self.time) if self.time.smoothed and not self.time.explained else ""

    @property
    def said(self) -> tuple[str, ...]:
        """One sentence each."""
        found = []
        if self.common < _LEAST_IN_COMMON and not self.constant:
            found.append(
                f"{self.blocked} (fitted to one part of the log, the motion explains"
                f" {100.0 * max(self.common, 0.0):.0f} % of u in the others). Is it the column of another axis, or from"
                " another time? Or is the log so short that a longer one, or faster moves, would show more?"
            )
        elif self.time.late:
            found.append(f"{self.blocked} ({_WHY_LATE}). Take that off signals.u_shift and ask again")
        elif self.time.smoothed:
            found.append(_said_of_filter(self.time))
        if self.direction < POLICY.least_told_direction:
            found.append(
                f"the sensor shows the direction of the motion in {100.0 * self.direction:.0f} % of the samples in"
                " which the axis moves: friction is indistinguishable from other forces; a finer encoder or faster"
                " moves would do"
            )
        found += [
            f"u and the motion of {name} passed a low-pass of about {hz:.2g} Hz before they were logged: a load that"
            " swings, play or a lag above it are not in this log. Log them without it"
            for name, hz in self.passed
        ]
        return tuple(found)


def on_time(
    limits: Limits, search: Search, whole: Fit, recordings: Sequence[Recording], holdout: Sequence[Recording]
) -> Mended | None:
    """The recordings with u on time, where it is late in all alike and that can be had; the delay of the model stays:
    of u that is late by more than the delay nothing says how much of it is delay."""
    late, delay, every = limits.time.late, search.problem.model.delay, (*recordings, *holdout)
    by_u = any(_KIND in r.taken_off or "reconstructed" in r.provenance.get("velocity", "") for r in every)
    longest = min(max(len(p) * p.sample_time for p in r.pieces) for r in every)
    if not late or limits.blocked != _late(limits.time) or by_u or late + delay > _MOST_LATE * longest:
        return None
    if not _alike(search, whole, late):
        return None
    rest = f" with the delay of [model], {delay * 1e3:.2g} ms," if delay else ""
    said = (
        f"{limits.blocked} ({_WHY_LATE}). Here{rest} it counts as {1e3 * (late + delay):.3g} ms earlier: take that off"
    )
    moved, aside = (tuple(earlier(r, late + delay, _KIND) for r in some) for some in (recordings, holdout))
    return Mended(moved, aside, (f"{said} signals.u_shift; the delay itself is not identifiable then",))


def was_late(mended: Mended) -> bool:
    """Whether u was, and is on time now."""
    return any(_KIND in r.taken_off for r in mended.recordings)


def _late(time: CommandTime) -> str:
    return f"u is later than the motion that it causes, by about {time.late * 1e3:.2g} ms"


def _smoothed(time: CommandTime) -> str:
    return f"u is smoothed by about {time.smoothed * 1e3:.2g} ms against what moved the axis"


def _said_of_filter(time: CommandTime) -> str:
    instead = f": undone, it leaves less than {' and '.join(time.imitated_by)}" if time.imitated_by else ""
    return (
        f"{_smoothed(time)}{instead}. Is it logged behind a filter? Log it without, or undo it (signals.u_filter,"
        f" {time.smoothed:.2g} s more than it has). Or does the sensor sit behind something soft?"
    )


def limits_of(search: Search, whole: Fit, settings: Settings, seen: Seen | None) -> Limits:
    """Of the recordings of a search, beside the set that was found and the load that the response shows."""
    stretches = search.equations.stretches
    sign, free = (np.concatenate(x) for x in zip(*((s.sign, s.free) for s in stretches), strict=True))
    moving = free > 0.0
    direction = float(np.mean(np.abs(sign[moving]))) if moving.any() else 1.0
    if seen is not None and not math.isnan(seen.off):  # motor and load keep the momentum that all of u gives them
        idle, common = None, 1.0
    elif (idle := idle_part(search, whole, settings, seen)) is not None:
        return Limits(1.0, idle, CommandTime(), direction)
    else:
        common = in_common(search, whole)
    # where the log is against a value that was given, u was neither late nor smoothed with none given
    time = CommandTime() if settings.against else command_time(search, whole, settings)
    recordings = search.problem.recordings
    passed = tuple((r.name, r.lost.hz) for r in recordings if math.isfinite(r.lost.hz))
    return Limits(common, idle, time, direction, constant_u(recordings), passed)
