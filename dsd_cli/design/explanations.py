"""A fitted set of effects as an explanation: plants that the logs leave as likely, and weakly identifiable values."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.design.closed_loop import Loop
from dsd_cli.design.left_open import FARTHEST, WIDEST, Left, changed, slope_of
from dsd_cli.design.limits import Limits
from dsd_cli.design.rows import Model, at_rest
from dsd_cli.effects import Channels, Effect, Role, catalogue, get_effect, is_angle
from dsd_cli.identify.fit.covariance import root_of
from dsd_cli.identify.fit.direction import LOAD
from dsd_cli.identify.fit.priors import Grade
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.results import DELAY
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: Draws of the values of an explanation: one more goes beyond all of them less often than once in a hundred. Their
#: seed; share of the largest u that drag and friction which grow with the speed take at the limit of speed, for drives
#: are sized for more than that.
DRAWS, _SEED, _GROWN = 100, 20261123, 0.25


@dataclass(frozen=True)
class Explanation:
    """One way to explain the logs: a set of effects, fitted.

    name : of what distinguishes it: an effect, several with "+", "none".
    fitted : model and its values as they stand. draws : plants out of what the logs leave open, the fitted one first.
    weak : whether a value of its forces is hardly identified.
    """

    name: str
    fit: Fit
    model: Model
    draws: tuple[PlantModel, ...]
    weak: bool = False

    @property
    def fitted(self) -> PlantModel:
        """The plant with the values of the fit."""
        return self.draws[0]


@dataclass(frozen=True)
class Value:
    """A value to identify better: `slope` of it over coefficients and shapes of an explanation, shape (m,).

    error : its standard error now, by the logs; `size` : what it is to be small against.
    """

    name: str
    size: float
    error: float
    slope: Array


def explanation_of(search: Search, name: str, fit: Fit, doubtful: bool, own: Collection[str]) -> Explanation:
    """Of a fitted set. doubtful : whether none of the sets may hold. own : effects that others do not have."""
    bank = search.solver.bank
    model = Model(fit.terms, fit.tap * bank.tap_time, bank.tap_time, fit.total, fit.widths)
    told = search.problem.values(fit).estimates.items()
    weak = any(e.grade in ("weak", "not") and not e.held for n, e in told if "." in n)
    return Explanation(name, fit, model, tuple(draws_of(search, fit, doubtful, own)), weak)


def draws_of(search: Search, fit: Fit, doubtful: bool, own: Collection[str]) -> Iterator[PlantModel]:
    """The plant of a fit, and others that the logs leave as likely: normal, but within what the values allow.

    What the logs do not identify stays what the model says; in doubt also what they hardly do, and the delay: beside
    effects that are not there it is any. The other values are those that then go with it: of friction and a load that
    only add up in the logs the sum is known, and each plant has it. So a force that the model does not have, and of
    which nothing says that it is there beside the others, is in no plant (u would be planned for it), but for its own.
    """
    values, scale = search.problem.values(fit), search.problem.scale
    told, fit, left = values.estimates, values.fit, Left.by(search, values)
    random = np.random.default_rng(_SEED)
    left_open: tuple[Grade, ...] = ("weak", "not") if doubtful else ("not",)
    stays = {n for n, e in told.items() if e.grade in left_open or (doubtful and n == DELAY)}
    given = {n: v for n, v in flat(search.problem.model).items() if n in stays}
    here = flat(scale.model(fit))
    for name, value in given.items():
        if name != DELAY and name in here:
            left = left.where(slope_of(search, fit, name, len(left.mean)), value - here[name])
    beside = {n for n in told if n not in given and n.partition(".")[0] not in own}
    forces = [n for n in told if n in beside and told[n].grade in left_open and _is_force(n)]
    for name in sorted(forces, key=lambda n: abs(told[n].value) / max(told[n].std_error, 1e-300)):
        row = slope_of(search, fit, name, len(left.mean))
        if left.may_be(row, -here[name]):
            left = left.where(row, -here[name])
    mean, linear = left.mean.copy(), len(fit.total)
    mean[linear:] = np.clip(mean[linear:], -WIDEST, WIDEST)
    middle, spread = changed(fit, mean), root_of(left.covariance)
    yield scale.model(middle).with_values(given)
    for _ in range(DRAWS - 1):
        change = left.within(spread @ random.standard_normal(len(spread)), middle)
        yield scale.model(changed(middle, change)).with_values(given)


def held(
    search: Search, one: Explanation, found: Fit, unexplained: float, start: float
) -> tuple[Explanation, PlantModel]:
    """An explanation that lacks something nobody can name, with the constant force that this is in the mean of the
    logs: so the axis was held where they were. Elsewhere half of that may come or go, or what is left beside it stays,
    as in one valley of a cogging that has no mean: so are the draws. And a plant in which it, and the mean (a part of a
    long wave), comes and goes with the place: a force that stays makes a held axis no faster.

    Forces of the model are there as the model has them, and as fitted in the draws alone: beside one that nobody has
    named they take its part, and where the logs have not been nothing says that it goes on like them (in one valley of
    a cogging a weight of a hundred times its own).

    unexplained : share of u that what was found leaves beyond the noise. This one lacks that, and what was found.
    """
    known, (fitted, *others) = search.problem.model.effects, one.draws
    own = replace(fitted, effects={n: known[n] if acts(n) else v for n, v in fitted.effects.items()})
    (lacks, beside), (mean, rest) = (_lacking(search, plant, found, unexplained) for plant in (own, fitted))
    most = max(WIDEST * abs(mean), math.sqrt(2.0) * rest)  # a sine goes as far as the root of 2 times its rms
    forces = np.linspace(mean - most, mean + most, len(others)).tolist()
    first = _pushed(own, lacks)
    draws = (first, *(_pushed(plant, x) for plant, x in zip(others, forces, strict=True)))
    wave = _waved(first, math.sqrt(2.0) * math.hypot(lacks, beside), search.ranges.travel, start)
    return replace(one, draws=draws), wave


def falling(search: Search, one: PlantModel, found: Fit, unexplained: float) -> tuple[PlantModel, ...]:
    """A plant whose added friction, and constant load, is friction that is gone beyond the top speed of the logs: they
    say nothing of faster motions, and nothing holds one back that is driven on there. Of moves one way a load is that,
    too, and friction a load, which is a plant as well; and where it is not known what is missing, all that it lacks.
    Where it falls within their speeds and so explains them as well as what was found, it is as large as it is there."""
    frictions = (e for e in catalogue().values() if e.role is Role.FRICTION)
    gone = next(e for e in frictions if [p.name for p in e.parameters if not p.linear] == ["velocity"])
    known, top = search.problem.model.effects, search.ranges.top_speed
    if gone.id in known or not top > 0.0:
        return ()
    held = {LOAD, *(name for name in one.effects if get_effect(name).role is Role.FRICTION)}
    rest = replace(one, effects={n: v for n, v in one.effects.items() if n in known or n not in held})
    lacks, errors = math.hypot(*_lacking(search, rest, found, unexplained)), search.problem.errors
    values = {p.name: 1.0 if p.linear else top for p in gone.parameters}
    left, own = errors.rows_of_model(rest), errors.rows_of_model(search.problem.scale.model(found))
    column = errors.rows_of_model(replace(rest, effects={**rest.effects, gone.id: values})) - left
    level = -float(column @ left) / max(float(column @ column), 1e-300)
    level = max(level, lacks) if np.linalg.norm(left + level * column) <= np.linalg.norm(own) else lacks
    values |= {p.name: level for p in gone.parameters if p.linear}
    fallen = (replace(rest, effects={**rest.effects, gone.id: values}),)
    ways = np.concatenate([s.sign for s in search.equations.stretches])
    rest = replace(rest, effects={n: known[n] if n in known and n in held else v for n, v in rest.effects.items()})
    loaded = _pushed(rest, _lacking(search, rest, found, unexplained)[0])
    return fallen if ways.min() < 0.0 < ways.max() else (*fallen, loaded)


def grown(search: Search, one: Explanation, limits: Limits, loop: Loop) -> tuple[PlantModel, ...]:
    """Plants in which beside that a force grows with the speed, as large as slow logs leave open (`FARTHEST`), but at
    the limit of speed no larger than machines have it (`_GROWN`), nor than half of the loop's damping: an axis that
    takes more off it would be held by no such loop."""
    found, most = list[PlantModel](), min(_GROWN * limits.u, WIDEST * loop.controller.gains.kd * limits.velocity)
    for option in search.options(one.fit) if most > 0.0 else ():
        law = get_effect(option.effect)
        if (law.role, law.needs, law.memory, len(law.parameters)) != (Role.APPLIED, ("velocity",), False, 1):
            continue
        ((size,), (column,)) = law.parameters, law.columns(Channels(0.0, 0.0, limits.velocity, 0.0), {})
        told = search.problem.values(option.fit).estimates[f"{option.effect}.{size.name}"]
        end = most / max(abs(float(column)), 1e-300)
        away = FARTHEST * float(np.nan_to_num(told.std_error, nan=math.inf))
        ends = np.clip((told.value - away, told.value + away), max(size.lower, -end), end)
        found += [
            replace(one.fitted, effects={**one.fitted.effects, option.effect: {size.name: x}}) for x in ends.tolist()
        ]
    return tuple(found)


def _lacking(search: Search, plant: PlantModel, found: Fit, unexplained: float) -> tuple[float, float]:
    """(mean force that a plant lacks in the logs, rms of the rest of it beyond the noise), while the axis is free:
    friction that holds it takes any force; no more than that and u hold where the logs rest."""
    errors, stretches = search.problem.errors, search.equations.stretches
    left = errors.rows_of_model(plant)
    free = errors.rows_of_model(_pushed(plant, 1.0)) - left
    size = max(float(free @ free) / len(free), 1e-300)  # friction may hold the axis in all of them
    mean = -float(free @ left) / (size * len(free))
    # a load that rests pulls nothing
    resting = {n: x for n, x in plant.effects.items() if get_effect(n).role is not Role.STRUCTURE}
    u, force, budget = np.concatenate([at_rest(s, resting, plant) for s in stretches], axis=1)
    if len(u):
        low, high = (-float(np.median(u + force + way * budget)) for way in (1.0, -1.0))
        mean = min(max(mean, low), high)
    # noise counts by the inertia, and what a crawl is found to have is often next to none
    noise = errors.rows_of_model(replace(search.problem.scale.model(found), inertia=plant.inertia, delay=plant.delay))
    beside = float(np.mean((left + mean * free - noise) ** 2)) + (unexplained * errors.force) ** 2
    return mean, math.sqrt(beside / size)


def _pushed(plant: PlantModel, force: float) -> PlantModel:
    """With so much more of the force that is always there."""
    (size,) = (p.name for p in get_effect(LOAD).parameters)
    known = plant.effects.get(LOAD, {size: 0.0})
    return replace(plant, effects={**plant.effects, LOAD: {size: known[size] + force}})


def wave_law() -> tuple[Effect, tuple[str, ...]]:
    """(the effect that is a sine of the position, name of its pace)."""
    wave = next(e for e in catalogue().values() if e.join and e.needs and e.periods)
    return wave, tuple(p.name for p in wave.parameters if not p.linear and not p.whole_turn)


def _waved(plant: PlantModel, size: float, way: float, start: float) -> PlantModel:
    """With a sine of the position, that pushes the axis on whichever way it leaves the start. Half a wave is as long as
    the way of the logs: of a longer one they would show a constant, and a shorter one gives less speed."""
    wave, (shape,) = wave_law()
    if not way > 0.0 or wave.join is None:
        return plant
    pace = math.pi / way
    parts = size * math.cos(pace * start), -size * math.sin(pace * start)
    return replace(plant, effects={wave.id: wave.join(parts, {shape: pace}, plant.inertia), **plant.effects})


def acts(effect: str) -> bool:
    """Whether an effect is a force."""
    return get_effect(effect).role in (Role.APPLIED, Role.FRICTION)


def _is_force(name: str) -> bool:
    """Whether a value is the size of a force."""
    effect, _, value = name.partition(".")
    if not value or not acts(effect):
        return False
    size = get_effect(effect).parameter(value)
    return size.linear and not size.listed and not size.whole_turn


def values_of(search: Search, first: Explanation, wanted: Sequence[str] | None) -> tuple[Value, ...]:
    """Weak ones, or those that were asked for, with their slopes. An error is to be small against what the plant has:
    where the logs do not identify a value its estimate is no size, as an inertia of next to nothing."""
    estimates, plant = search.values(first.fit).estimates, flat(first.fitted)
    if wanted is None:
        wanted = [n for n, e in estimates.items() if e.grade in ("weak", "not") and not (e.held or is_angle(n))]
    found = []
    for name in wanted:
        value, error = estimates[name].value, estimates[name].std_error
        size = search.problem.recordings[0].sample_time if name == DELAY else abs(plant[name] or value)
        found.append(Value(name, size, error, slope_of(search, first.fit, name, first.model.size - 1)))
    return tuple(found)
