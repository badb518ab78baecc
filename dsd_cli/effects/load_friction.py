"""Friction that grows with the force that is transmitted: gears, worm drives, screws."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Role, Shape
from dsd_cli.effects.joint_terms import JointTerms


def _columns(channels: Channels, _: Shape) -> tuple[Any, ...]:
    return (np.abs(channels.u),)


EFFECT = Effect(
    id="load_friction",
    role=Role.FRICTION,
    law="-mu abs(u) sgn v",
    summary="Friction of a gear, worm or screw that grows with the force it transmits, taken as the command that acts.",
    pattern="the residual over velocity is a step whose height grows with the command",
    parameters=(Parameter("coefficient", "1", "mu, friction per transmitted force", lower=0.0, upper=1.0),),
    needs=("velocity", "u"),
    columns=_columns,
    rarity=4,
    joint=lambda values, _: JointTerms(missing="dry friction that grows with the command"),
)
