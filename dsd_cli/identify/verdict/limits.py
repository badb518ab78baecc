"""What a log itself must have before any verdict on it can be sure: a u that acts when it is logged; a direction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.seen import Seen
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.axis_match import AxisMatch, axis_match
from dsd_cli.identify.verdict.command_time import CommandTime, command_time
from dsd_cli.identify.verdict.unacted_command import UnactedCommand, idle_part


@dataclass(frozen=True)
class Limits:
    """common : what u and the motion have in common. idle : a part of u that did not act. time : whether u is late or
    smoothed. direction : share of the samples in motion whose direction the sensor shows, 0 to 1."""

    common: AxisMatch
    idle: UnactedCommand | None
    time: CommandTime
    direction: float

    @property
    def surest(self) -> float:
        """Upper bound on the probability of any verdict."""
        return POLICY.surest if self.direction >= POLICY.least_told_direction else POLICY.surest_untold

    @property
    def blocked(self) -> str:
        """What must be mended before anything that is missing can be identified; "" if nothing."""
        if self.common.lacking:
            return self.common.lacking
        if self.idle is not None:
            return f"{self.idle.what} did not act on the axis"
        if self.time.late:
            return f"u is later than the motion that it causes, by about {self.time.late * 1e3:.2g} ms"
        return _smoothed(self.time) if self.time.smoothed and not self.time.explained else ""

    @property
    def said(self) -> tuple[str, ...]:
        """One sentence each."""
        found = []
        if self.common.lacking:
            found.append(self.common.said)
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
        idle, common = None, AxisMatch(1.0, search.problem.blocks.rows)
    else:
        idle, common = idle_part(search, whole, settings, seen), axis_match(search, whole)
    return Limits(common, idle, command_time(search, whole, settings), direction)
