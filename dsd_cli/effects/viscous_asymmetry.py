"""Viscous friction that differs between the two directions, beside the symmetric one."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Role, Shape, Values
from dsd_cli.effects.joint_terms import JointTerms, Ramps


def _columns(channels: Channels, _: Shape) -> tuple[Any, ...]:
    return (-np.abs(channels.velocity),)


#: Speeds up to which a simulator has it, rad/s or m/s.
_FASTEST = 1e6


def _joint(values: Values, _: float) -> JointTerms:
    end = -_FASTEST * values["coefficient"]
    return JointTerms(ramps=(Ramps("velocity", (-_FASTEST, 0.0, _FASTEST), (end, 0.0, end)),))


EFFECT = Effect(
    id="viscous_asymmetry",
    role=Role.APPLIED,
    law="-Ba abs(v)",
    summary="What viscous friction has more of forward than backward; B forward is then B + Ba, backward B - Ba.",
    pattern="the residual is a V over velocity, its tip at zero speed",
    parameters=(Parameter("coefficient", "{u}/({v})", "Ba, half the difference between forward and backward"),),
    needs=("velocity",),
    columns=_columns,
    joint=_joint,
)
