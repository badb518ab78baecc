"""From coefficients of a fit to a plant model, and how sure its values are."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit.bank import FIXED, Term, Terms
from dsd_cli.identify.fit.gram import grams, without_noise
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.results import DELAY, INERTIA, Estimate
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: Relative step of numerical derivatives, and how near a bound counts as on it (share of the value).
STEP, ON_BOUND = 1e-4, 1e-6
#: An error that is this many times the value is none: the log does not tell the value.
NOT_TOLD = 1e3
#: Correlation with the inertia from which on, and relative error above which, a value is known as a ratio only.
TIED, LEAST_ERROR = 0.97, 0.02
#: Blocks per unknown below which the scatter between blocks is no estimate of a covariance.
BLOCKS_PER_UNKNOWN = 3


@dataclass(frozen=True)
class Scale:
    """What turns coefficients into values: s of one step of delay, and what the fit does not change."""

    tap_time: float
    rest_speed: float

    def model(self, fit: Fit, fold: int | None = None) -> PlantModel:
        """The plant model of a fit (of the fit that holds `fold` out); values are kept within their bounds."""
        theta = fit.total if fold is None else fit.folds[fold]
        return _model(self, fit.terms, fit.widths, fit.tap, theta)


def _model(scale: Scale, terms: Terms, widths: tuple[int, ...], tap: int, theta: Array) -> PlantModel:
    parts = np.split(theta[FIXED:], np.cumsum(widths)[:-1]) if widths else []
    loads = sum(float(c[0]) for t, c in zip(terms, parts, strict=True) if t.effect.role is Role.STRUCTURE)
    inertia = max(float(theta[0]) + loads, 1e-300)
    effects: dict[str, Mapping[str, Any]] = {}
    for term, coefficients in zip(terms, parts, strict=True):
        unit = inertia if term.effect.role is Role.STRUCTURE else 1.0
        found = tuple(float(c) / unit for c in coefficients)
        if term.effect.role is not Role.INPUT and term.effect.memory:
            found = tuple(max(c, 1e-9) for c in found)  # a level or a share that stands under a fraction bar
        effects[term.id] = _bounded(term.effect, term.effect.from_columns(found, term.shape, inertia))
    delay = (tap + min(float(theta[1]), 1.0)) * scale.tap_time
    return PlantModel(inertia, max(delay, 0.0), effects, scale.rest_speed)


def coefficients_of(model: PlantModel, terms: Terms, tap_time: float) -> tuple[int, Array]:
    """(tap, coefficients) of a model with these terms, in the order of `Bank.design`: the inverse of `Scale.model`."""
    steps = model.delay / tap_time
    tap = int(steps + 1e-9)
    found = [model.motor_inertia, steps - tap]
    for term in terms:
        if term.effect.role is Role.INPUT:
            continue
        given, _ = term.effect.to_columns(model.effects[term.id], model.inertia)
        unit = model.inertia if term.effect.role is Role.STRUCTURE else 1.0
        found += [unit * c for c in given]
    return tap, np.array(found)


def terms_of(model: PlantModel) -> Terms:
    """The effects of a model at their shapes."""
    effects = ((name, get_effect(name), values) for name, values in model.effects.items())
    return tuple(Term.of(name, effect.to_columns(values, model.inertia)[1]) for name, effect, values in effects)


def _bounded(effect: Any, values: Mapping[str, Any]) -> dict[str, Any]:
    """Values within the bounds of their parameters."""
    bounds = {p.name: p for p in effect.parameters}
    return {
        name: value if bounds[name].listed else float(np.clip(value, bounds[name].lower, bounds[name].upper))
        for name, value in values.items()
    }


def flat(model: PlantModel) -> dict[str, float]:
    """inertia, delay and "<effect>.<parameter>" -> value; lists of events are left out."""
    values = {INERTIA: model.inertia, DELAY: model.delay}
    for name, parameters in model.effects.items():
        values |= {f"{name}.{p}": v for p, v in parameters.items() if isinstance(v, float)}
    return values


@dataclass(frozen=True)
class Fitted:
    """Values of a fit; `tied` : those of which the log tells only the ratio to the inertia."""

    estimates: dict[str, Estimate]
    tied: tuple[str, ...]


def fitted_values(fit: Fit, solver: Solver, scale: Scale, floor: float) -> Fitted:
    """Every value of the model with its standard error.

    Parameters
    ----------
    floor : variance of a whitened row, inflated for correlation: no error is smaller than it implies.
    """
    covariance, shapes = _covariance(fit, solver, floor)
    values = flat(scale.model(fit))
    linear = len(fit.total)

    def at(change: Array) -> dict[str, float]:
        theta = fit.total + change[:linear]
        terms = list(fit.terms)
        for (i, name, value), step in zip(shapes, change[linear:], strict=True):
            terms[i] = type(terms[i]).of(terms[i].id, {**terms[i].shape, name: value * math.exp(step)})
        return flat(_model(scale, tuple(terms), fit.widths, fit.tap, theta))

    jacobian = _jacobian(at, values, _steps(covariance, linear))
    spread = jacobian @ covariance @ jacobian.T
    errors = np.sqrt(np.maximum(np.diag(spread), 0.0))
    units = _units(fit.terms)
    found = {
        name: Estimate(value, _told(value, float(error)), units[name][0], _on_bound(value, *units[name][1:]))
        for (name, value), error in zip(values.items(), errors, strict=True)
    }
    with np.errstate(over="ignore", invalid="ignore"):
        together = spread[0] / np.maximum(errors * errors[0], 1e-300)
    doubtful = errors > LEAST_ERROR * np.abs(list(values.values()))
    told = zip(values, np.abs(together), doubtful, strict=True)
    return Fitted(found, tuple(name for name, r, d in told if r > TIED and d and name not in (INERTIA, DELAY)))


def _told(value: float, error: float) -> float:
    """The error; NaN where the log does not tell the value at all."""
    return error if value == 0.0 or error < NOT_TOLD * abs(value) else math.nan


def _steps(covariance: Array, linear: int) -> Array:
    """A small part of each standard error; of the logarithm of a shape that the log does not tell, a small step."""
    steps = np.maximum(0.05 * np.sqrt(np.maximum(np.diag(covariance), 0.0)), 1e-9)
    steps[linear:] = np.minimum(steps[linear:], 0.05)
    return steps


def _jacobian(at: Callable[[Array], dict[str, float]], values: dict[str, float], steps: Array) -> Array:
    rows = []
    for i in range(len(steps)):
        step = np.zeros(len(steps))
        step[i] = steps[i]
        up, down = at(step), at(-step)
        rows.append([(up[name] - down[name]) / (2.0 * step[i]) for name in values])
    return np.array(rows).T


def _units(terms: Terms) -> dict[str, tuple[str, float, float]]:
    """Value -> (unit, lower, upper)."""
    units = {INERTIA: ("{u}/({v}/s)", 0.0, math.inf), DELAY: ("s", 0.0, math.inf)}
    for term in terms:
        for p in term.effect.parameters:
            units[f"{term.id}.{p.name}"] = (p.unit, p.lower, p.upper)
    return units


def _on_bound(value: float, lower: float, upper: float) -> bool:
    """Whether a value stands on a bound (a delay of 0 is none: nothing is earlier)."""
    span = max(abs(value), 1e-12)
    return any(math.isfinite(b) and abs(value - b) <= ON_BOUND * span for b in (lower, upper))


def _covariance(fit: Fit, solver: Solver, floor: float) -> tuple[Array, list[tuple[int, str, float]]]:
    """(covariance of coefficients and logarithms of shapes, [(term, shape name, value)]).

    A sandwich over the blocks, which needs nothing to be white; with few blocks the usual one.
    """
    design = solver.bank.design(fit.terms, fit.tap, keep=False)
    rows = list(design.rows)
    shapes = [
        (i, name, value)
        for i, term in enumerate(fit.terms)
        for name, value in term.items
        if isinstance(value, float) and value > 0.0
    ]
    weights = np.concatenate([[-1.0], fit.total])
    for i, name, value in shapes:
        ends = []
        for factor in (1.0 + STEP, 1.0 - STEP):
            terms = list(fit.terms)
            terms[i] = type(terms[i]).of(terms[i].id, {**terms[i].shape, name: value * factor})
            changed = solver.bank.design(tuple(terms), fit.tap, keep=False)
            ends.append(weights @ np.stack(changed.rows))
        rows.append((ends[0] - ends[1]) / (2.0 * STEP))
    found = grams(rows, solver.blocks)
    normal = without_noise(found.total, np.pad(design.noise, (0, len(shapes))), len(rows[0]))[1:, 1:]
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inverse = np.linalg.pinv(normal / np.outer(size, size), rcond=1e-10) / np.outer(size, size)
    usual = floor * inverse
    unknowns, count = len(normal), solver.blocks.count
    if count < BLOCKS_PER_UNKNOWN * unknowns:
        return usual, shapes
    residual = np.concatenate([[1.0], -fit.total, np.zeros(len(shapes))])
    scores = found.held_out[:, 1:, :] @ residual
    meat = scores.T @ scores * count / (count - unknowns)
    sandwich = inverse @ meat @ inverse
    larger = np.sum(np.diag(sandwich) * size**2) > np.sum(np.diag(usual) * size**2)
    return (sandwich if larger else usual), shapes
