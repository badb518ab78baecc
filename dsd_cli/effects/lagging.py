"""Friction that acts late, which `dsd learn` writes: first-order lags of the velocity, or of its direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Role, Shape, Values, decay
from dsd_cli.effects.joint_terms import JointTerms
from dsd_cli.effects.memory import before_each, one_pole
from dsd_cli.effects.tables import numbers_of
from dsd_cli.errors import UsageError

#: What may lag.
OF = ("velocity", "direction")


@dataclass(frozen=True)
class Lags:
    """Forces -level z with z' = (x - z) / time constant, x = v or sgn v.

    of : one of `OF`. time_constants : s, above 0. levels : unit of u, of the velocity per rad/s or m/s.
    """

    of: str
    time_constants: tuple[float, ...]
    levels: tuple[float, ...]

    def unit(self, i: int) -> Lags:
        """The same with level 1 of lag i alone."""
        return Lags(self.of, self.time_constants, tuple(float(k == i) for k in range(len(self.levels))))


def _columns(
    channels: Channels, shape: Shape, state: tuple[float, ...] | None
) -> tuple[tuple[Any, ...], tuple[float, ...]]:
    """Minus the mean force of the lags over the interval, exactly for constant speed; state: each z at its end.

    Before the first interval the axis is taken to have moved as in it: nobody has seen how it did.
    """
    lags, x = shape["lags"], channels.velocity
    if lags.of == "direction":
        x = np.sign(x) if channels.direction is None else channels.direction
    first = x if np.ndim(x) == 0 else float(x[0]) if len(x) else 0.0
    before = state or (first,) * len(lags.levels)
    total, last = 0.0 * x, []
    for time_constant, level, z in zip(lags.time_constants, lags.levels, before, strict=True):
        if level == 0.0:
            last.append(z)
            continue
        left, mean_left = decay(channels.interval / time_constant)
        if np.ndim(x) == 0:
            last.append(x + (z - x) * left)
            total = total - level * (x + (z - x) * mean_left)
        else:
            ends = one_pole(np.broadcast_to(left, len(x)), x * (1.0 - left), z)
            total = total - level * (x + (before_each(ends, z) - x) * mean_left)
            last.append(float(ends[-1]) if len(ends) else z)
    return (total,), tuple(last)


def _split(values: Values, _: float) -> tuple[tuple[float, ...], Shape]:
    of = values["of"]
    if of not in OF:
        raise UsageError(f"lagged_friction.of = {of!r}", f"must be one of {', '.join(OF)}")
    times = numbers_of(values["time_constants"], "lagged_friction.time_constants", "numbers above 0, s", above=0.0)
    levels = numbers_of(values["levels"], "lagged_friction.levels")
    if len(times) != len(levels):
        raise UsageError("lagged_friction.levels", f"must be {len(times)} numbers, one for each time constant")
    return (float(values.get("scale", 1.0)),), {"lags": Lags(of, times, levels)}


def _join(coefficients: tuple[float, ...], shape: Shape, _: float) -> Values:
    lags = shape["lags"]
    return {"of": lags.of, "time_constants": lags.time_constants, "levels": lags.levels, "scale": coefficients[0]}


LAGGED = Effect(
    id="lagged_friction",
    role=Role.APPLIED,
    law="-sum c_i z_i, z_i' = (x - z_i)/T_i; x is v or sgn v",
    summary="Friction that acts late, as `dsd learn` finds it: of v a spring and a damper in series, which relaxes"
    " (Maxwell); of sgn v dry friction that builds up over time.",
    pattern="the residual follows the velocity, or its direction, late; in a rest it dies away over the time constants",
    parameters=(
        Parameter("of", "", "what lags: velocity or direction", data=True, linear=False),
        Parameter("time_constants", "s", "of each lag", data=True, linear=False),
        Parameter("levels", "", "of each lag, unit of u; per speed where it is of the velocity", data=True,
                  linear=False),
        Parameter("scale", "", "what a fit multiplies it by; 1 as learnt"),
    ),
    needs=("velocity",),
    columns=_columns,
    starts=lambda _: [],
    split=_split,
    join=_join,
    memory=True,
    joint=lambda _, __: JointTerms(missing="friction that acts late"),
    repeats=lambda _: False,
    rarity=9,
)  # fmt: skip
