"""`dsd simulate --adapt`: the detector of the config in the simulated loop."""

from __future__ import annotations

import numpy as np

from dsd_cli.cli.plan import detection_plan
from dsd_cli.detect.engine import Engine, Measurement
from dsd_cli.detect.feedback import Adaptation, AdaptSettings
from dsd_cli.detect.settings import OFFLINE
from dsd_cli.errors import UsageError
from dsd_cli.files.config import Config, Simulate, States
from dsd_cli.plant.simulation import SimulationSettings
from dsd_cli.signals.log import Log


def adaptation(config: Config, plant: SimulationSettings) -> Adaptation:
    """What lets the simulated controller know which plant it has.

    Raises
    ------
    UsageError : a detector that cannot judge sample by sample, or a loop without anything to adapt.
    """
    if plant.controller.kind == "open_loop":
        raise UsageError(f'{config.name}: --adapt with controller.kind = "open_loop"', "there is no loop to adapt")
    if plant.feedforward is not None:
        raise UsageError(
            f"{config.name}: --adapt with a motion of dsd plan, whose feedforward is computed for one plant",
            'follow its position alone: simulate.reference kind = "column"',
        )
    if config.model.effects or config.require(States).effects:
        raise UsageError("--adapt cannot take effects in [model] or [states] yet", "leave them out")
    plan = detection_plan(config, {"u": "u", "d_hat": "d_hat"}, _source(plant), config.name)
    if plan.settings.method in OFFLINE:
        raise UsageError(f"--adapt: method '{plan.settings.method}' needs the whole log", "use dsd, average or imm")
    measurement = Measurement(
        sample_time=plant.sample_time,
        nominal_inertia=plan.observer.nominal_inertia,
        time_constant=plan.observer.time_constant,
        sign=plan.observer.sign,
        aperture=plan.aperture,
    )
    adapt = config.require(Simulate).adapt
    return Adaptation(Engine(plan.grid, plan.settings, measurement), AdaptSettings(adapt.dwell, adapt.ramp))


def _source(plant: SimulationSettings) -> dict[str, str]:
    return {"d_hat_source": "position"} if plant.measurement.encoder_step > 0.0 else {}


def adopted_line(log: Log) -> str:
    """What the controller believed in the end, since when, and how it tracked."""
    delay, inertia = log["adopted_delay"], log["adopted_inertia"]
    believed = np.isfinite(inertia)
    last = slice(-max(len(log) // 4, 1), None)
    error = float(np.sqrt(np.mean((log["reference"] - log["position"])[last] ** 2)))
    tracked = f"tracking error in the last quarter {error:.3g} (rms)"
    if not believed.any():
        return f"nothing was adopted: no label stood confident for long enough; {tracked}"
    first = int(believed.argmax())
    steps = (np.diff(delay[first:]) != 0) | (np.diff(inertia[first:]) != 0)
    return (
        f"adopted from {log['t'][first]:g} s on, changed {int(steps.sum())} times; in the end delay {delay[-1]:g} s, "
        f"inertia {inertia[-1]:g}; {tracked}"
    )
