"""A fitted set of effects as an explanation: plants that the logs leave as likely, and weakly identifiable values."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.effects import get_effect
from dsd_cli.identify.design.rows import Model, shapes_of
from dsd_cli.identify.fit.bank import INERTIA as AT_INERTIA
from dsd_cli.identify.fit.bank import SHARE
from dsd_cli.identify.fit.covariance import information, root_of
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.grades import Grade
from dsd_cli.identify.results import DELAY
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: Draws of the values of an explanation, their seed, and how far they go: standard errors, and shares of the value.
DRAWS, _SEED, _FARTHEST, _WIDEST = 8, 20261123, 2.0, 0.5


@dataclass(frozen=True)
class Explanation:
    """One way to explain the logs: a set of effects, fitted.

    name : of what distinguishes it: an effect, several with "+", "none".
    fitted : model and its values as they stand. draws : plants out of what the logs leave open, the fitted one first.
    """

    name: str
    fit: Fit
    model: Model
    draws: tuple[PlantModel, ...]

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


def explanation_of(search: Search, name: str, fit: Fit, doubtful: bool) -> Explanation:
    """Of a fitted set. doubtful : whether none of the sets may hold."""
    bank = search.solver.bank
    model = Model(fit.terms, fit.tap * bank.tap_time, bank.tap_time, fit.total, fit.widths)
    return Explanation(name, fit, model, _draws(search, fit, doubtful))


def _draws(search: Search, fit: Fit, doubtful: bool) -> tuple[PlantModel, ...]:
    """The plant of a fit, and others that the logs leave as likely: normal, but within what the values allow.

    What the logs do not identify stays what the model says; in doubt also what they hardly do, and the delay: beside
    effects that are not there it is any."""
    scale, noise = search.problem.scale, search.noise
    spread = root_of(information(fit, search.solver).covariance(noise.variance * noise.inflation))
    random = np.random.default_rng(_SEED)
    told = search.problem.values(fit).estimates
    left_open: tuple[Grade, ...] = ("weak", "not") if doubtful else ("not",)
    stays = {n for n, e in told.items() if e.grade in left_open or (doubtful and n == DELAY)}
    given = {n: v for n, v in flat(search.problem.model).items() if n in stays}
    plants = [scale.model(fit).with_values(given)]
    linear = len(fit.total)
    most = np.concatenate([_WIDEST * np.abs(fit.total), np.full(len(spread) - linear, _WIDEST)])
    most[SHARE] = 1.0
    for _ in range(DRAWS - 1):
        z = np.clip(random.standard_normal(len(spread)), -_FARTHEST, _FARTHEST)
        change = np.clip(spread @ z, -most, most)
        plants.append(scale.model(_changed(fit, change)).with_values(given))
    return tuple(plants)


def _changed(fit: Fit, change: Array) -> Fit:
    """A fit with other coefficients, and logarithms of shapes."""
    linear = len(fit.total)
    terms = list(fit.terms)
    for (i, name, value), step in zip(shapes_of(fit.terms), change[linear:], strict=True):
        terms[i] = type(terms[i]).of(terms[i].id, {**terms[i].shape, name: value * math.exp(step)})
    return replace(fit, total=fit.total + change[:linear], terms=tuple(terms))


def values_of(search: Search, first: Explanation, wanted: Sequence[str] | None) -> tuple[Value, ...]:
    """Weak ones, or those that were asked for, with their slopes."""
    estimates = search.problem.values(first.fit).estimates
    if wanted is None:
        weak = [n for n, e in estimates.items() if e.grade in ("weak", "not") and not e.held]
        wanted = [n for n in weak if not _of_angle(n)]
    found, at = [], _flat_of(search, first.fit)
    for name in wanted:
        value, error = estimates[name].value, estimates[name].std_error
        slope = _slope(lambda x, name=name: at(x)[name], first)  # type: ignore[misc]
        size = search.problem.recordings[0].sample_time if name == DELAY else abs(value)
        found.append(Value(name, size, error, slope))
    return tuple(found)


def _of_angle(name: str) -> bool:
    """A phase is no size."""
    effect, _, value = name.partition(".")
    return bool(value) and get_effect(effect).parameter(value).whole_turn


def _flat_of(search: Search, fit: Fit) -> Callable[[Array], dict[str, float]]:
    scale = search.problem.scale
    return lambda change: flat(scale.model(_changed(fit, change)))


def _slope(value: Callable[[Array], float], first: Explanation) -> Array:
    """Numerical, over coefficients and logarithms of shapes, shape (m,)."""
    size, total = first.model.size - 1, first.model.total
    steps = np.concatenate([1e-4 * np.maximum(np.abs(total), 1e-3 * abs(total[AT_INERTIA])), np.full(size, 1e-4)])
    steps = steps[:size]
    steps[SHARE] = 1e-3
    found = np.zeros(size)
    for i, step in enumerate(steps):
        change = np.zeros(size)
        change[i] = step
        found[i] = (value(change) - value(-change)) / (2.0 * step)
    return found
