"""Viscous friction, and whatever acts like it (back-EMF of a motor fed with a voltage)."""

from collections.abc import Mapping
from typing import Any

from dsd_cli.effects.base import Channels, Effect, Parameter, Role
from dsd_cli.effects.joint_terms import JointTerms


def _columns(channels: Channels, _: Mapping[str, float]) -> tuple[Any, ...]:
    return (-channels.velocity,)


EFFECT = Effect(
    id="viscous_friction",
    role=Role.APPLIED,
    law="-B v",
    summary="Friction proportional to speed: lubricated bearings, eddy currents, back-EMF of a voltage drive.",
    pattern="the residual is a straight line through zero over velocity, falling",
    parameters=(Parameter("coefficient", "{u}/({v})", "B, force per speed", lower=0.0),),
    needs=("velocity",),
    columns=_columns,
    rarity=1,
    varies=("coefficient",),
    told_apart={
        "quadratic_drag": "move at constant speed at three speeds or more, a fast one among them",
    },
    joint=lambda values, _: JointTerms(linear_damping=values["coefficient"]),
    of_joint=lambda terms, _: [{"coefficient": terms.linear_damping}] if terms.linear_damping else [],
)
