"""A force that is always there: the weight of a vertical axis, an offset of the amplifier."""

from collections.abc import Mapping
from typing import Any

from dsd_cli.effects.base import Channels, Effect, Parameter, Role
from dsd_cli.effects.joint_terms import JointTerms


def _columns(channels: Channels, _: Mapping[str, float]) -> tuple[Any, ...]:
    return (0.0 * channels.u + 1.0,)


EFFECT = Effect(
    id="constant_load",
    role=Role.APPLIED,
    law="F0",
    summary="A constant force: weight of a vertical axis, offset or drift of the amplifier.",
    pattern="the residual has a mean that does not depend on motion",
    parameters=(
        Parameter("force", "{u}", "F0 on the axis, positive accelerates; from u = M a + ... + offset: -offset"),
    ),
    needs=(),
    columns=_columns,
    rarity=2,
    varies=("force",),
    joint=lambda values, _: JointTerms(constant=values["force"]),
    of_joint=lambda terms, _: [{"force": terms.constant}] if terms.constant else [],
)
