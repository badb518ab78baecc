"""From a search over logs to the motion that identifies what they leave open: optimised, run under the loop, judged."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dsd_cli.design.closed_loop import Loop, Run, usual_loops
from dsd_cli.design.expectation import Expected
from dsd_cli.design.explanations import grown
from dsd_cli.design.impossible import able_to_move, beyond_u, not_by_motion, told_by_none
from dsd_cli.design.inverse import Path, command_for
from dsd_cli.design.limits import Limits, TooNarrowError, limits_of, slowed, unvisited, used
from dsd_cli.design.measure import ENOUGH, Measure
from dsd_cli.design.motions import ROOM, MotionSegment, Room, generator_values
from dsd_cli.design.next_log import expected_of
from dsd_cli.design.optimise import TIMES, Sized, joined, library_of, optimised
from dsd_cli.design.results import Impossible, Motion, Plan, PlannedPair, PlannedValue, Stage
from dsd_cli.design.rows import LONGEST_STEP
from dsd_cli.design.seen import as_logged
from dsd_cli.design.targets import Targets, apart, targets_of
from dsd_cli.design.verified import FOLLOWED, plants_of, verified
from dsd_cli.errors import DataError
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.results import Diagnosis
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.task import Progress
from dsd_cli.plant.controllers import ControllerSettings
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Array

#: Plants of each explanation in the search, and for what is said.
_DRAWS_IN_SEARCH, _DRAWS_SAID = 2, 4
#: s of a motion of which nobody said how long, and of one where nobody knows what is missing either.
_USUAL = 10.0, 20.0
#: rad at the pace of a described loop that a sample has at most, where it is longer than one of the log.
_SLOW = 0.02


@dataclass(frozen=True)
class Wanted:
    """What the user asks for.

    names : effects and values; () for what the logs leave open. seconds : lengths that are tried, the first that is
    enough is taken; () for the usual one. limits : name -> (low, high); start : position of rest, NaN for the middle.
    controller : None for a usual one. rate : s between samples of the motion, NaN for that of the logs.
    """

    names: tuple[str, ...] = ()
    seconds: tuple[float, ...] = ()
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    start: float = math.nan
    controller: ControllerSettings | None = None
    rate: float = math.nan


def plan_next(
    search: Search,
    whole: Fit,
    diagnosis: Diagnosis | None,
    observer: ObserverSettings,
    wanted: Wanted,
    report: Progress = lambda _what, _share: None,
) -> Plan:
    """The next motion.

    search, whole : over the logs, and the set that it found. diagnosis : of it; None where names are asked for.

    Raises
    ------
    UsageError : limits or names that make no sense. DataError : the axis cannot be held within the limit of u.
    """
    limits = limits_of(search.problem.recordings, wanted.limits, wanted.start, search.equations.band.hz)
    room = Room.within(limits, search.equations, search.problem.recordings, max(wanted.seconds or _USUAL))
    asked = _Asked(search, observer, wanted, room, limits, diagnosis)
    targets = targets_of(search, whole, diagnosis, wanted.names, start=limits.start)
    further = unvisited(limits, search.problem.recordings) if targets.nothing and not wanted.names else ()
    if further:
        note = f"nothing is left open where the logs have been: the motion is for the {' and '.join(further)} beyond"
    else:
        try:
            return asked.planned(targets, report)
        except TooNarrowError:
            raise
        except DataError:
            if diagnosis is None or wanted.names or targets.unknown:
                raise
        # effects that no motion can be planned for are none, as forces a hundred times u that cancel out in a slow log
        note = f"no motion keeps the limits if {targets.explanations[0].name} is right: planned as with unknown"
    plan = asked.planned(targets_of(search, whole, diagnosis, doubted=True, start=limits.start), report)
    return replace(plan, warnings=(*plan.warnings, note))


@dataclass(frozen=True)
class _Asked:
    """What a plan is made of, but for its targets. limits : that were asked for; in the room without the noise of u."""

    search: Search
    observer: ObserverSettings
    wanted: Wanted
    room: Room
    limits: Limits
    diagnosis: Diagnosis | None

    def planned(self, targets: Targets, report: Progress) -> Plan:
        """The plan for these targets.

        Raises
        ------
        DataError : u cannot move the axis, or no motion keeps the limits.
        """
        search, wanted, room = self.search, self.wanted, self.room
        names, problem, asked = [e.name for e in targets.explanations], search.problem, targets
        far = not targets.unknown and not wanted.names and "position" in unvisited(self.limits, problem.recordings)
        if not asked.nothing:
            targets = able_to_move(asked, room, problem.model, problem.recordings[0].sample_time, far=far)
        report("looking at motions", 0.1)
        impossible = [*not_by_motion(search, targets, self.diagnosis), *beyond_u(asked, targets)]
        measure = Measure(search, targets, _DRAWS_IN_SEARCH, limits=self.limits)
        if targets.nothing:
            return self._answer(None, measure, measure.expected(measure.nothing), impossible)
        lengths = wanted.seconds or (_USUAL[targets.unknown],)
        library = library_of(measure, room, lengths[0], lambda x: report("looking at motions", 0.1 + 0.4 * x))
        if not library:
            said = "no motion keeps the limits", "widen them; holding the axis may need more u than allowed"
            raise (TooNarrowError if room.reached and room.reached.u > self.limits.u else DataError)(*said)
        more, measure = told_by_none(measure, library)
        impossible += more
        if not (measure.open or targets.unknown):
            return self._answer(None, measure, measure.expected(measure.nothing), impossible)
        measure = measure.sized_by([(1.0 / one.part.seconds) * one.products for one in library])
        seconds, parts, cost = _enough(measure, room, lengths, library, report)
        report("under the loop", 0.8)
        found, smallest, lost = self._verified(measure, parts, impossible)
        counted = {e.name for e in targets.explanations} - set(lost)
        return replace(
            found,
            cost=tuple(sorted({**cost, seconds: smallest}.items())),
            not_counted=tuple(name for name in names if name not in counted),
        )

    def _loops(self, measure: Measure) -> tuple[Loop, ...]:
        """The loop that is described, or usual ones, in samples as long as motions have, where none acts faster."""
        law, coarse = self.wanted.controller, self.room.step * max(int(LONGEST_STEP / self.room.step), 1)
        first, *others = (measure.targets.explanations[i].fitted for i in {0, *measure.likely})
        if law is None:
            slowest = max(self.search.problem.model.delay, first.delay, *(plant.delay for plant in others))
            return usual_loops(replace(first, delay=slowest), self.observer, coarse)
        step = coarse if coarse * law.pace(min(p.inertia for p in (first, *others))) <= _SLOW else self.room.step
        return (Loop(law, replace(self.observer, sign=1), step, described=True),)

    def _verified(
        self, measure: Measure, parts: tuple[MotionSegment, ...], impossible: Sequence[Impossible]
    ) -> tuple[Plan, float, Sequence[str]]:
        """(the motion so small that every plant keeps the limits under the loop, scored by what they did there; its
        smallest nats; explanations that are none).

        Raises
        ------
        DataError : however small, a plant breaks a limit.
        """
        room, loops, targets, most = self.room, self._loops(measure), measure.targets, self.room.limits.u
        allowed = room.limits if self.wanted.controller else slowed(room.limits, ROOM)  # other gains answer differently
        targets = replace(targets, grown=grown(self.search, targets.explanations[0], room.limits, loops[-1]))
        plants, led = plants_of(targets, measure.likely, joined(parts, room), room, loops, measure.leading)
        kept = verified(targets, plants, led, parts, room, loops, allowed)
        whole, first = TIMES * kept.parts, kept.runs[0, 0, 0]
        like, position = measure.like, joined(whole, room)
        if np.ptp(first.path.position) < FOLLOWED * np.ptp(position):
            raise TooNarrowError("within the limits u does not break friction away", "widen --limit u")
        if not as_logged(like.template, first.path, first.u, like.rest_speed).pieces[0]["velocity"].any():
            raise TooNarrowError("within the limits a motion is so small that no sensor shows it", "widen them")
        motion = _motion(measure, led, position, room, self.wanted)
        seen = used(self.limits, motion.position, motion.velocity, motion.u)  # the search takes shapes of rivals by it
        told = Measure(self.search, targets, 1, measure.open, seen)
        paths = {i: run.path.resampled(room.step) for (i, draw, loop), run in kept.runs.items() if draw == loop == 0}
        expected = expected_of(told, paths, most, _DRAWS_SAID)
        found = replace(
            self._answer(motion, told, expected, impossible),
            stages=_stages(whole, room, _steps_of_delay(measure, room) * room.step),
            reached=_reached(list(kept.runs.values())),
            warnings=kept.unstable,
        )
        return found, _smallest(measure, paths, most, expected), kept.lost

    def _answer(
        self, motion: Motion | None, measure: Measure, expected: Expected, impossible: Sequence[Impossible]
    ) -> Plan:
        """With what is expected of the motion."""
        targets, none, now = measure.targets, [e.name for e in measure.targets.explanations], measure.now
        pairs = tuple(
            PlannedPair(
                *apart(none[a], none[b]),
                now[a, b] if (a, b) in now else -now[b, a],
                expected.nats[way],
                expected.nats.get((a, b), math.nan),
                expected.nats.get((b, a), math.nan),
                *expected.ranges.get(way, (math.nan, math.nan)),
            )
            for a, b in targets.pairs
            for way in [measure.told_apart(expected, a, b)]
        )
        units = {} if not targets.values else self.search.problem.values(targets.explanations[0].fit).estimates
        values = tuple(
            PlannedValue(v.name, units[v.name].value, units[v.name].unit, v.error, expected.errors[v.name])
            for v in targets.values
        )
        return Plan(
            logs=tuple(r.name for r in self.search.problem.recordings),
            verdict="" if self.diagnosis is None else self.diagnosis.verdict,
            motion=motion,
            stages=(),
            pairs=pairs,
            values=values,
            limits=self.limits,
            impossible=tuple(impossible),
            band_hz=self.search.equations.band.hz,
        )


def _enough(
    measure: Measure, room: Room, lengths: Sequence[float], library: Sequence[Sized], report: Progress
) -> tuple[float, tuple[MotionSegment, ...], dict[float, float]]:
    """(first length that is enough, or the last; different parts of it; length -> smallest nats, of several)."""
    found, cost = [], {}
    for i, seconds in enumerate(lengths):
        library = library_of(measure, room, seconds) if i else library  # parts are as long as the plan asks
        parts = optimised(measure, room, seconds, library)
        paths, most = {0: Path.of(joined(TIMES * parts, room), room.step)}, room.limits.u
        found.append(parts)
        if len(lengths) > 1:
            cost[seconds] = _smallest(measure, paths, most, expected_of(measure, paths, most, 1))
        report("choosing the motion", 0.5 + 0.3 * (i + 1) / len(lengths))
    enough = next((i for i, nats in enumerate(cost.values()) if nats >= ENOUGH), len(found) - 1)
    return lengths[enough], found[enough], cost


def _smallest(measure: Measure, paths: Mapping[int, Path], most: float, expected: Expected) -> float:
    """Nats of what a motion identifies least; where nothing is asked for, of the catalogue."""
    return measure.least(expected) if measure.open else measure.smallest(measure.of_paths(paths, most))


def _motion(measure: Measure, led: PlantModel, position: Array, room: Room, wanted: Wanted) -> Motion:
    """The reference at the samples of the user's controller: at rest until u can act, so that it begins with the u that
    holds the axis there."""
    step = measure.like.template.sample_time if math.isnan(wanted.rate) else wanted.rate
    path = Path.of(np.pad(position, (_steps_of_delay(measure, room), 0), mode="edge"), room.step).resampled(step)
    u = np.clip(command_for(led, path), -room.limits.u, room.limits.u)
    return Motion(step, path.position, path.velocity, np.gradient(path.velocity, step), u)


def _steps_of_delay(measure: Measure, room: Room) -> int:
    return math.ceil(measure.longest_delay / room.step) + 3  # of a speed by differences two steps more are at rest


def _stages(parts: Sequence[MotionSegment], room: Room, at: float) -> tuple[Stage, ...]:
    ends = (at + room.step * np.cumsum([0, *(part.samples(room.step) for part in parts)])).tolist()
    each = zip(parts, ends, ends[1:], strict=False)
    return tuple(Stage(part.kind, start, end, generator_values(part, room)) for part, start, end in each)


def _reached(runs: Sequence[Run]) -> dict[str, float]:
    return {
        "position_low": min(float(r.path.position.min()) for r in runs),
        "position_high": max(float(r.path.position.max()) for r in runs),
        "velocity": max(float(np.abs(r.path.velocity).max()) for r in runs),
        "u": max(float(np.abs(r.u).max()) for r in runs),
    }
