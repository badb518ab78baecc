"""Models drawn from the standard errors of their values and the correlations of these, for training in simulation: what
the logs leave open."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from dsd_cli.effects import get_effect
from dsd_cli.errors import UsageError
from dsd_cli.export.base import DELAY, INERTIA
from dsd_cli.identify.fit.covariance import root_of
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: Draws for each model that is wanted, at most: ten values on their bounds leave one draw in 1024.
_TRIES = 20_000

#: Name of a value -> name of another -> correlation of their errors; each pair stands once, either way.
Correlations = Mapping[str, Mapping[str, float]]


def draw(
    model: PlantModel, errors: Mapping[str, float], correlations: Correlations, count: int, seed: int = 0
) -> list[PlantModel]:
    """`count` models with values from a joint normal distribution, cut off where a value would be out of its bounds.

    Parameters
    ----------
    errors : "inertia", "delay" or "<effect>.<parameter>" -> standard error, in its unit; other values stay.
    correlations : of these errors; a pair that is not there is independent.

    Raises
    ------
    UsageError : there is no error to draw from, or hardly a draw is within the bounds.
    """
    if not errors:
        raise UsageError(
            "--samples", "[[history]] has no standard errors of these values; `dsd add` or `improve` write them"
        )
    names = list(errors)
    means = np.array([_value(model, name) for name in names])
    low, high = np.array([_bounds(name) for name in names]).T
    slopes = np.array(list(errors.values()))[:, None] * root_of(_matrix(names, correlations))
    rng = np.random.default_rng(seed)
    kept: list[Array] = []
    for _ in range(_TRIES):
        drawn = means + rng.standard_normal((count, len(names))) @ slopes.T
        kept += list(drawn[np.all((drawn >= low) & (drawn <= high), axis=1)])
        if len(kept) >= count:
            return [model.with_values(dict(zip(names, one.tolist(), strict=True))) for one in kept[:count]]
    outside = [n for n, m, a, b in zip(names, means, low, high, strict=True) if not a < m < b]
    raise UsageError(f"--samples: hardly a draw is within the bounds of {', '.join(outside or names)}", "fit them anew")


def _value(model: PlantModel, name: str) -> float:
    if name in (INERTIA, DELAY):
        return model.inertia if name == INERTIA else model.delay
    effect, _, parameter = name.partition(".")
    return float(model.effects[effect][parameter])


def _bounds(name: str) -> tuple[float, float]:
    if name in (INERTIA, DELAY):
        return (float(np.nextafter(0.0, 1.0)) if name == INERTIA else 0.0, math.inf)
    effect, _, parameter = name.partition(".")
    bounds = get_effect(effect).parameter(parameter)
    return bounds.lower, bounds.upper


def _matrix(names: Sequence[str], correlations: Correlations) -> Array:
    """Shape (n, n), 1 on the diagonal."""
    found = np.eye(len(names))
    for i, name in enumerate(names):
        for j, other in enumerate(names):
            if i != j and other in correlations.get(name, {}):
                found[i, j] = found[j, i] = correlations[name][other]
    return found
