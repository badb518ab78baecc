"""Commands too small to do anything."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Ranges, Role, Shape, log_spaced
from dsd_cli.effects.joint_terms import JointTerms, Shaping


def _columns(channels: Channels, shape: Shape) -> tuple[Any, ...]:
    width = shape["width"]
    return (channels.u - np.clip(channels.u, -width, width),)


def _starts(ranges: Ranges) -> list[Shape]:
    return [{"width": w} for w in log_spaced(0.01 * ranges.top_drive, 0.7 * ranges.top_drive, 10)]


EFFECT = Effect(
    id="dead_zone",
    role=Role.INPUT,
    law="u_eff = 0 while abs(u) <= w, else u - w sgn u",
    summary="Commands below a threshold do nothing and larger ones lose it: valve overlap, dead time of a power stage.",
    pattern="the residual against the command is the command itself while small, and levels off at -w and +w",
    parameters=(Parameter("width", "{u}", "w, largest command that does nothing", lower=0.0, linear=False),),
    needs=(),
    columns=_columns,
    starts=_starts,
    joint=lambda values, _: JointTerms(command=(Shaping("dead", values["width"]),)),
    of_joint=lambda terms, _: [{"width": s.value} for s in terms.command if s.kind == "dead"],
)
