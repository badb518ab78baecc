"""Logs of the outside rig (tests/oracle/rig*.py) as the tool is asked about them."""

from collections.abc import Mapping

import numpy as np

from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.results import Diagnosis
from dsd_cli.identify.verdict.diagnose import Settings, diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Array, Log
from tests.oracle.rig import RigCase, RigLog, make

Asked = tuple[Recording, PlantModel, ObserverSettings]


def asked(log: RigLog, channels: Mapping[str, Array] | None = None) -> Asked:
    """(recording, believed model, observer) of a log, with these channels in place of its own."""
    observer = ObserverSettings(log.observer["nominal_inertia"], log.observer["time_constant"])
    model = PlantModel(log.believed["inertia"], log.believed["delay"], log.believed["effects"])
    there = log.channels if channels is None else channels
    step = log.sample_time if channels is None else float(np.median(np.diff(there["t"])))
    return prepare(Log(there, step, "log.csv"), observer), model, observer


def diagnosed(
    what: tuple[str, ...],
    seed: int,
    sensing: str = "speed40k",
    duration: float = 20.0,
    effects: tuple[str, ...] | None = None,
) -> Diagnosis:
    """What is said of the log of one case; `effects` are all that is looked for, where not the whole catalogue is."""
    (log,) = make([RigCase(what=what, seed=seed, sensing=sensing, duration=duration)])
    recording, model, observer = asked(log)
    return diagnose([recording], model, observer, Settings(effects))
