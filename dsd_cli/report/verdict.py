"""The verdict of a diagnosis as one plain sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from dsd_cli.effects import delays_command, get_effect
from dsd_cli.effects.base import Role
from dsd_cli.identify.fit.freeform import GAIN
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN, Candidate, Diagnosis
from dsd_cli.identify.verdict.contradictions import kept_values
from dsd_cli.plant.model import PlantModel
from dsd_cli.report.levels import levels_text
from dsd_cli.report.names import error, force_error, listed, moves, percent, values_text
from dsd_cli.report.prior_conflicts import first_of_all
from dsd_cli.report.two_numbers import believed
from dsd_cli.signals.sources import only_channel
from dsd_cli.signals.units import Units

#: What a force that depends on the place is called depends on the unit of that.
ASSUMED = (
    "so called with the position in rad or m, which nothing says: in degrees or turns the same force has another name"
    " of gravity, stiffness and cogging (signals.position_unit decides)"
)

#: What shows whether u is late or the only channel of the motion: a step of u looks the same with either.
_TO_SETTLE = {
    "velocity": "log the raw position beside it, or look up the speed filter of the drive; steps of u do not show it",
    "position": "log another sensor's speed beside it, or look up how late the sensor is; steps of u do not show it",
}

#: Volts or a duty below which a drive or a valve does nothing, where the axis is nearly all friction.
_DEAD_ZONE = (
    ", or a dead zone of the drive: indistinguishable where u has the sign of the motion nearly all the time; a weight"
    " that moves the axis against u, or faster reversals, would show which"
)


def verdict_line(result: Diagnosis, given: PlantModel | None = None) -> str:
    """The verdict in one plain sentence; `given`: the model whose inertia or delay may be wrong."""
    return _verdict(result, given) + levels_text(result.levels) + first_of_all(result)


def _verdict(result: Diagnosis, given: PlantModel | None) -> str:
    sure = f"probability {percent(result.probability)}"
    held, unit = f"the held-out {force_error(result.band_hz)}", result.units.force
    if result.verdict == NONE:
        return _nothing(result, sure, held)
    if result.blocked:
        return (
            f"{result.blocked} ({sure}): what is missing is not identifiable before that is mended;"
            f" {held} is {error(result.refitted.heldout_rmse)} ({unit})"
        )
    if result.verdict == UNKNOWN:
        return _wrong_beside(result, given) + _unknown(result, sure, held)
    winner = candidate(result, result.verdict)
    if winner is None:
        return f"{result.verdict} is missing ({sure})"
    stands = _in_its_place(result, winner)
    own = {f"{stands}.{n}" if stands != winner.effect else n: x for n, x in result.joint_values(stands).items()}
    values = values_text(own or result.alone(winner))
    values = f"{values}, " if values else ""
    beside, falls = _with_the_set(result, winner)
    tied = winner.indistinguishable_from  # one of these it is
    placed = of_place((winner.effect, *result.found), result.units)
    more, on = result.unexplained, f" over {listed(result.unexplained.on)}" if result.unexplained.on else ""
    if not believed(result.probability) and more.probability > result.probability:
        sure += f", less than of a force{on} that no effect of the catalogue describes, {percent(more.probability)}"
    verb = "is" if believed(result.probability) else "may be"
    if winner.effect in (INERTIA, DELAY) or (given is not None and winner.effect in given.effects):
        line = f"{_as_given(winner, given)} of [model] {verb} wrong: {values}{sure}{beside}; {held} {falls}"
    else:
        name = winner.effect if stands == winner.effect else f"{winner.effect} or {stands}"
        line = f"{name} {verb} missing: {values}{sure}{beside}; {held} {falls}"
    line += f"; from this log it is indistinguishable from {listed(tied, 'or')}" if tied else ""
    line += late_text(dict.fromkeys((winner.effect, *tied, *result.found)), result.provenance)
    return line + (f"; {assumed_text(placed)}" if placed else "")


def _wrong(result: Diagnosis) -> list[Candidate]:
    """The value of the model that is wrong beside something unknown."""
    own = [one.effect for one in result.missing if result.verdict == UNKNOWN and one.effect not in result.found]
    return [c for name in own if (c := candidate(result, name)) is not None]


def _wrong_beside(result: Diagnosis, given: PlantModel | None) -> str:
    """A beginning for a sentence: the value of the model that is wrong, whatever else is missing; "" without one."""
    said = (
        f"{_as_given(c, given)} of [model] is wrong: {values_text(result.alone(c))}, probability"
        f" {percent(c.probability)}, and the held-out {force_error(result.band_hz)}"
        f" {moves(c.heldout_rmse_before, c.heldout_rmse_after)} ({result.units.force})"
        f"{', indistinguishable from ' + listed(c.indistinguishable_from, 'or') if c.indistinguishable_from else ''}"
        "; besides, "
        for c in _wrong(result)
    )
    return "".join(said)


def _unknown(result: Diagnosis, sure: str, held: str) -> str:
    """That something is missing, on what it depends, and what comes nearest to it."""
    on = f"; it {_depends(result.depends_on)}" if result.depends_on else ""
    left = f"{held} is {error(result.refitted.heldout_rmse)} ({result.units.force})"
    if kept := kept_values(result.warnings):
        return f"with {listed(kept)} as given, something is left that no effect explains{on} ({sure}): {left}"
    near = candidate(result, result.nearest)
    if near is not None and near.effect not in result.found:
        falls = percent(1.0 - near.heldout_rmse_after / near.heldout_rmse_before)
        return (
            f"something is missing, and this log does not confirm what{on} ({sure}): {left};"
            f" {near.effect} comes nearest ({falls} less), but not in all parts of the log"
        )
    line = f"something is missing that no effect of the catalogue explains{on} ({sure}): {left}"
    return line + (f"; nearest in the catalogue: {near.effect}, {percent(near.probability)}" if near else "")


def late_text(effects: Iterable[str], provenance: Mapping[str, str]) -> str:
    """An end for a sentence: what of these makes u late may be of the sensor as well, where u and one channel are all
    that is logged of an axis; "" else.

    Linear laws commute: what filters or delays the measured motion does as much to u.
    """
    channel, late = only_channel(provenance), [name for name in effects if delays_command(name)]
    if not channel or not late:
        return ""
    return (
        f"; or the measured {channel} is filtered or late by as much as that ({listed(late, 'or')}): u and one motion"
        " channel cannot show which"
    )


def once_late(checked: Iterable[str], found: Iterable[str]) -> tuple[str, ...]:
    """Warnings of the check and of the search: a u that the search finds late or smoothed is said once, by its number.

    The check has it from the acceleration alone, the search from all forces that it found.
    """
    said = tuple(found)
    late = any(one.startswith(("u is later than the motion", "u is smoothed by")) for one in said)
    return (*(one for one in checked if not (late and "later than the motion it causes" in one)), *said)


def advice_of(result: Diagnosis) -> tuple[str, ...]:
    """What to do next, the most useful first: where u may be late or the only channel of the motion, what shows it."""
    channel, named = only_channel(result.provenance), (result.verdict, *result.found)
    late = bool(channel) and any(map(delays_command, named))
    settle = (f"is u late, or the measured {channel}? {_TO_SETTLE[channel]}",) if late else ()
    # sgn u is sgn v where friction is nearly all of u
    effects = (n for n in named if n not in (NONE, UNKNOWN, INERTIA, DELAY))
    rubs = next((n for n in effects if get_effect(n).role is Role.FRICTION), "")
    alike = rubs and result.inverse and not result.units.is_force
    again = ("dsd improve LOG -o FILE fits all values of the model again",) if _wrong(result) else ()
    return (*settle, *((rubs + _DEAD_ZONE,) if alike else ()), *again, *result.advice)


def _in_its_place(result: Diagnosis, winner: Candidate) -> str:
    """The effect of the set in whose place a commoner one is named that fits as well; else the one that is named."""
    there = (name for name in winner.indistinguishable_from if name in result.found)
    return winner.effect if winner.effect in result.found else next(there, winner.effect)


#: Below this probability no effect is named as one that may be missing.
_NAMED = math.exp(-POLICY.effect_price)


def _with_the_set(result: Diagnosis, winner: Candidate) -> tuple[str, str]:
    """(the others that are missing or may be, how the held-out error moves with all and this one alone)."""
    same = {winner.effect, _in_its_place(result, winner)}
    unit, others = result.units.force, [name for name in result.found if name not in same]
    alone = moves(winner.heldout_rmse_before, winner.heldout_rmse_after)
    if not result.whole_values or not others:
        return "", f"{alone} ({unit})"
    together = moves(result.refitted.heldout_rmse, result.whole_heldout_rmse)
    only = f"with {winner.effect} alone it {alone}"
    only += ", for it shows only beside the others" if alone.startswith("rises") else ""
    # of several of a kind the ranking has the first alone
    likely = {one.effect: one.probability for one in result.ranking}
    likely |= {one.effect: one.probability for one in result.missing}
    sure = [name for name in others if name not in likely or believed(likely[name])]
    rest = sorted((name for name in others if name not in sure), key=lambda name: -likely[name])
    perhaps = [f"{name} ({percent(likely[name])})" for name in rest if likely[name] >= _NAMED]
    beside = f", and so {'is' if len(sure) == 1 else 'are'} {listed(sure)}" if sure else ""
    beside += f", and perhaps {listed(perhaps)}" if perhaps else ""
    return beside, f"{together} with all of these in the model ({unit}); {only}"


def _depends(channels: Sequence[str]) -> str:
    """On what the force that no effect explains depends, as a verb."""
    others = [name for name in channels if name != GAIN]
    return f"{'depends on' if len(others) == len(channels) else 'is u times a function of'} {listed(others)}"


def _nothing(result: Diagnosis, sure: str, held: str) -> str:
    """That nothing is missing; of logs that were held out, whether that holds for them as well."""
    unit, left = result.units.force, result.refitted.heldout_rmse
    sure_enough = believed(result.probability)
    said = f"{'nothing' if sure_enough else 'perhaps nothing'} is missing ({sure})"
    noise = "is noise" if sure_enough else "may be noise"
    if result.at_stops:
        hidden = "most of what the fit leaves is from stops and creeping, where a missing effect would not show"
        return f"{said}, as far as this log shows: {hidden}; {held} is {error(left)} ({unit})"
    own = result.refitted.rmse
    if not result.held_out or left <= POLICY.floor_factor * max(own, result.floor):
        return f"{said}: {held}, {error(left)} ({unit}), {noise}"
    force, names = force_error(result.band_hz), listed(result.held_out)
    return (
        f"{said} in {listed(result.logs)}: the {force}, {error(own)} ({unit}), {noise};"
        f" in {names}, which no fit saw, it is {error(left)}: a value differs there,"
        f" or an effect shows"
    )


def of_place(effects: Iterable[str], units: Units) -> list[str]:
    """Those whose force is a function of a position whose unit nothing says."""
    found = {name: get_effect(name) for name in effects if units.assumed and name not in (INERTIA, DELAY)}
    return [name for name, one in found.items() if one.role is Role.APPLIED and "position" in one.needs]


def assumed_text(placed: Sequence[str]) -> str:
    """What that means for their names."""
    return f"{listed(placed)} {'is' if len(placed) == 1 else 'are'} {ASSUMED}"


def _as_given(winner: Candidate, given: PlantModel | None) -> str:
    """A value of the model and what it is there; of an effect with several values its name."""
    if given is None or len(winner.parameters) != 1:
        return winner.effect
    own = winner.effect in (INERTIA, DELAY)
    (name,) = winner.parameters
    value = getattr(given, winner.effect) if own else given.effects[winner.effect][name]
    return f"{winner.effect if own else f'{winner.effect}.{name}'} {value:.4g}"


def candidate(result: Diagnosis, effect: str) -> Candidate | None:
    """The candidate of that id."""
    return next((c for c in result.ranking if c.effect == effect), None)
