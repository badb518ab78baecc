"""What no motion identifies: explanations that u cannot move or hold, and what the best of all motions that were tried
would need more time for than anyone has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from dsd_cli.design.inverse import Path, actuated, command_for
from dsd_cli.design.limits import TooNarrowError
from dsd_cli.design.measure import ENOUGH, Measure
from dsd_cli.design.motions import ROOM, MotionSegment, Room, position_of
from dsd_cli.design.optimise import Sized
from dsd_cli.design.results import Impossible
from dsd_cli.design.targets import GAIN, Targets, apart, within_reach
from dsd_cli.design.verified import GENTLE
from dsd_cli.effects import find_effect, told_apart
from dsd_cli.errors import DataError
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA, Diagnosis, Unexplained
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import PlantModel
from dsd_cli.plant.motion import Plant

#: Places at which an axis is held; share of the inertia below which a motor beside its load is next to nothing.
_PLACES, _NO_MOTOR = 50, 1e-3
#: s of the motion that tells most, and the nats that it has to reach in that time.
_PATIENCE, _LEAST = 120.0, 6.0
_NO_LAW = "no effect of the catalogue describes it: log what it may depend on, or write it as your own (--effects-from)"
_GAIN_TOLD = "weigh a mass, mount it and hold its inertia in the next fit (--fix inertia=...), or measure u as a force"


def not_by_motion(search: Search, targets: Targets, diagnosis: Diagnosis | None) -> list[Impossible]:
    """What a motion cannot identify by the form of the balance, or for want of a channel.

    u = J a - forces: with all of J and the forces a times as large, and u too, it is the same balance. So the gain of
    the drive is identifiable only where one of them is known without u.
    """
    found = []
    held = set(search.solver.known.fixed) | set(search.solver.known.priors)
    asked = GAIN in targets.asked or (diagnosis is not None and diagnosis.verdict == INERTIA)
    if asked and not any(name != DELAY for name in held):
        found.append(Impossible("the gain of the drive (the unit of u) or the inertia", _GAIN_TOLD))
    # what a poor log cannot test for want of motion the next may show
    lacking = {reason for log in search.problem.recordings for reason in log.missing.values()}
    for name, reason in search.problem.untestable.items():
        if reason in lacking and (not targets.asked or name in targets.asked):
            found.append(Impossible(name, reason))
    more = diagnosis.unexplained if diagnosis is not None and not (targets.asked or targets.unknown) else Unexplained()
    if more.probability >= POLICY.even:
        found.append(Impossible(f"what stays unexplained, {100.0 * more.share_of_u:.0f} % of u", _NO_LAW))
    return found


def able_to_move(
    targets: Targets, room: Room, believed: PlantModel, sample_time: float, *, far: bool = False
) -> Targets:
    """Without explanations by which u, within its limit or what it reached in the logs, could not begin to move the
    axis, or, where their values are weak, not hold it wherever the limits let it stand or pass: forces that cancel out
    where a poor log has been, an asymmetry that a crawl leaves open. And without those whose motor is next to nothing
    of the inertia and swings faster than samples show: no log speaks for that, and its simulation takes minutes.

    Where nobody knows what is missing the first stays without its draws, which have the forces of the model as fitted,
    if they are no axis; believed : the user's model, if it is none itself.
    far : whether that is far from where the logs were, and nobody asked for what: a weight there is a cogging as well.

    Raises
    ------
    DataError : the first of them is one. TooNarrowError : only the limit of u makes it one.
    """
    gentle = position_of(MotionSegment("harmonics", 4.0, (0.0, 1.0, 0.5, 0.0), scale=GENTLE), room)
    path, allowed = Path.of(gentle, room.step), room.limits.u
    still = Path(1.0, np.linspace(room.limits.low, room.limits.high, _PLACES), np.zeros(_PLACES), np.zeros(_PLACES))
    reached = allowed if room.reached is None else max(allowed, room.reached.u)

    def holds(plant: PlantModel, most: float, speed: float = 0.0) -> bool:
        ways = ((way, replace(still, velocity=np.full(_PLACES, way * speed))) for way in (1.0, -1.0))
        return all(float((way * command_for(plant, there, 3.0 * most)).min()) > -most for way, there in ways)

    def moves(plant: PlantModel, most: float, *, weak: bool = False) -> bool:
        bare = plant.motor_inertia < _NO_MOTOR * plant.inertia
        if bare and Plant(plant).resonance * sample_time > math.pi:
            return False
        u = command_for(plant, path, 3.0 * most)
        passed = actuated(plant, u, path.step).any()  # a dead zone beyond what saturates lets none of it act
        held = not weak or all(holds(plant, most, speed) for speed in (0.0, room.limits.velocity))
        return bool(passed) and held and float(np.abs(u).max()) < ROOM * most

    if far and not holds(targets.explanations[0].fitted, reached):
        raise DataError("u could not hold this axis where its limits let it stand", "give narrower --limit position")
    if targets.unknown:
        first, *others = targets.explanations
        if not all(moves(x, reached, weak=first.weak) for x in first.draws[1:]):  # as fitted it is no axis
            first = replace(first, draws=first.draws[:1] if moves(first.fitted, reached) else (believed,))
        targets = replace(targets, explanations=(replace(first, weak=False), *others))
    able = [moves(e.fitted, reached, weak=e.weak) for e in targets.explanations]
    if not moves(targets.explanations[0].fitted, allowed, weak=targets.explanations[0].weak):
        said = f"u within {allowed:.3g}, its limit less its noise in the logs, does not move this axis"
        raise (TooNarrowError if able[0] else DataError)(said, "widen --limit u, or take another --start")
    return within_reach(targets, able)


def beyond_u(asked: Targets, able: Targets) -> list[Impossible]:
    """Pairs that the user asked for, one side of which u cannot move as the logs have it: no motion is for them."""
    names, left = [[e.name for e in some.explanations] for some in (asked, able)]
    gone = [(names[a], names[b]) for a, b in asked.pairs if not {names[a], names[b]} <= {*left}]
    remedy = "u within its limit cannot move or hold the axis with one of them: take a log that moves more"
    return [Impossible(" or ".join(apart(*pair)), remedy) for pair in gone] if asked.asked else []


def told_by_none(measure: Measure, library: Sequence[Sized]) -> tuple[list[Impossible], Measure]:
    """Targets that no motion of the library identifies in two minutes, and the measure without them; without any where
    the logs hold all others already: then no motion is of use."""
    best: dict[str, float] = {}
    for one in library:
        times = max(_PATIENCE / one.part.seconds, 1.0)
        for name, nats in measure.nats(measure.expected(times * one.products)).items():
            best[name] = max(best.get(name, 0.0), nats)
    lost = [name for name in measure.open if best.get(name, 0.0) < _LEAST]
    once = [name for name in sorted(lost) if _turned(name) not in lost or name <= _turned(name)]  # not both directions
    rest = measure.without(lost)
    if lost and rest.open and rest.smallest(rest.nothing) >= ENOUGH:
        rest = rest.without(tuple(rest.open))
    return [Impossible(*_said(name, lost)) for name in once], rest


def _turned(name: str) -> str:
    """ "a, not b" -> "b, not a"; a value's name stays."""
    return ", not ".join(reversed(name.split(", not ")))


def _said(name: str, lost: Sequence[str]) -> tuple[str, str]:
    """(what, remedy)."""
    sides = name.split(", not ")
    if len(sides) == 2 and _turned(name) in lost:
        return " or ".join(sides), _remedy(sides)
    if len(sides) == 2:
        return name, f"{sides[1]} can take a form that is {sides[0]} within the limits; not the other way round"
    return name, _remedy(sides)


def _remedy(names: Sequence[str]) -> str:
    """What would settle it: the experiment of the effect's own file, where it knows one."""
    sides = [[part for part in side.split(" + ") if find_effect(part)] for side in names]
    if len(sides) == 2:
        for a, b in product(*sides):
            if told := told_apart(a, b):
                return f"{told}; no motion within the limits does it: change the mass or the load, or widen them"
    return "change the mass or the load, widen the limits, or take a finer sensor"
