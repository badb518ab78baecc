"""Models on logs that nobody fitted: one by itself, and two side by side: which predicts better, by more than chance.

Of two nothing is fitted. The logs are cut into the blocks on which `dsd diagnose` holds out; the squared errors of both
models on each block are compared in pairs, so that what is hard for both does not count. One is judged by its balance
of forces, also with levels that differ from log to log, and by a free run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dsd_cli.effects import free_name, get_effect, kind_of
from dsd_cli.errors import DsdError
from dsd_cli.identify.compare.balance import Force, force_of
from dsd_cli.identify.compare.forward import Forward, run_forward
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import DELAY, INERTIA, Estimates
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.controllers import ControllerSettings
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Array
from dsd_cli.signals.rounding import ROUNDING
from dsd_cli.signals.units import Units

#: Periods (or frequencies) of one line in two models differ by no more than this share.
_NEAR = 0.02


def paired(first: PlantModel, second: PlantModel) -> dict[str, str]:
    """Effect of the second model -> the name under which it stands beside the first one's, where that is another."""
    names: dict[str, str] = {}
    for kind in dict.fromkeys(kind_of(name) for name in second.effects):
        if get_effect(kind).periods is None:
            continue
        one, other = (_lines(model, kind) for model in (first, second))
        pairs = sorted((abs(math.log(y / x)), a, b) for a, x in one.items() for b, y in other.items())
        taken: dict[str, str] = {}
        for off, a, b in pairs:
            if off < _NEAR and a not in taken.values() and b not in taken:
                taken[b] = a
        for b in other:
            if b not in taken:
                taken[b] = b if b not in {*one, *taken.values()} else free_name(kind, {*one, *other, *taken.values()})
        names |= taken
    return {b: a for b, a in names.items() if a != b}


def renamed(values: Mapping[str, float], names: Mapping[str, str]) -> dict[str, float]:
    """Values by "<effect>.<parameter>" under the other names."""
    found = {}
    for name, value in values.items():
        effect, dot, parameter = name.partition(".")
        found[f"{names.get(effect, effect)}{dot}{parameter}"] = value
    return found


def _lines(model: PlantModel, kind: str) -> dict[str, float]:
    """Effect of that kind -> how many periods it has, per what its unit says."""
    shape = next(p.name for p in get_effect(kind).parameters if not p.linear)
    found = {name: float(x[shape]) for name, x in model.effects.items() if kind_of(name) == kind}
    return {name: value for name, value in found.items() if value > 0.0}


#: Random changes of sign of the differences, and below which chance a difference is said to be one.
DRAWS, SEED, CHANCE = 20000, 20261121, 0.01


@dataclass(frozen=True)
class Contender:
    """One model. `better_by` : share by which its error is below that of the first model; `chance` : that blocks of
    two equal models differ so much; `blocks_won` : share of the blocks on which it is better. NaN for the first.
    `residual` : of the rows that count, shape (n,), unit of u; `by_block` : its rms on each block, shape (blocks,)."""

    name: str
    force: Force
    better_by: float = math.nan
    chance: float = math.nan
    blocks_won: float = math.nan
    residual: Array = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)
    by_block: Array = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)

    @property
    def differs(self) -> bool:
        """Whether the difference to the first model is more than chance."""
        return self.chance < CHANCE


@dataclass(frozen=True)
class Rows:
    """The rows that count of one piece of a log, channel -> shape (n,): t and the motion and u that it has."""

    name: str
    channels: Mapping[str, Array]


@dataclass(frozen=True)
class Versus:
    """All models, the first one the one that the others are compared with; `rows` : of the residuals."""

    logs: tuple[str, ...]
    blocks: int
    contenders: tuple[Contender, ...]
    rows: tuple[Rows, ...] = field(default=(), repr=False, compare=False)


def versus(recordings: Sequence[Recording], models: Mapping[str, PlantModel]) -> Versus:
    """Raises DataError, UsageError as `pose`."""
    problem = pose(recordings, next(iter(models.values())), Settings(effects=()))
    block = problem.blocks.block_of_rows()[problem.equations.kept]
    found: list[Contender] = []
    first = np.zeros(0)
    for name, model in models.items():
        errors = problem.errors_for(model, recordings)
        residual = errors.rows_of_model(model)
        squares = np.array([float(np.mean(residual[block == b] ** 2)) for b in np.unique(block)])
        force = force_of(replace(problem, errors=errors), model)
        series = {"residual": residual, "by_block": np.sqrt(squares)}
        if not found:
            first = squares
            found.append(Contender(name, force, **series))
            continue
        better = 1.0 - force.rmse / found[0].force.rmse if found[0].force.rmse > 0.0 else 0.0
        found.append(
            Contender(name, force, better, _chance(first - squares), float(np.mean(squares < first)), **series)
        )
    return Versus(tuple(r.name for r in recordings), int(np.unique(block).size), tuple(found), _rows(errors.equations))


def _rows(equations: Equations) -> tuple[Rows, ...]:
    """The channels at the rows that count."""
    found = []
    by_stretch = zip(equations.stretches, equations.centres, equations.by_stretch(equations.kept), strict=True)
    for stretch, centres, kept in by_stretch:
        at = centres[kept]
        names = [name for name in ("t", "u", "velocity", "position") if name in stretch.log]
        found.append(Rows(stretch.log.source, {name: stretch.log[name][at] for name in names}))
    return tuple(found)


def _chance(differences: np.ndarray) -> float:
    """Of a mean so far from 0 under random signs (two-sided); by signed ranks, robust against a few outlying blocks."""
    size = np.abs(differences)
    if not size.max(initial=0.0) > 0.0:
        return 1.0
    ranks = np.argsort(np.argsort(size)) + 1.0
    signs = np.random.default_rng(SEED).choice([-1.0, 1.0], (DRAWS, len(size)))
    found = []
    for weights in (size, ranks):
        seen = abs(float(np.sign(differences) @ weights))
        found.append((1.0 + np.sum(np.abs(signs @ weights) >= seen * (1.0 - ROUNDING))) / (DRAWS + 1.0))
    return float(max(found))


@dataclass(frozen=True)
class Moved:
    """A value of two models; standard errors NaN where they are not known, values NaN where a model has it not."""

    name: str
    unit: str
    first: float
    first_error: float
    second: float
    second_error: float

    @property
    def sigma(self) -> float:
        """By how many standard errors of the difference it moved; NaN where they are not known."""
        spread = math.hypot(self.first_error, self.second_error)
        return (self.second - self.first) / spread if spread > 0.0 else math.nan


def moved(
    first: Mapping[str, float],
    second: Mapping[str, float],
    first_errors: Mapping[str, float],
    second_errors: Mapping[str, float],
    units: Mapping[str, str],
) -> tuple[Moved, ...]:
    """Every value of both models; inertia and delay first."""
    names, sides = dict.fromkeys((INERTIA, DELAY, *first, *second)), (first, first_errors, second, second_errors)
    return tuple(Moved(n, units.get(n, ""), *(side.get(n, math.nan) for side in sides)) for n in names)


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
