"""Drag of a fan, a propeller or a flow: it grows with the square of the speed."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Role, Shape
from dsd_cli.effects.joint_terms import JointTerms


def _columns(channels: Channels, _: Shape) -> tuple[Any, ...]:
    return (-channels.velocity * np.abs(channels.velocity),)


EFFECT = Effect(
    id="quadratic_drag",
    role=Role.APPLIED,
    law="-c abs(v) v",
    summary="Drag that grows with the square of the speed: fans, propellers, pumps, windage.",
    pattern="the residual over velocity is a parabola that changes sign at zero: nothing when slow, steep when fast",
    parameters=(Parameter("coefficient", "{u}/({v})^2", "c, force per speed squared", lower=0.0),),
    needs=("velocity",),
    columns=_columns,
    joint=lambda values, _: JointTerms(square_damping=values["coefficient"]),
    of_joint=lambda terms, _: [{"coefficient": terms.square_damping}] if terms.square_damping else [],
)
