"""The actuator gives the less for its command the larger it is: the torque constant of a motor at large current."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Role, Shape
from dsd_cli.effects.joint_terms import JointTerms


def _columns(channels: Channels, _: Shape) -> tuple[Any, ...]:
    return (-channels.u * np.abs(channels.u),)


EFFECT = Effect(
    id="gain_droop",
    role=Role.APPLIED,
    law="-c u abs(u)",
    summary="The drive's gain falls as its command grows: a motor's torque constant at large current (saturated iron).",
    pattern="the residual over the command bends down at both ends, whatever the axis does",
    parameters=(Parameter("droop", "1/({u})", "c: u_eff = u (1 - c abs(u))", lower=0.0),),
    needs=("u",),
    columns=_columns,
    told_apart={
        "load_friction": "move a load slowly up and down: friction takes force one way and gives it the other, a droop"
        " takes it both ways",
        "cubic_stiffness": "repeat the motion under another load: a droop follows the command, a spring the place",
        "saturation": "step up to the largest command by several levels: a droop shows below the largest, too",
    },
    joint=lambda values, _: JointTerms(missing="a gain that falls with the command"),
)
