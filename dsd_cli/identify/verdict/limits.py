"""What a log itself must have before any verdict on it can be sure: a u that acts when it is logged; a direction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dsd_cli.identify.fit.freeform import freeform_fits
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.seen import Seen
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.command_time import CommandTime, command_time
from dsd_cli.identify.verdict.unacted_command import UnactedCommand, idle_part

#: Share of u that the motion must tell. Of 335 logs of an outside rig with anything missing, laws that no catalogue has
#: among them, 334 have 0.55 and more, and the u of another axis has 0.39 at most in 117 of 120 (the others are short).
_LEAST_IN_COMMON = 0.45


@dataclass(frozen=True)
class Limits:
    """common : share of u that the motion explains in parts of the log that were not fitted. idle : a part of u that
    did not act. time : whether u is late or smoothed. direction : share of the samples in motion whose direction the
    sensor shows, 0 to 1."""

    common: float
    idle: UnactedCommand | None
    time: CommandTime
    direction: float

    @property
    def surest(self) -> float:
        """Upper bound on the probability of any verdict."""
        return POLICY.surest if self.direction >= POLICY.least_told_direction else POLICY.even

    @property
    def blocked(self) -> str:
        """What must be mended before anything that is missing can be identified; "" if nothing."""
        if self.common < _LEAST_IN_COMMON:
            return "u and the motion have too little in common: u does not seem to drive this axis"
        if self.idle is not None:
            return f"{self.idle.what} did not act on the axis"
        if self.time.late:
            return f"u is later than the motion that it causes, by about {self.time.late * 1e3:.2g} ms"
        return _smoothed(self.time) if self.time.smoothed and not self.time.explained else ""

    @property
    def said(self) -> tuple[str, ...]:
        """One sentence each."""
        found = []
        if self.common < _LEAST_IN_COMMON:
            found.append(
                f"{self.blocked} (fitted to one part of the log, the motion explains"
                f" {100.0 * max(self.common, 0.0):.0f} % of u in the others). Is it the column of another axis, or from"
                " another time? Or is the log so short that a longer one, or faster moves, would show more?"
            )
        elif self.idle is not None:
            found.append(f"{self.blocked}: {self.idle.why}. {self.idle.question}")
        elif self.time.late:
            found.append(
                f"{self.blocked} (dsd check measures it): another clock, or a filtered u? Take that off"
                " signals.u_shift and ask again"
            )
        elif self.time.smoothed:
            found.append(_said_of_filter(self.time))
        if self.direction < POLICY.least_told_direction:
            found.append(
                f"the sensor shows the direction of the motion in {100.0 * self.direction:.0f} % of the samples in"
                " which the axis moves: friction is indistinguishable from other forces; a finer encoder or faster"
                " moves would do"
            )
        return tuple(found)


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
    else:
        idle, common = idle_part(search, whole, settings, seen), in_common(search, whole)
    return Limits(common, idle, command_time(search, whole, settings), direction)


def in_common(search: Search, whole: Fit) -> float:
    """Share of u that the motion explains in parts of the log that were not fitted: less than of any axis, if u is of
    another one, or of another time.

    Asked of u by the motion: with its acceleration, the effects that were found and any functions of speed and
    position. Effects can be found for any u; they do not explain it elsewhere.
    """
    part = search.excerpt or search
    problem, fit = part.problem, part.fit(whole.terms, whole.tap)
    fits = freeform_fits(problem.errors.bank, part.equations, problem.blocks, fit, part.solver.inertia)
    groups = [group for group in (("velocity",), ("position",)) if group in fits.groups()]
    shares = (fits.share_of_u(groups[:count]) for count in range(len(groups), -1, -1))  # a run up is at each place once
    told = max(shares)
    if search.solver.inverse:  # the held-out error of the set is that of u by the motion, of all rows
        errors = search.problem.errors
        u = errors.bank.command((), whole.tap)[search.equations.kept]
        told = max(told, 1.0 - (errors.rmse(whole) / max(float(np.std(u)), 1e-300)) ** 2)
    return told
