"""What a log itself must have before any verdict on it can be sure: a u that acts when it is logged; a direction. And
what to do next: the experiment that distinguishes two effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.effects import told_apart
from dsd_cli.identify.fit.freeform import GAIN
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings, constant_u
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN, Candidate
from dsd_cli.identify.search.seen import Seen
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.command_time import CommandTime, command_time
from dsd_cli.identify.verdict.discrepancy import in_common
from dsd_cli.identify.verdict.unacted_command import UnactedCommand, idle_part
from dsd_cli.signals.units import PER_UNIT

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
        return "" if self.time.explained else self.time.said

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
        elif self.time.said:
            key = "u_filter" if self.time.smoothed else "u_shift"
            found.append(f"{self.time.question} Undo it by signals.{key} and ask again")
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
    recordings = search.problem.recordings
    constant = constant_u(recordings)
    # where the log is against a value that was given, u was neither late nor smoothed with none given
    timed = not (settings.against or constant or common < _LEAST_IN_COMMON)
    time = command_time(search, whole, settings) if timed else CommandTime()
    if seen is not None and time.smoothed:  # a motor leads u by what swings above the band, too
        time = replace(time, alike=False)
    passed = tuple((r.name, r.lost.hz) for r in recordings if math.isfinite(r.lost.hz))
    return Limits(common, idle, time, direction, constant, passed)


_GENERAL = "move at constant speed both ways, slowly and fast, over the whole travel, with a rest between the moves"


def advice_for(
    verdict: str,
    named: Candidate | None,
    more_unknown: bool,
    depends_on: Sequence[str],
    provenance: Mapping[str, str],
    nearest: str = "",
    own: bool = False,
) -> tuple[str, ...]:
    """Sentences, the most useful first; nearest : see `Diagnosis`. own : the model has the effect."""
    lines = []
    alike: dict[str, list[str]] = {}
    for rival in named.indistinguishable_from if named is not None else ():
        alike.setdefault(told_apart(verdict, rival) or _GENERAL, [verdict]).append(rival)
    lines += [f"{' or '.join(names)}? {experiment}" for experiment, names in alike.items()]
    if nearest:
        lines.append(f"to see whether it is {nearest}, record a longer log: {_GENERAL}")
    if verdict == UNKNOWN:
        lines.append(_look_at(depends_on))
        lines.append("if you know a law for it, write it as an effect and pass it with --effects-from")
    elif verdict != NONE and more_unknown:
        lines.append("this is not all: something else remains that no effect of the catalogue explains")
    if verdict not in (NONE, UNKNOWN, INERTIA, DELAY) and not lines:
        again = "dsd improve LOG -o FILE fits all values of the model again"
        lines.append(again if own else f"dsd add LOG {verdict} -o FILE puts it into the model")
    if verdict != NONE:
        lines.append(PER_UNIT)
    if "reconstructed" in provenance.get("velocity", ""):
        lines.append("speed and position were reconstructed from u and d_hat: log the position to be surer")
    return tuple(lines)


def _look_at(depends_on: Sequence[str]) -> str:
    channels = [name for name in depends_on if name != GAIN]
    over = " and ".join(channels) or "time"
    if GAIN in depends_on:
        return f"u moves the axis more at times, by {over}: does the inertia, the load or the gain of the drive vary?"
    return f"look at the residual over {over}" + (" (dsd compare --plot)" if channels else "")
