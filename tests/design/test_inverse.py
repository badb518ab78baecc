"""The command for a path, put into the simulator without any loop, moves the plant along that path."""

import numpy as np
import pytest

from dsd_cli.design.inverse import Path, command_for
from dsd_cli.plant.controllers import ControllerSettings
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.references import Samples
from dsd_cli.plant.simulation import SimulationSettings, simulate

STEP = 0.001
PLANTS = {
    "friction": PlantModel(
        0.02, 0.0047, {"viscous_friction": {"coefficient": 0.05}, "coulomb_friction": {"level": 0.1}}
    ),
    "drag and spring": PlantModel(
        0.02, 0.003, {"quadratic_drag": {"coefficient": 0.03}, "stiffness": {"coefficient": 0.2}}
    ),
    "dead zone": PlantModel(0.02, 0.002, {"dead_zone": {"width": 0.08}, "viscous_friction": {"coefficient": 0.05}}),
    "load friction": PlantModel(0.02, 0.0, {"load_friction": {"coefficient": 0.2}}),
    "gain that droops": PlantModel(
        0.02, 0.0, {"gain_droop": {"droop": 0.1}, "viscous_friction": {"coefficient": 0.05}}
    ),
}


@pytest.mark.parametrize("name", PLANTS)
def test_the_plant_follows(name: str) -> None:
    t = np.arange(2001) * STEP
    x = np.clip(np.minimum(t, 2.0 - t) / 0.4, 0.0, 1.0)
    path = Path.of(x**3 * (10 - 15 * x + 6 * x * x) * np.sin(2.0 * np.pi * t), STEP)
    u = command_for(PLANTS[name], path)
    settings = SimulationSettings(
        PLANTS[name],
        duration=2.0,
        sample_time=STEP,
        observer=ObserverSettings(0.02, 0.01),
        controller=ControllerSettings("open_loop"),
        reference=Samples(tuple(u.tolist())),
    )
    log = simulate(settings)
    assert np.abs(log["position"] - path.position[:-1]).max() < 0.03


def test_a_command_stays_within_what_is_allowed() -> None:
    path = Path.of(np.sin(np.linspace(0.0, 20.0, 2000)), STEP)
    assert np.abs(command_for(PLANTS["dead zone"], path, 0.3)).max() <= 0.3


def test_between_its_samples_a_path_rests_where_it_rests() -> None:
    """A spline through all samples would swing there, and Coulomb friction push to and fro."""
    t = np.arange(401) * 0.005
    path = Path.of(np.where(t < 1.0, 0.2, 0.2 + 0.3 * np.clip(t - 1.0, 0.0, None) ** 3), 0.005)
    fine = path.resampled(STEP)
    rests = fine.times < 0.99
    assert np.all(command_for(PLANTS["friction"], fine)[: int(np.sum(rests)) - 10] == 0.0)
    exact = 0.2 + 0.3 * np.clip(fine.times - 1.0, 0.0, None) ** 3
    assert np.abs(fine.position - exact).max() < 1e-5
    assert fine.acceleration[1500] == pytest.approx(1.8 * 0.5, rel=0.02)


def test_the_motion_that_is_written_is_the_one_that_was_looked_at() -> None:
    """At the end of the band, eight samples a period: half the difference of both neighbours is 10 % less speed."""
    t, w = np.arange(801) * 0.005, 2.0 * np.pi / 0.04
    path = Path.of(np.sin(w * t), 0.005)
    inner = slice(100, 700)
    assert path.velocity[inner] == pytest.approx(w * np.cos(w * t)[inner], abs=0.015 * w)
    fine = path.resampled(STEP)
    assert np.ptp(fine.position[500:3500]) == pytest.approx(2.0, rel=0.02)
