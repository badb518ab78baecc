"""What dry friction has more when slow: the Stribeck effect."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Ranges, Role, Shape, Values, log_spaced
from dsd_cli.effects.joint_terms import JointTerms, speed_dependent

#: Less is no force: its size would overflow.
_NO_FORCE = float(np.finfo(float).eps)


def _columns(channels: Channels, shape: Shape) -> tuple[Any, ...]:
    relative = channels.velocity / shape["velocity"]
    bell = np.exp(-relative * relative)
    if isinstance(bell, float):  # in a simulation, sample by sample
        return (bell if bell > _NO_FORCE else 0.0,)
    return (np.where(bell > _NO_FORCE, bell, 0.0),)


def _starts(ranges: Ranges) -> list[Shape]:
    """A search goes half as far again, up to a speed at which the bell has just ended within the log (`END`)."""
    return [{"velocity": v} for v in log_spaced(0.01 * ranges.top_speed, 0.24 * ranges.top_speed, 7)]


#: Straight pieces of the bell up to END vs, where 0.04 % of it are left.
PIECES, END = 12, 2.8


def _joint(values: Values, _: float) -> JointTerms:
    relative = np.linspace(0.0, END, PIECES + 1)
    levels = values["excess"] * np.exp(-relative * relative)
    return speed_dependent((values["velocity"] * relative).tolist(), levels.tolist())


EFFECT = Effect(
    id="stribeck_friction",
    role=Role.FRICTION,
    law="-Fs exp(-(v/vs)^2) sgn v, sticking at rest",
    summary="What friction has more at low speed than at high speed, beside Coulomb friction; the cause of stick-slip.",
    pattern="the residual over velocity has a peak at both sides of zero speed that decays as the speed grows",
    parameters=(
        Parameter("excess", "{u}", "Fs, break-away level above the Coulomb level", lower=0.0),
        Parameter("velocity", "{v}", "vs, speed at which 37 % of the excess are left", lower=1e-9, linear=False),
    ),
    needs=("velocity",),
    columns=_columns,
    starts=_starts,
    joint=_joint,
)
