"""A loop that nobody described, and in which the axis does not stand where the motion begins."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from dsd_cli.design.closed_loop import Loop, usual_loops
from dsd_cli.design.limits import Limits
from dsd_cli.design.motions import MotionSegment, Room
from dsd_cli.design.optimise import joined
from dsd_cli.design.verified import Verified, plants_of, verified
from dsd_cli.errors import DataError
from dsd_cli.plant.model import ObserverSettings, PlantModel

STEP, LIMITS = 0.004, Limits(-1.2, 1.2, 14.0, 250.0, 8000.0, 32.0, 0.0)
FORCE = 5.0
#: What moves one way do not distinguish.
FRICTION = PlantModel(0.12, 0.02, {"coulomb_friction": {"level": FORCE}})
LOAD = PlantModel(0.12, 0.02, {"constant_load": {"force": -FORCE}})
PARTS = (MotionSegment("harmonics", 2.0, (0.2, 0.5, 0.3, 0.5), scale=0.5),)
LOOPS = usual_loops(FRICTION, ObserverSettings(0.12, 0.01), STEP)


def simulated(loops: tuple[Loop, ...]) -> Verified:
    """What keeps the limits of this pair."""
    named = (("coulomb_friction", FRICTION), ("constant_load", LOAD))
    both = tuple(SimpleNamespace(name=name, fitted=plant, draws=(plant,)) for name, plant in named)
    targets: Any = SimpleNamespace(explanations=both, pairs=((0, 1),), beside=(), grown=(), unknown=False)
    room = Room(LIMITS, 10.0, STEP)
    plants, led = plants_of(targets, (0, 1), joined(PARTS, room), room, loops)
    return verified(targets, plants, led, PARTS, room, loops, LIMITS)


def test_a_loop_that_cannot_hold_the_axis_at_the_start_ends_no_plan() -> None:
    """Of friction and a load no motion was planned for, though any that turns round distinguishes them: the softest of
    usual loops stands off by the load, and no motion is so small that it does not."""
    assert FORCE / LOOPS[1].controller.gains.kp > LIMITS.high
    kept = simulated(LOOPS)
    assert {key[0] for key in kept.runs} == {0, 1}
    (note,) = kept.unstable
    assert "without an integral" in note
    assert note.endswith(", with constant_load")
    driven = [run.path.velocity for run in kept.runs.values()]
    assert all(v.min() < -0.5 and v.max() > 0.5 for v in driven)


def test_gains_that_are_described_are_those_that_hold_the_axis() -> None:
    """Of them it is known that the axis stands beyond the limit."""
    own = replace(LOOPS[1], described=True)
    with pytest.raises(DataError, match="no motion keeps the limits with every likely plant: position"):
        simulated((own,))
