"""What is fed forward: friction of a likely plant that brakes least."""

from types import SimpleNamespace

import numpy as np
import pytest

from dsd_cli.design.closed_loop import SETTLE, run_loop, usual_loops
from dsd_cli.design.inverse import Path, command_for
from dsd_cli.design.limits import Limits
from dsd_cli.design.motions import Room
from dsd_cli.design.verified import plants_of
from dsd_cli.plant.model import ObserverSettings, PlantModel

STEP, LIMITS = 0.002, Limits(-1.0, 1.0, 4.0, 80.0, 2000.0, 20.0, 0.0)
#: Fitted, with more friction and with less: an axis whose friction falls as fast as 1.2 / 1.0 with the speed.
DRAWS = tuple(
    PlantModel(0.05, 0.02, {"stribeck_friction": {"excess": level, "velocity": 1.0}, "constant_load": {"force": load}})
    for level, load in ((1.2, 0.2), (1.8, 0.1), (0.6, 0.3))
)


def moved() -> Path:
    """From rest to rest, with reversals."""
    t = STEP * np.arange(round((SETTLE + 4.0) / STEP))
    x = np.clip((t - SETTLE) / 4.0, 0.0, 1.0)
    return Path.of(0.1 * np.sin(np.pi * x) ** 4 * np.sin(2.0 * np.pi * 1.5 * (t - SETTLE)), STEP)


def test_no_more_friction_is_fed_forward_than_every_likely_plant_has() -> None:
    """Nor is its load another: of the fitted plant, 0.2 hold it up, and 0.6 more or less its friction at a creep."""
    first = SimpleNamespace(draws=DRAWS, fitted=DRAWS[0])
    loops = usual_loops(DRAWS[0], ObserverSettings(0.05, 0.01), STEP)
    targets = SimpleNamespace(explanations=(first,), beside=(DRAWS[0],), grown=())
    path, room = moved(), Room(LIMITS, 10.0, STEP)
    plants, led = plants_of(targets, (), path.position, room, loops)  # type: ignore[arg-type]
    assert led.effects["stribeck_friction"]["excess"] == pytest.approx(0.6)
    assert led.effects["constant_load"]["force"] == pytest.approx(0.2)
    assert DRAWS[1] in plants.values()

    def fastest(fed: PlantModel) -> float:
        run = run_loop(DRAWS[2], loops[1], (path, command_for(fed, path)), LIMITS)
        return float(np.abs(run.path.velocity).max() / np.abs(path.velocity).max())

    assert fastest(DRAWS[0]) > 2.0  # what is fed forward and not there drives the axis on
    assert fastest(led) < 1.5
