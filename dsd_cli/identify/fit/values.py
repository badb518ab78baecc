"""From coefficients of a fit to a plant model, and how sure its values are."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit.bank import FIXED, Term, Terms
from dsd_cli.identify.fit.covariance import Information
from dsd_cli.identify.fit.priors import PriorKnowledge, correlated, correlations_of, estimated, with_correlations
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA, Correlations, Estimate
from dsd_cli.plant.filtering import delay_taps
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array
from dsd_cli.signals.rounding import ROUNDING

#: How near a bound counts as on it (share of the value).
ON_BOUND = 1e-6
#: Steps of delay beyond the whole ones at which a mix of two steps still stands for a delay.
MOST_SHARE = 1.5
#: Least inertia that is reported, so that a config can hold it.
LEAST_INERTIA = 1e-99


@dataclass(frozen=True)
class Scale:
    """What turns coefficients into values: s of one step of delay, and what the fit does not change.

    inertia : that of the model as given, which stays where a fit finds none. least : below it a fit is weightless.
    """

    tap_time: float
    rest_speed: float
    known: PriorKnowledge = field(default_factory=PriorKnowledge)
    inertia: float = LEAST_INERTIA
    least: float = 0.0

    def weightless(self, fit: Fit) -> bool:
        """Whether effects explain u by itself: friction of the size of u leaves nothing for J a, and so no error."""
        return whole_inertia(fit) <= self.least

    def model(self, fit: Fit) -> PlantModel:
        """The plant model of a fit; values are kept within their bounds."""
        return self.known.applied(_model(self, fit, fit.terms, fit.total))


def _model(scale: Scale, fit: Fit, terms: Terms, theta: Array) -> PlantModel:
    parts = np.split(theta[FIXED:], np.cumsum(fit.widths)[:-1]) if fit.widths else []
    found_inertia = _inertia(terms, parts, theta)
    inertia = found_inertia if found_inertia > 0.0 else scale.inertia
    effects: dict[str, Mapping[str, Any]] = {}
    for term, coefficients in zip(terms, parts, strict=True):
        unit = inertia if term.effect.role is Role.STRUCTURE else 1.0
        found = tuple(float(c) / unit for c in coefficients)
        if term.effect.role is not Role.INPUT and term.effect.memory:
            found = tuple(max(c, 1e-9) for c in found)  # a level or a share that stands under a fraction bar
        effects[term.id] = _bounded(term.effect, term.effect.from_columns(found, term.shape, inertia))
    delay = (fit.tap + min(float(theta[1]), MOST_SHARE)) * scale.tap_time
    return PlantModel(inertia, max(delay, 0.0), effects, scale.rest_speed)


def _inertia(terms: Terms, parts: Sequence[Array], theta: Array) -> float:
    loads = (float(c[0]) for t, c in zip(terms, parts, strict=True) if t.effect.role is Role.STRUCTURE)
    return sum(loads, float(theta[0]))


def whole_inertia(fit: Fit) -> float:
    """J of motor and loads; 0 where a missing force swamps it (u holds a weight, or is friction all through)."""
    return max(_inertia(fit.terms, [fit.coefficients(t) for t in fit.terms], fit.total), 0.0)


def coefficients_of(model: PlantModel, terms: Terms, tap_time: float) -> tuple[int, Array]:
    """(tap, coefficients) of a model with these terms, in the order of `Bank.design`: the inverse of `Scale.model`."""
    tap, share = delay_taps(model.delay, tap_time)
    found = [model.motor_inertia, share]
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
        name: float(np.clip(value, bounds[name].lower, bounds[name].upper)) if bounds[name].numeric else value
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
    """Values of a fit.

    tied : those of which only the ratio to the inertia is identified.
    correlations : (value, value, correlation) of nearly inseparable pairs, the strongest first.
    fit, covariance : coefficients, and how they and the logarithms of shapes scatter, shape (m, m).
    """

    model: PlantModel
    estimates: dict[str, Estimate]
    tied: tuple[str, ...]
    correlations: Correlations
    fit: Fit
    covariance: Array


def fitted_values(
    fit: Fit, solver: Solver, scale: Scale, floor: float, found: Information, complete: bool = False
) -> Fitted:
    """Every value of the model with its standard error. floor, complete : see `Information.covariance`."""
    values = flat(scale.model(fit))
    linear, bare = len(fit.total), replace(scale, known=PriorKnowledge())

    def at(change: Array) -> dict[str, float]:
        theta = fit.total + change[:linear]
        terms = list(fit.terms)
        for (i, name, value), step in zip(found.shapes, change[linear:], strict=True):
            terms[i] = type(terms[i]).of(terms[i].id, {**terms[i].shape, name: value * math.exp(step)})
        return values | flat(_model(bare, fit, tuple(terms), theta))

    units, known = units_of(fit.terms), solver.known
    bounds = {name: (known.limits(name), units[name][1:]) for name in values}
    stuck = {n for n, v in values.items() if n not in known.fixed and any(_on_bound(v, *b) for b in bounds[n])}
    usual = found.covariance(floor, complete=complete)
    steps = _steps(usual, linear, None if not known else fit.total)
    jacobian = _jacobian(at, values, steps)
    covariance, pulls = usual, dict[str, float]()
    if known:
        rows = dict(zip(values, jacobian, strict=True))
        held = [rows[n] for n in values if n in known.fixed or (n in stuck and _on_bound(values[n], *bounds[n][0]))]
        held += _whole_events(fit, known, len(steps))
        priors = [(rows[n], s) for n, (_, s) in known.priors.items() if n in rows and n not in known.fixed]
        covariance = found.covariance(floor, held, priors, fit.variance, complete)
        for n in known.priors.keys() & rows.keys() - known.fixed.keys():
            others = [(rows[o], s) for o, (_, s) in known.priors.items() if o in rows and o != n]
            alone = math.sqrt(
                max(float(rows[n] @ found.covariance(floor, held, others, fit.variance, complete) @ rows[n]), 0.0)
            )
            share = found.share(rows[n], known.priors[n][1], held, priors, fit.variance)
            pulls[n] = _pull(values[n], known.priors[n], alone, share)
    spread, step = jacobian @ covariance @ jacobian.T, solver.bank.equations.sample_time
    errors = np.sqrt(np.maximum(np.diag(spread), 0.0))
    estimates = {
        name: replace(
            estimated(name, value, float(error), units[name][0], name in stuck, known, step),
            pull=pulls.get(name, math.nan),
        )
        for (name, value), error in zip(values.items(), errors, strict=True)
    }
    together = correlations_of(spread, errors, [n in known.fixed for n in values])
    estimates = with_correlations(_found_only(estimates, fit, known), together)
    told = zip(estimates.items(), np.abs(together[0]), strict=True)
    doubtful = (n for (n, e), r in told if r > POLICY.tied_correlation and e.grade != "identified")
    tied = tuple(name for name in doubtful if name not in (INERTIA, DELAY))
    return Fitted(scale.model(fit), estimates, tied, correlated(together, estimates), fit, covariance)


def _found_only(estimates: Mapping[str, Estimate], fit: Fit, known: PriorKnowledge) -> Mapping[str, Estimate]:
    """Where a fit finds no inertia what is given stays, and nothing is said of it."""
    if whole_inertia(fit) > 0.0 or INERTIA in known.fixed:
        return estimates
    return {**estimates, INERTIA: replace(estimates[INERTIA], std_error=math.nan, grade="not")}


def _pull(value: float, prior: tuple[float, float], alone: float, share: float) -> float:
    """Standard deviations by which the log alone is off a prior. alone : standard error of the value without that
    prior. share : of the prior in the value."""
    if share > 1.0 - ROUNDING:
        return 0.0
    without = (value - share * prior[0]) / (1.0 - share)
    return (without - prior[0]) / math.hypot(prior[1], alone)


def _whole_events(fit: Fit, known: PriorKnowledge, size: int) -> list[Array]:
    """Coefficients of events that are held: a unit row each."""
    at = [k for t in fit.terms if t.id in known.events for k in range(*fit.columns_of(t).indices(size))]
    return list(np.eye(size)[at])


def _steps(covariance: Array, linear: int, theta: Array | None) -> Array:
    """Steps of the numerical derivatives: a part of each standard error, bounded for shapes that are not identified.

    With `theta` a small part of the coefficients at most: a value that is not identified may be held.
    """
    steps = np.maximum(0.05 * np.sqrt(np.maximum(np.diag(covariance), 0.0)), 1e-9)
    steps[linear:] = np.minimum(steps[linear:], 0.05)
    if theta is not None:
        steps[:linear] = np.minimum(steps[:linear], np.maximum(1e-3 * np.abs(theta), 1e-12))
    return steps


def _jacobian(at: Callable[[Array], dict[str, float]], values: dict[str, float], steps: Array) -> Array:
    rows = []
    for i in range(len(steps)):
        step = np.zeros(len(steps))
        step[i] = steps[i]
        up, down = at(step), at(-step)
        rows.append([(up[name] - down[name]) / (2.0 * step[i]) for name in values])
    return np.array(rows).T


def units_of(terms: Terms) -> dict[str, tuple[str, float, float]]:
    """Value -> (unit, lower, upper)."""
    units = {INERTIA: ("{u}/({v}/s)", 0.0, math.inf), DELAY: ("s", 0.0, math.inf)}
    for term in terms:
        for p in term.effect.parameters:
            units[f"{term.id}.{p.name}"] = (p.unit, p.lower, p.upper)
    return units


def _on_bound(value: float, lower: float, upper: float) -> bool:
    """Whether a value is at a bound (a delay of 0 is none: it cannot be less)."""
    span = max(abs(value), 1e-12)
    return any(math.isfinite(b) and abs(value - b) <= ON_BOUND * span for b in (lower, upper))
