"""Logs of a simulated axis seen by a sensor with noise of its own, posed as questions to the search."""

from dataclasses import replace

import numpy as np

from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import PlantModel
from dsd_cli.plant.simulation import Measurement, SimulationSettings, simulate
from dsd_cli.signals.log import Log
from tests.identify.comparison_rig import BELIEVED, CONTROLLER, MOVES, OBSERVER, SINES, T

__all__ = ["BELIEVED", "MOVES", "OBSERVER", "SINES", "T", "posed", "seen"]

#: White noise of the logged speed, rad/s: 0.9 % of u as a force, per sample.
SPEED_NOISE = 0.002


def seen(
    effects=None, *, reference=SINES, noise=SPEED_NOISE, seed=0, duration=10.0, plant=BELIEVED, position=True
) -> Recording:
    """An axis with these effects, its speed logged with noise that the loop does not see, its position rounded.

    The encoder is so coarse that the speed is the better sensor, and so fine that places are known.
    """
    settings = SimulationSettings(
        model=replace(plant, effects=effects or {}),
        duration=duration,
        sample_time=T,
        observer=OBSERVER,
        controller=CONTROLLER,
        reference=reference,
        measurement=Measurement(),
    )
    log = simulate(settings)
    rng = np.random.default_rng(seed)
    channels = {"t": log["t"], "u": log["u"], "velocity": log["velocity"] + noise * rng.normal(size=len(log))}
    if position:
        channels["position"] = 1e-4 * np.round(log["position"] / 1e-4)
    return prepare(Log(channels, T, "log.csv"), OBSERVER)


def posed(effects=None, names=None, model: PlantModel = BELIEVED, **more) -> Search:
    """A search for what such an axis hides from this model."""
    return Search(pose([seen(effects, **more)], model, Settings(effects=names)))
