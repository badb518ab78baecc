"""From the coefficients of a fit to effects of a model, and to curves with their bands."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from dsd_cli.effects import Role, Values, free_name
from dsd_cli.effects.general import HYSTERESIS, INERTIA_CURVE
from dsd_cli.effects.lagging import LAGGED
from dsd_cli.effects.tables import Table
from dsd_cli.learn.families import Columns
from dsd_cli.learn.judge import Judge, LawFit
from dsd_cli.learn.results import Curve, View
from dsd_cli.learn.state_laws import STATE_LAWS, fitted
from dsd_cli.plant.forces import Mask
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: Standard errors of a band of 95 %.
_BAND = 1.96
#: Knots on each side, over which the distance of a finer curve is averaged.
_BESIDE = 2
#: Share of the mean information on a coefficient, below which the log was hardly there.
_VISITED = 1e-3


def parts(fit: LawFit) -> Iterator[tuple[Columns, slice]]:
    """Each law and where its coefficients stand among those of the laws."""
    at = 0
    for law in fit.laws:
        yield law, slice(at, at + len(law.rows))
        at += len(law.rows)


def coefficients(fit: LawFit) -> Array:
    """Of the laws as forces, shape (c,); u counts once."""
    theta = fit.total[len(fit.total) - sum(len(law.rows) for law in fit.laws) :]
    return -theta / gain(fit) if fit.forward else theta


def gain(fit: LawFit) -> float:
    """What a forward fit multiplies u by; 1 where the law says it."""
    return float(fit.total[0]) if fit.forward and 0 not in fit.held else 1.0


def effects_of(fit: LawFit, model: PlantModel) -> dict[str, Values]:
    """Name in the model -> values, of every law."""
    found: dict[str, Values] = {}
    theta = coefficients(fit)
    for law, at in parts(fit):
        name = free_name(law.family.effect.id, {*model.effects, *found})
        found[name] = law.values(law.matrix @ theta[at])
    return found


def with_scale_in(values: Mapping[str, Any]) -> dict[str, Any]:
    """The same law with a scale of 1."""
    numbers = next(name for name in ("stiffnesses", "levels", "values") if name in values)
    return {**values, numbers: _times(values[numbers], float(values["scale"])), "scale": 1.0}


def _times(values: Any, scale: float) -> Any:
    """With six digits: a config is read by people."""
    if isinstance(values, list | tuple):
        return tuple(_times(x, scale) for x in values)
    return float(f"{scale * float(values):.6g}")


def curves_of(fit: LawFit, judge: Judge, names: Sequence[str], finer: LawFit | None = None) -> tuple[Curve, ...]:
    """Every law with the band of its posterior, widened by how far the finer fit is from it; nothing where the log
    never was."""
    variance, theta, covariance, found = judge.nats(fit) / 2.0, coefficients(fit), judge.covariance(fit), []
    for i, ((law, at), name) in enumerate(zip(parts(fit), names, strict=True)):
        if law.family in STATE_LAWS:
            found.append(fitted(law, theta[at], judge, variance).curve(name, _BAND))
            continue
        spread = np.einsum("ij,jk,ik->i", law.matrix, covariance[at, at], law.matrix)
        half = _BAND * np.sqrt(np.maximum(variance * spread, 0.0) + _smoothed(fit, finer, i))
        found.append(_curve(law, name, law.matrix @ theta[at], half, judge))
    return tuple(found)


def _smoothed(fit: LawFit, finer: LawFit | None, at: int) -> Array | float:
    """Squared distance of the finer curve from that of law `at`, at its knots: what is lost by being smooth.

    A mean over neighbours, for one crossing of the two is no agreement.
    """
    if finer is None or not isinstance(fit.laws[at].law, Table) or len(fit.laws[at].law.channels) > 1:
        return 0.0
    (law, own), (other, others) = (list(parts(one))[at] for one in (fit, finer))
    there = np.interp(law.law.knots[0], other.law.knots[0], other.matrix @ coefficients(finer)[others])
    apart = (there - law.matrix @ coefficients(fit)[own]) ** 2
    return np.convolve(np.pad(apart, _BESIDE, mode="edge"), np.full(2 * _BESIDE + 1, 1.0 / (2 * _BESIDE + 1)), "valid")


def _curve(law: Columns, name: str, theta: Array, half: Array, judge: Judge) -> Curve:
    weight = np.abs(law.matrix) @ np.array([float(np.sum(judge.white(x) ** 2)) for x in law.rows])
    known = weight > _VISITED * float(np.mean(weight))
    if law.family.effect is HYSTERESIS:
        return Curve(name, ("radius",), (law.law.radii,), *_flat(theta, half, known), "{u}/({q})")
    if law.family.effect is LAGGED:
        unit = "{u}/({v})" if law.family.factor == "velocity" else "{u}"
        return Curve(name, ("time constant",), (law.law.time_constants,), *_flat(theta, half, known), unit)
    table: Table = law.law
    unit = {"one": "{u}", "velocity": "{u}/({v})", "u": "1"}[table.factor]
    unit = "{u}/({v}/s)" if law.family.effect is INERTIA_CURVE else unit
    return Curve(name, table.channels, table.knots, *_flat(theta, half, known), unit, table.factor)


def _flat(values: Array, half: Array, known: Mask) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    low, high = (np.where(known, values + side * half, math.nan) for side in (-1.0, 1.0))
    return tuple(map(float, values)), tuple(map(float, low)), tuple(map(float, high))


#: Share of the largest factor of a curve, below which a point tells nothing of the curve.
_TELLS = 0.2


def views_of(fit: LawFit, judge: Judge) -> tuple[View, ...]:
    """Each law over the channel of its curve, the others beside it."""
    balance, after = judge.balance, judge.residual(fit, held_out=False)
    theta = coefficients(fit)
    keep = balance.sure
    found = []
    for law, at in parts(fit):
        taken = theta[at] @ np.stack(law.rows)
        channel = "position" if not law.family.over else law.family.over[0]
        rows = balance.of_rows(channel)[keep]
        direction = np.sign(balance.of_rows("velocity"))[keep]
        before = -(taken + after)[keep]
        factor = {"velocity": "velocity", "u": "u"}.get(getattr(law.law, "factor", ""), "")
        if law.family.effect.role is Role.FRICTION:
            by = -direction
        elif factor:
            by = balance.of_rows(factor)[keep]
        else:
            by = np.full(len(rows), math.nan if law.family.effect is INERTIA_CURVE else 1.0)
        tells = np.abs(by) > _TELLS * np.nanmax(np.abs(by), initial=0.0)
        points = np.where(tells, before / np.where(tells, by, 1.0), math.nan)
        found.append(View(channel, rows, direction, before, -after[keep], points))
    return tuple(found)
