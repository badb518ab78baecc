"""What is known of values: by the user before any fit, held, bounded, or to a spread (a prior); and by a fit, with the
standard error by which a log identifies a value, weakly, or not, and what goes with it."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from dsd_cli.effects import Effect, Shape, get_effect
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA, Correlations, Estimate, Estimates
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: Coefficients under which it is tried whether a parameter is independent of them, that is a shape.
_PROBES = (0.3, 0.6)


@dataclass(frozen=True)
class PriorKnowledge:
    """Names are "inertia", "delay" or "<effect>.<parameter>"; effects need not be in the model.

    fixed : values that no fit changes.
    bounds : smallest and largest value.
    priors : value and standard deviation: one more equation.
    events : effects all of whose values are held as the model has them, lists of events too.
    seen : of those that are fixed, the ones that the response has identified, with their standard errors
        (`search.response`).
    """

    fixed: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    events: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    seen: Mapping[str, float] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.fixed or self.bounds or self.priors or self.events)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All values of which something is known."""
        return tuple(dict.fromkeys((*self.fixed, *self.bounds, *self.priors)))

    def concerns(self, effect_id: str) -> bool:
        """Whether something is known of a value of that effect."""
        return effect_id in self.events or any(name.startswith(f"{effect_id}.") for name in self.names)

    def applied(self, model: PlantModel) -> PlantModel:
        """The model with what is fixed put into what it has."""
        there = {INERTIA, DELAY, *model.effects}
        return model.with_values({n: v for n, v in self.fixed.items() if n.partition(".")[0] in there})

    def seeing(
        self, effect_id: str, values: Mapping[str, tuple[float, float]], beside: Mapping[str, tuple[float, float]]
    ) -> PriorKnowledge:
        """With the values (and standard errors) of an effect that the response has identified; `beside`: of inertia and
        delay, which keep what is held."""
        found = {n: pair for n, pair in beside.items() if n not in self.fixed}
        found |= {f"{effect_id}.{name}": pair for name, pair in values.items()}
        fixed, errors = ({n: pair[i] for n, pair in found.items()} for i in (0, 1))
        return replace(self, fixed={**self.fixed, **fixed}, seen={**self.seen, **errors})

    def holding_effects(self, model: PlantModel, effects: Collection[str]) -> PriorKnowledge:
        """With all values that the model has of these effects, or of its inertia, fixed: nothing else is known."""
        there = {f"{name}.{p}": v for name in effects for p, v in model.effects.get(name, {}).items()}
        there |= {INERTIA: model.inertia} if INERTIA in effects else {}
        there = {name: value for name, value in there.items() if name not in self.fixed}
        unknown = dict.fromkeys(there, math.nan)
        return replace(self, fixed={**self.fixed, **there}, seen={**self.seen, **unknown})

    def added_to(self, model: PlantModel, effect_id: str) -> PlantModel:
        """The model with an effect in it all of whose values are fixed."""
        prefix = f"{effect_id}."
        values = {n.removeprefix(prefix): value for n, value in self.fixed.items() if n.startswith(prefix)}
        return model.changed(None, None, {effect_id: values})

    def holding(self, model: PlantModel) -> PriorKnowledge:
        """With every value of that model fixed as well."""
        numbers = {INERTIA: model.inertia, DELAY: model.delay}
        events = {}
        for name, values in model.effects.items():
            if get_effect(name).listed:
                events[name] = values
            else:
                numbers |= {f"{name}.{p}": v for p, v in values.items() if isinstance(v, float)}
        rest = {name: found for name, found in self.priors.items() if name not in numbers}
        limits = {name: found for name, found in self.bounds.items() if name not in numbers}
        return replace(self, fixed={**numbers, **self.fixed}, events=events, priors=rest, bounds=limits)

    def limits(self, name: str) -> tuple[float, float]:
        """Bounds of a value; infinite where there are none."""
        return self.bounds.get(name, (-math.inf, math.inf))

    def ends(self, name: str) -> tuple[float, float]:
        """Between which a value may be: both that where it is held, else its bounds."""
        fixed = self.fixed.get(name)
        return self.limits(name) if fixed is None else (fixed, fixed)

    def pinned(self, effect_id: str, shape: Shape) -> dict[str, Any]:
        """A shape with what is known of it in place: fixed values, and within bounds."""
        found = dict(shape)
        for key, value in shape.items():
            name = f"{effect_id}.{key}"
            if name in self.names and is_shape(get_effect(effect_id), key, shape):
                low, high = self.limits(name)
                found[key] = self.fixed.get(name, min(max(value, low), high))
        return found

    def pull_of_shapes(self, effect_id: str, shape: Shape) -> float:
        """Sum of ((shape - prior) / spread)^2 over priors of shapes."""
        found = 0.0
        for key, value in shape.items():
            prior = self.priors.get(f"{effect_id}.{key}")
            if prior is not None and is_shape(get_effect(effect_id), key, shape):
                found += ((value - prior[0]) / prior[1]) ** 2
        return found


def is_shape(effect: Effect, parameter: str, shape: Shape) -> bool:
    """Whether a parameter stands in the shape as it is, whatever the coefficients are."""
    if parameter not in shape:
        return False
    if effect.split is None:
        return True
    count = len(effect.to_columns(_some_values(effect), 1.0)[0])
    found = [effect.from_columns((probe,) * count, shape, 1.0)[parameter] for probe in _PROBES]
    return all(math.isclose(one, shape[parameter], rel_tol=1e-12) for one in found)


def _some_values(effect: Effect) -> dict[str, Any]:
    """Any values within the bounds."""
    return {
        p.name: () if p.listed else min(max(0.5, p.lower), p.upper if math.isfinite(p.upper) else math.inf)
        for p in effect.parameters
    }


Grade = Literal["identified", "weak", "not"]

#: Relative standard errors up to which a value is identified, and weak.
IDENTIFIED, WEAK = 0.1, 0.5
#: A delay is known well enough within these shares of a sample.
DELAY_IDENTIFIED, DELAY_WEAK = 0.5, 2.0


def grade(size: float, error: float, sample_time: float = math.nan) -> Grade:
    """Of a value of that size; with `sample_time` (s) of a delay, which fractions of a sample say well enough."""
    limits = (IDENTIFIED * size, WEAK * size)
    if math.isfinite(sample_time):
        limits = (max(limits[0], DELAY_IDENTIFIED * sample_time), max(limits[1], DELAY_WEAK * sample_time))
    return "identified" if error < limits[0] else "weak" if error < limits[1] else "not"


def estimated(
    name: str, value: float, error: float, unit: str, at_bound: bool, known: PriorKnowledge, sample_time: float
) -> Estimate:
    """A value that a fit gives, with that standard error or with what is known of it already."""
    error = known.seen.get(name, error)
    if name in known.fixed and name not in known.seen:
        return Estimate(value, 0.0, unit, held=True, grade="held")
    return known_to(Estimate(value, error, unit, at_bound), name, error, sample_time)


def known_to(one: Estimate, name: str, error: float, sample_time: float) -> Estimate:
    """An estimate that has this standard error, unless it is held or has none."""
    if one.held or math.isnan(one.std_error):
        return one
    size = 1.0 if one.unit == "rad" else abs(one.value)
    by_error = grade(size, error, sample_time if name == DELAY else math.nan)
    at_zero = name == DELAY and one.value == 0.0  # no delay is less than 0: not a bound of the user
    judged = at_zero or not one.at_bound
    return replace(one, std_error=_told(one.value, error), grade=by_error if judged else "not")


def _told(value: float, error: float) -> float:
    """The standard error; NaN where the value is not identified."""
    return error if value == 0.0 or error < POLICY.not_identified * abs(value) else math.nan


def correlations_of(spread: Array, errors: Array, held: list[bool]) -> Array:
    """Of values; those that are held have errors of rounding, if any, and what has no error goes with nothing."""
    size = np.outer(free := np.where(held, 0.0, errors), free)
    return np.asarray(np.clip(np.divide(spread, size, out=np.zeros_like(spread), where=size > 0.0), -1.0, 1.0))


def with_correlations(estimates: Mapping[str, Estimate], together: Array) -> dict[str, Estimate]:
    """Each with the correlations of its error and of those before it, where both have one."""
    free = [i for i, e in enumerate(estimates.values()) if not e.held and math.isfinite(e.std_error)]
    names = list(estimates)
    return {
        name: replace(e, correlations={names[j]: float(together[i, j]) for j in free if j < i} if i in free else {})
        for i, (name, e) in enumerate(estimates.items())
    }


def correlated(together: Array, estimates: Mapping[str, Estimate]) -> Correlations:
    """Pairs of values that a log hardly separates, the strongest first."""
    names = list(estimates)
    pairs = (
        (names[i], names[j], float(together[i, j]))
        for i in range(len(names))
        for j in range(i + 1, len(names))
        if not (estimates[names[i]].held or estimates[names[j]].held)
        and abs(together[i, j]) > POLICY.reported_correlation
    )
    return tuple(sorted(pairs, key=lambda pair: -abs(pair[2])))


def averaged(
    known: Estimates, odds: Array, moves: Array, sample_time: float
) -> tuple[dict[str, Estimate], Correlations]:
    """Estimates of a model, and what goes together, over it and over others (Bayesian model averaging; Hoeting,
    Madigan, Raftery and Volinsky 1999): the covariance has what each of the others moves the values by.

    Others that move the values alike are in each other's place; those that do not may be there as well.

    odds, moves : of each of the others against the model, shape (k,), and how far the values are off there, (k, n).
    """
    held = [e.held or math.isnan(e.std_error) for e in known.values()]
    errors = np.array([0.0 if off else e.std_error for off, e in zip(held, known.values(), strict=True)])
    together, names = np.eye(len(errors)), list(known)
    for i, e in enumerate(known.values()):
        for name, r in e.correlations.items():
            j = names.index(name)
            together[i, j] = together[j, i] = r
    away = np.divide(moves, errors, out=np.zeros_like(moves), where=errors > 0.0)
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-300)
    alone = odds / (1.0 + odds)
    likely = alone**2 / np.maximum((away @ away.T) ** 2 @ alone, alone)  # of those alike each has its share of one
    spread = together * np.outer(errors, errors) + (likely[:, None] * moves).T @ moves
    errors = np.sqrt(np.diag(spread))
    wider = {n: known_to(e, n, float(x), sample_time) for (n, e), x in zip(known.items(), errors, strict=True)}
    together = correlations_of(spread, errors, held)
    found = with_correlations(wider, together)
    return found, correlated(together, found)
