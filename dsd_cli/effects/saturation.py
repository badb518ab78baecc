"""The actuator gives no more than its limit."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Ranges, Role, Shape, log_spaced
from dsd_cli.effects.joint_terms import JointTerms, Shaping


def _columns(channels: Channels, shape: Shape) -> tuple[Any, ...]:
    return (np.clip(channels.u, -shape["limit"], shape["limit"]),)


def _starts(ranges: Ranges) -> list[Shape]:
    if not ranges.top_drive > 0.0:
        return []
    limits = [float(share * ranges.top_drive) for share in np.linspace(0.3, 0.99, 12)]
    if ranges.spike_drive > 1.3 * ranges.top_drive:  # steps of the reference: what clips may be spikes alone
        limits += log_spaced(1.2 * ranges.top_drive, 0.95 * ranges.spike_drive, 6)
    return [{"limit": limit} for limit in limits]


EFFECT = Effect(
    id="saturation",
    role=Role.INPUT,
    law="u_eff = u, kept within -limit and +limit",
    summary="The actuator gives no more than its limit, though the log holds a larger command.",
    pattern="the residual is zero for small commands and grows with what the command has above a limit",
    parameters=(Parameter("limit", "{u}", "largest command that acts", lower=0.0, linear=False),),
    needs=(),
    columns=_columns,
    starts=_starts,
    joint=lambda values, _: JointTerms(command=(Shaping("limit", values["limit"]),)),
    of_joint=lambda terms, _: [{"limit": s.value} for s in terms.command if s.kind == "limit"],
)
