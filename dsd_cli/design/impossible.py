"""What no motion identifies, found by trying: the best of all that were tried would need more time than anyone has."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from dsd_cli.design.measure import ENOUGH, Measure
from dsd_cli.design.optimise import Sized
from dsd_cli.design.results import Impossible
from dsd_cli.design.targets import GAIN, Targets, apart
from dsd_cli.effects import catalogue, find_effect, kind_of
from dsd_cli.identify.results import DELAY, INERTIA, Diagnosis
from dsd_cli.identify.search.sets import Search

#: s of the motion that tells most, and the nats that it has to reach in that time.
_PATIENCE, _LEAST = 120.0, 6.0
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
    return found


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


def beyond_u(asked: Targets, able: Targets) -> list[Impossible]:
    """Pairs that the user asked for, one side of which u cannot move as the logs have it: no motion is for them."""
    names, left = [[e.name for e in some.explanations] for some in (asked, able)]
    gone = [(names[a], names[b]) for a, b in asked.pairs if not {names[a], names[b]} <= {*left}]
    remedy = "as these logs have them, u within its limit does not move the axis with one: take a log that moves more"
    return [Impossible(" or ".join(apart(*pair)), remedy) for pair in gone] if asked.asked else []


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
    sides = [[kind_of(part) for part in side.split(" + ") if find_effect(part)] for side in names]
    if len(sides) == 2:
        for a, b in product(*sides):
            told = catalogue()[a].told_apart.get(b) or catalogue()[b].told_apart.get(a)
            if told:
                return f"{told}; no motion within the limits does it: change the mass or the load, or widen them"
    return "change the mass or the load, widen the limits, or take a finer sensor"
