"""Which values of a model this log identifies, by the fit, and what a missing force or noise makes of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import cast

from dsd_cli.effects import get_effect
from dsd_cli.identify.checks.fitted import Sides
from dsd_cli.identify.checks.results import Parameter
from dsd_cli.identify.fit.priors import Grade, grade
from dsd_cli.identify.fit.values import Fitted
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA, Estimate
from dsd_cli.plant.model import PlantModel

#: Values that correlate by 1 less than this are one, by rounding: the errors are then those of their sum.
_ONE = 1e-6
#: A value is bent where forces of the motion beside the model move it by more than so many standard errors.
_BENT = 3.0
#: Best first.
_GRADES: tuple[str, ...] = ("identified", "weak", "not")
_INERTIA_UNIT = "{u}/({v}/s)"


def parameters_of(sides: Sides, model: PlantModel | None) -> tuple[Parameter, ...]:
    """Every number of the model; without one inertia and delay, beside friction, weight and springs of any size."""
    if model is None and sides.beside.weightless:
        return unknown_parameters(None)
    lacks_force = 2.0 * sides.beside.left < sides.own.left  # noise that comes back is left beside any force
    asked = [sides.beside if model is None else sides.own, sides.beside]
    judged = asked[lacks_force].by_reference
    leaning = {} if judged is None else judged.leaning
    alone, beside = ((one.by_reference or one).values if leaning else one.values for one in asked)
    names = (INERTIA, DELAY) if model is None else tuple(alone.estimates)
    return tuple(
        replace(one, leaning=leaning.get(one.name), tied_to=tuple(name for name in one.tied_to if name in names))
        for one in _each(names, alone, beside, sides, lacks_force)
    )


def _each(
    names: tuple[str, ...], alone: Fitted, beside: Fitted, sides: Sides, lacks_force: bool
) -> Iterator[Parameter]:
    step, drifts = sides.own.search.equations.sample_time, sides.own.search.problem.reconstructed("velocity")
    for name in names:
        one = alone.estimates[name]
        others = {a if b == name else b: abs(r) for a, b, r in alone.correlations if name in (a, b)}
        tied = tuple(other for other, r in others.items() if r > POLICY.tied_correlation)
        if name == DELAY and sides.late is not None:
            lead, error = sides.late
            yield Parameter(name, grade(lead, error, step), -lead, error, "s", tied)
            continue
        found = _parameter(name, one, tied)
        if max(others.values(), default=0.0) > 1.0 - _ONE:
            found = replace(found, identified="not", std_error=math.inf)
        if name in (INERTIA, DELAY) and not sides.beside.weightless:
            found = _bent(found, beside.estimates[name], step, lacks_force)
        yield _drifting(found) if drifts else found


def _parameter(name: str, one: Estimate, tied: tuple[str, ...]) -> Parameter:
    error = one.std_error if one.std_error > 0.0 else math.inf  # of 0 where a bound cuts the value off
    judged = "not" if one.grade == "held" or math.isinf(error) else one.grade
    return Parameter(name, cast(Grade, judged), one.value, error, one.unit, tied)


def _bent(one: Parameter, beside: Estimate, step: float, lacks: bool) -> Parameter:
    """An inertia or a delay that takes the place of a force that the model lacks is wrong by what that moves it.

    `beside` : the same with friction, weight and springs of any size beside the model. Noise that a controller answers
    moves least squares likewise, as the motion that such forces leave has a larger share of it.
    """
    moved, error, judged = abs(beside.value - one.value), one.std_error, one.identified
    if bent := moved > _BENT * beside.std_error:
        error = math.hypot(error, moved)
        judged = grade(abs(one.value), error, step if one.name == DELAY else math.nan)
    told = beside.value if (bent or lacks) and _GRADES.index(beside.grade) < _GRADES.index(judged) else None
    one = replace(one, lacks_force=lacks, biased=moved > one.std_error)
    return replace(one, identified=judged, std_error=error, beside=told)


def _drifting(one: Parameter) -> Parameter:
    """A motion that was integrated from u and d_hat drifts: what looks at it is weak at best."""
    by_motion = "." in one.name and {"velocity", "position"} & set(get_effect(one.name.partition(".")[0]).needs)
    return replace(one, identified="weak") if by_motion and one.identified == "identified" else one


def unknown_parameters(model: PlantModel | None) -> tuple[Parameter, ...]:
    """The same where a log says nothing of them."""
    units = {INERTIA: _INERTIA_UNIT, DELAY: "s"}
    for effect in {} if model is None else model.effects:
        units |= {f"{effect}.{p.name}": p.unit for p in get_effect(effect).parameters if p.numeric}
    return tuple(Parameter(name, "not", math.nan, math.inf, unit) for name, unit in units.items())
