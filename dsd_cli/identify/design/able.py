"""Which explanations could be this axis at all: u has to move it, and to hold it where its limits let it stand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.identify.design.explanations import Explanation
from dsd_cli.identify.design.inverse import Path, command_for
from dsd_cli.identify.design.limits import Limits
from dsd_cli.identify.design.motions import ROOM, Part, Room, position_of
from dsd_cli.identify.design.targets import Targets, within_reach
from dsd_cli.identify.design.verified import GENTLE
from dsd_cli.plant.model import PlantModel
from dsd_cli.plant.motion import Plant

#: Places at which an axis is held; share of the inertia below which a motor beside its load is next to nothing.
_PLACES, _NO_MOTOR = 50, 1e-3


def able_to_move(targets: Targets, room: Room, believed: PlantModel, sample_time: float) -> Targets:
    """Without explanations by which u could not even begin to move the axis within its limit, or, where their values
    are weak, could not hold it where the limits let it stand: forces that cancel out where a poor log has been. And
    without those whose motor swings against its load more often than samples of the logs show, being next to nothing
    of the inertia: no log speaks for that, and its simulation takes minutes.

    believed : the model of the user, which takes the place of its own fit where nobody knows what that lacks.

    Raises
    ------
    DataError : the first of them is one.
    """
    gentle = position_of(Part("harmonics", 4.0, (0.0, 1.0, 0.5, 0.0), scale=GENTLE), room)
    path, most = Path.of(gentle, room.step), room.limits.u

    def moves(one: Explanation) -> bool:
        bare = one.fitted.motor_inertia < _NO_MOTOR * one.fitted.inertia
        if bare and Plant(one.fitted).resonance * sample_time > math.pi:
            return False
        needs = float(np.abs(command_for(one.fitted, path, 3.0 * most)).max())
        return needs < ROOM * most and (not one.weak or _holding(one.fitted, room.limits) < most)

    able = [moves(e) for e in targets.explanations]
    if not able[0] and targets.unknown:
        first = replace(targets.explanations[0], draws=(believed,), weak=False)
        targets = replace(targets, explanations=(first, *targets.explanations[1:]))
        able[0] = moves(first)
    if not able[0]:
        raise DataError(f"u within {most:.3g} does not move this axis", "widen --limit u, or take another --start")
    return within_reach(targets, able)


def _holding(plant: PlantModel, limits: Limits) -> float:
    """Largest |u| that holds a plant at rest within the limits of the position."""
    places, still = np.linspace(limits.low, limits.high, _PLACES), np.zeros(_PLACES)
    return float(np.abs(command_for(plant, Path(1.0, places, still, still))).max())
