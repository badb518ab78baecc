"""A spring to ground: a cable carrier, a hose, a balancing spring."""

from typing import Any

from dsd_cli.effects.base import Channels, Effect, Parameter, Role, Shape
from dsd_cli.effects.joint_terms import JointTerms


def _columns(channels: Channels, _: Shape) -> tuple[Any, ...]:
    return (-channels.position,)


EFFECT = Effect(
    id="stiffness",
    role=Role.APPLIED,
    law="-k q",
    summary="A spring that pulls towards q = 0: cable carriers, hoses, counterbalance springs.",
    pattern="the residual is a straight line over position, falling, also at rest",
    parameters=(Parameter("coefficient", "{u}/({q})", "k, force per position"),),
    needs=("position",),
    columns=_columns,
    rarity=5,
    told_apart={
        "cubic_stiffness": "move further out: the cubic part grows faster",
    },
    joint=lambda values, _: JointTerms(linear_spring=values["coefficient"]),
    of_joint=lambda terms, _: [{"coefficient": terms.linear_spring}] if terms.linear_spring else [],
)
