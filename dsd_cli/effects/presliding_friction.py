"""Friction that first acts like a spring: Dahl's model."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Ranges, Role, Shape, Values, decay, log_spaced
from dsd_cli.effects.joint_terms import Bristle, JointTerms
from dsd_cli.effects.memory import before_each, one_pole


def _columns(channels: Channels, shape: Shape, state: float | None) -> tuple[tuple[Any, ...], float]:
    """Minus the mean of h over the interval; h in [-1, 1] is how far the friction is built up, state its last value.

    h' = (v/delta) (1 - h sgn v), solved exactly for constant speed over the interval.
    """
    moved = channels.velocity * channels.interval / shape["distance"]
    one = isinstance(moved, float)  # in a simulation, sample by sample
    direction = float(moved > 0.0) - float(moved < 0.0) if one else np.sign(moved)
    left, mean_left = decay(abs(moved))
    before = 0.0 if state is None else state
    if one or np.ndim(moved) == 0:
        return (-(direction + (before - direction) * mean_left),), left * before + direction * (1.0 - left)
    built = one_pole(left, direction * (1.0 - left), before)
    mean = direction + (before_each(built, before) - direction) * mean_left
    return (-mean,), float(built[-1]) if built.size else before


def _starts(ranges: Ranges) -> list[Shape]:
    """Distances that the axis does not cross within a fraction of a sample at its usual speed, and that its sensor
    resolves: over less, friction builds up unseen, and the law is Coulomb's."""
    resolved = max(0.05 * ranges.speed * ranges.sample_time, 1.5 * ranges.resolution)
    distances = log_spaced(1e-4 * ranges.travel, 0.2 * ranges.travel, 12)
    return [{"distance": d} for d in distances if d >= resolved]


def _split(values: Values, _: float) -> tuple[tuple[float, ...], Shape]:
    return (float(values["level"]),), {"distance": values["level"] / values["stiffness"]}


def _join(coefficients: tuple[float, ...], shape: Shape, _: float) -> Values:
    return {"level": coefficients[0], "stiffness": coefficients[0] / shape["distance"]}


EFFECT = Effect(
    id="presliding_friction",
    role=Role.APPLIED,
    law="-sigma z, z' = v (1 - sigma z/Fc sgn v)",
    summary="Dry friction that first acts like a spring (Dahl): after a reversal it builds up over a short distance.",
    pattern="the residual over position is a hysteresis loop: after each reversal it bends over into a constant level",
    parameters=(
        Parameter("level", "{u}", "Fc, the friction when fully built up", lower=1e-12),
        Parameter("stiffness", "{u}/({q})", "sigma, slope right after a reversal", lower=1e-9, linear=False),
    ),
    needs=("velocity",),
    columns=_columns,
    starts=_starts,
    split=_split,
    join=_join,
    memory=True,
    joint=lambda values, _: JointTerms(bristles=(Bristle(values["level"], values["stiffness"]),)),
    of_joint=lambda terms, _: [b._asdict() for b in terms.bristles],
)
