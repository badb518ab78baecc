"""A model on logs that nobody fitted: its prediction, also with levels that differ from log to log, and a free run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from dsd_cli.effects import get_effect
from dsd_cli.errors import DsdError
from dsd_cli.identify.compare.forward import Forward, run_forward
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import Estimates
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.controllers import ControllerSettings
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.units import Units


@dataclass(frozen=True)
class Validation:
    """One log under one model.

    rmse : of the balance of forces, nothing fitted, unit of u. rmse_with_levels : with `levels` (`Effect.varies`)
        fitted to this log; NaN where there are none.
    simulation : the free run; `not_simulated` : why there is none.
    """

    log: str
    rmse: float
    band_hz: float
    rmse_with_levels: float
    levels: Estimates
    simulation: Forward | None
    not_simulated: str = ""


def validate(
    recordings: Sequence[Recording],
    model: PlantModel,
    observer: ObserverSettings,
    controller: ControllerSettings | None = None,
    units: Units = Units(),  # noqa: B008
    band_hz: float = math.nan,
) -> tuple[Validation, ...]:
    """Each log by itself; nothing but `levels` is fitted.

    band_hz : end of the band in which the model was fitted, so that errors compare; NaN for that of each log's sensor.
    """
    return tuple(_validated(one, model, observer, controller, units, band_hz) for one in recordings)


def _validated(
    recording: Recording,
    model: PlantModel,
    observer: ObserverSettings,
    controller: ControllerSettings | None,
    units: Units,
    band_hz: float,
) -> Validation:
    held = PriorKnowledge().holding(model)
    levels = (f"{effect}.{name}" for effect in model.effects for name in get_effect(effect).varies)
    free = [name for name in levels if name in held.fixed]
    known = replace(held, fixed={name: value for name, value in held.fixed.items() if name not in free})
    problem = pose([recording], model, Settings(effects=(), known=known))
    if math.isfinite(band_hz) and not math.isclose(band_hz, own := problem.equations.band.hz):
        problem = pose([recording], model, Settings(effects=(), known=known, band=band_hz / own))
    search = Search(problem)
    rmse = problem.errors.of_model(model).rmse
    fit = search.fit(terms_of(model), round(model.delay / problem.solver.bank.tap_time))
    values = problem.values(fit).estimates
    fitted = {name: replace(values[name], unit=units.words(values[name].unit)) for name in free}
    simulation, why = None, ""
    try:
        simulation = run_forward([recording], model, observer, controller, units=units)
    except DsdError as error:
        why = error.message
    with_levels = problem.score(fit).rmse if fitted else float("nan")
    return Validation(recording.name, rmse, problem.equations.band.hz, with_levels, fitted, simulation, why)
