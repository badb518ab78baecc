"""The actuator gives the less for its command the larger it is: the torque constant of a motor at large current."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Role, Shape, Values
from dsd_cli.effects.joint_terms import JointTerms


def _columns(channels: Channels, shape: Shape) -> tuple[Any, ...]:
    """u abs(u) up to the command beyond which more of it gives no more force, and there what keeps that force. While c
    is still to be found there is no such end."""
    acts = np.clip(channels.u, -shape["turn"], shape["turn"]) if shape else channels.u
    return (-np.abs(acts) * (2.0 * channels.u - acts),)


def _split(values: Values, _: float) -> tuple[tuple[float, ...], Shape]:
    droop = values["droop"]
    return (droop,), {"turn": 0.5 / droop if droop > 0.0 else 0.0}


def _join(coefficients: tuple[float, ...], _: Shape, __: float) -> Values:
    return {"droop": coefficients[0]}


EFFECT = Effect(
    id="gain_droop",
    role=Role.APPLIED,
    law="-c u abs(u), up to abs(u) = 1/(2c)",
    summary="The drive's gain falls as its command grows: a motor's torque constant at large current (saturated iron).",
    pattern="the residual opposes the command, the more the larger that is, whatever the axis does",
    parameters=(Parameter("droop", "1/({u})", "c: u_eff = u (1 - c abs(u)), and no more than 1/(4c)", lower=0.0),),
    needs=("u",),
    columns=_columns,
    split=_split,
    join=_join,
    joint=lambda values, _: JointTerms(missing="gain that falls with the command"),
)
