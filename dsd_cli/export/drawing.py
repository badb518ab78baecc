"""Models drawn from the standard errors of their values, for training in simulation: what the logs leave open."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from dsd_cli.effects import get_effect
from dsd_cli.errors import UsageError
from dsd_cli.export.base import DELAY, INERTIA
from dsd_cli.plant.model import PlantModel

#: Draws of a value until it lies within its bounds; then it stays as it was fitted.
_TRIES = 100


def draw(model: PlantModel, errors: Mapping[str, float], count: int, seed: int = 0) -> list[PlantModel]:
    """`count` models with values from normal distributions within their bounds.

    Parameters
    ----------
    errors : "inertia", "delay" or "<effect>.<parameter>" -> standard error, in its unit; other values stay.
        They are drawn independently: a config holds no correlations, so of two values that a log tells only together
        (Coulomb and Stribeck friction) each goes its own way.

    Raises
    ------
    UsageError : there is no error to draw from.
    """
    if not errors:
        raise UsageError(
            "--samples", "[[history]] has no standard errors of these values; `dsd add` or `improve` write them"
        )
    rng = np.random.default_rng(seed)
    return [_one(model, errors, rng) for _ in range(count)]


def _one(model: PlantModel, errors: Mapping[str, float], rng: np.random.Generator) -> PlantModel:
    inertia = delay = None
    effects: dict[str, dict[str, float]] = {}
    for name, error in errors.items():
        if name == INERTIA:
            inertia = _within(model.inertia, error, (np.nextafter(0.0, 1.0), math.inf), rng)
        elif name == DELAY:
            delay = _within(model.delay, error, (0.0, math.inf), rng)
        else:
            effect, _, parameter = name.partition(".")
            bounds = get_effect(effect).parameter(parameter)
            value = float(model.effects[effect][parameter])
            drawn = _within(value, error, (bounds.lower, bounds.upper), rng)
            effects.setdefault(effect, {})[parameter] = drawn
    return model.changed(delay, inertia, effects)


def _within(value: float, error: float, bounds: tuple[float, float], rng: np.random.Generator) -> float:
    drawn = value + error * rng.standard_normal(_TRIES)
    inside = drawn[(drawn >= bounds[0]) & (drawn <= bounds[1])]
    return float(inside[0]) if len(inside) else value
