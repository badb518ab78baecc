"""Simulated recordings for the tests of the comparison: an axis that moves to and fro under PD control."""

from dataclasses import replace

import numpy as np

from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.plant.controllers import ControllerSettings, Gains
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.references import Multisine, Trapezoids
from dsd_cli.plant.simulation import Measurement, SimulationSettings, simulate

T = 0.002
OBSERVER = ObserverSettings(nominal_inertia=0.01, time_constant=0.01)
BELIEVED = PlantModel(inertia=0.01, delay=0.003)
MOVES = Trapezoids(distance=1.5, speed=6.0, acceleration=60.0, dwell=0.3, start=0.2)
SINES = Multisine((1.7, 3.1, 5.3, 7.9, 11.3), 0.3, seed=3)
CONTROLLER = ControllerSettings("pd", Gains(9.0, 0.6), "error")


def recorded(
    effects=None, *, reference=SINES, noise=0.01, seed=0, duration=16.0, model=BELIEVED, controller=CONTROLLER
) -> Recording:
    """What a plant with these effects, of which the believed model may know nothing, leaves in a log."""
    settings = SimulationSettings(
        model=replace(model, effects=effects or {}),
        duration=duration,
        sample_time=T,
        observer=OBSERVER,
        controller=controller,
        reference=reference,
        measurement=Measurement(d_hat_noise=noise, seed=seed),
    )
    return prepare(simulate(settings), OBSERVER)


def rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)
