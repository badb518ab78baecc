"""Which explanations could be this axis at all: u has to move it, and to hold it where its limits let it stand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dsd_cli.design.explanations import Explanation
from dsd_cli.design.inverse import Path, actuated, command_for
from dsd_cli.design.limits import TooNarrowError
from dsd_cli.design.motions import ROOM, Part, Room, position_of
from dsd_cli.design.targets import Targets, within_reach
from dsd_cli.design.verified import GENTLE
from dsd_cli.errors import DataError
from dsd_cli.plant.model import PlantModel
from dsd_cli.plant.motion import Plant

#: Places at which an axis is held; share of the inertia below which a motor beside its load is next to nothing.
_PLACES, _NO_MOTOR = 50, 1e-3


def able_to_move(
    targets: Targets, room: Room, believed: PlantModel, sample_time: float, *, far: bool = False
) -> Targets:
    """Without explanations by which u could not even begin to move the axis within its limit, or what it reached in the
    logs, or, where their values are weak, could not hold it where the limits let it stand: forces that cancel out
    where a poor log has been. And without those whose motor swings against its load more often than samples of the logs
    show, being next to nothing of the inertia: no log speaks for that, and its simulation takes minutes.

    believed : the model of the user, which takes the place of its own fit where nobody knows what that lacks.
    far : whether the limits let it stand far from where the logs were, and nobody asked for what: one wave of cogging
    is a weight of ten times u as well, which would be so elsewhere.

    Raises
    ------
    DataError : the first of them is one. TooNarrowError : only the limit of u makes it one.
    """
    gentle = position_of(Part("harmonics", 4.0, (0.0, 1.0, 0.5, 0.0), scale=GENTLE), room)
    path, allowed = Path.of(gentle, room.step), room.limits.u
    still = Path(1.0, np.linspace(room.limits.low, room.limits.high, _PLACES), np.zeros(_PLACES), np.zeros(_PLACES))
    reached = allowed if room.reached is None else max(allowed, room.reached.u)

    def holds(one: Explanation, most: float) -> bool:
        return float(np.abs(command_for(one.fitted, still, 3.0 * most)).max()) < most

    def moves(one: Explanation, most: float) -> bool:
        bare = one.fitted.motor_inertia < _NO_MOTOR * one.fitted.inertia
        if bare and Plant(one.fitted).resonance * sample_time > math.pi:
            return False
        u = command_for(one.fitted, path, 3.0 * most)
        passed = actuated(one.fitted, u, path.step).any()  # a dead zone beyond what saturates lets none of it act
        return bool(passed) and float(np.abs(u).max()) < ROOM * most and (not one.weak or holds(one, most))

    if far and not holds(targets.explanations[0], reached):
        raise DataError("u could not hold this axis where its limits let it stand", "give narrower --limit position")

    able = [moves(e, reached) for e in targets.explanations]
    if not able[0] and targets.unknown:
        first = replace(targets.explanations[0], draws=(believed,), weak=False)
        targets = replace(
            targets, explanations=(first, *targets.explanations[1:]), beside=(believed, *targets.beside[1:])
        )
        able[0] = moves(first, reached)
    if not moves(targets.explanations[0], allowed):
        said = f"u within {allowed:.3g}, its limit less its noise in the logs, does not move this axis"
        raise (TooNarrowError if able[0] else DataError)(said, "widen --limit u, or take another --start")
    return within_reach(targets, able)
