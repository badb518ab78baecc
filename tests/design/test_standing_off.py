"""A loop that nobody described, and in which the axis does not stand where the motion begins."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsd_cli.design.closed_loop import Loop, Run, run_loop, usual_loops
from dsd_cli.design.inverse import Path
from dsd_cli.design.limits import Limits
from dsd_cli.design.motions import MotionSegment, Room
from dsd_cli.design.optimise import joined
from dsd_cli.design.verified import Verified, plants_of, verified
from dsd_cli.errors import DataError
from dsd_cli.identify.results import NONE
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Array

STEP, LIMITS = 0.004, Limits(-1.2, 1.2, 14.0, 250.0, 8000.0, 32.0, 0.0)
FORCE = 5.0
#: What moves one way do not distinguish.
FRICTION = PlantModel(0.12, 0.02, {"coulomb_friction": {"level": FORCE}})
LOAD = PlantModel(0.12, 0.02, {"constant_load": {"force": -FORCE}})
FREE, PUSHED = PlantModel(0.12, 0.02), PlantModel(0.12, 0.02, {"constant_load": {"force": 0.4 * FORCE}})
PARTS = (MotionSegment("harmonics", 2.0, (0.2, 0.5, 0.3, 0.5), scale=0.5),)
LOOPS = usual_loops(FRICTION, ObserverSettings(0.12, 0.01), STEP)


def beside(plants: tuple[PlantModel, ...], most: float) -> Verified:
    """What keeps a limit of u where nobody knows what is missing, and these plants may be there."""
    alone = SimpleNamespace(name=NONE, fitted=FREE, draws=(FREE,))
    targets: Any = SimpleNamespace(explanations=(alone,), pairs=(), beside=plants, grown=(), unknown=True)
    limits = replace(LIMITS, u=most)
    room = Room(limits, 10.0, STEP)
    known, led = plants_of(targets, (), joined(PARTS, room), room, LOOPS)
    return verified(targets, known, led, PARTS, room, LOOPS, limits)


def test_friction_that_u_does_not_break_away_on_one_way_may_be_the_axis() -> None:
    """Of moves one way it is not known: the log took 1 there, and the other way takes 5."""
    one_way = replace(FREE, effects={**PUSHED.effects, "coulomb_friction": {"level": 0.6 * FORCE}})
    with pytest.raises(DataError, match="no motion keeps the limits with every likely plant: u"):
        beside((one_way,), 0.8 * FORCE)
    kept = beside((one_way,), 4.0 * FORCE)
    assert {key[1] for key in kept.runs} >= {-1}


def test_what_u_does_not_hold_at_rest_is_not_the_axis() -> None:
    kept = beside((LOAD,), 0.8 * FORCE)
    assert kept.unstable[0] == "no motion keeps the limits with other likely values of the model alone"


def test_where_a_plant_is_left_out_a_motion_is_as_large_as_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """What had made it smaller by then would do so again."""
    heavy, made = replace(FREE, inertia=4.0 * FREE.inertia), dict[float, list[float]]()

    def runs(plant: PlantModel, loop: Loop, planned: tuple[Path, Array], limits: Limits) -> Run:
        if plant == heavy:
            made.setdefault(loop.controller.integral, []).append(float(np.ptp(planned[0].position)))
        return run_loop(plant, loop, planned, limits)

    monkeypatch.setattr("dsd_cli.design.verified.run_loop", runs)
    kept = beside((heavy, LOAD), 0.8 * FORCE)
    assert kept.unstable
    stiff, soft = made.values()
    assert kept.parts[0].scale == pytest.approx(PARTS[0].scale * stiff[-1] / stiff[0])
    assert soft == [stiff[-1]]


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
