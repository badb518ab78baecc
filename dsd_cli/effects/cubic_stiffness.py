"""A spring that stiffens with deflection, or (negative) softens."""

from typing import Any

from dsd_cli.effects.base import Channels, Effect, Parameter, Role, Shape
from dsd_cli.effects.joint_terms import JointTerms


def _columns(channels: Channels, _: Shape) -> tuple[Any, ...]:
    return (-channels.position * channels.position * channels.position,)


EFFECT = Effect(
    id="cubic_stiffness",
    role=Role.APPLIED,
    law="-k3 q^3",
    summary="A spring that stiffens with deflection (k3 > 0) or softens: rubber, flexures, clamped cables.",
    pattern="the residual over position is flat in the middle and bends steeply towards both ends",
    parameters=(Parameter("coefficient", "{u}/({q})^3", "k3, force per position cubed"),),
    needs=("position",),
    columns=_columns,
    joint=lambda values, _: JointTerms(cubic_spring=values["coefficient"]),
    of_joint=lambda terms, _: [{"coefficient": terms.cubic_spring}] if terms.cubic_spring else [],
)
