"""What is said of a value: its standard error, by which a log identifies it, weakly, or not, and what goes with it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, Correlations, Estimate, Estimates
from dsd_cli.signals.log import Array

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
