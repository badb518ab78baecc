"""The weight of a pendulum or of any arm that turns in a vertical plane."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Role


def _columns(channels: Channels, shape: Mapping[str, float]) -> tuple[Any, ...]:
    return (-np.sin(channels.position + shape["phase"]),)


EFFECT = Effect(
    id="gravity",
    role=Role.APPLIED,
    law="-G sin(q + phi)",
    summary="Weight of an arm or pendulum; q + phi is the angle from hanging straight down.",
    pattern="the residual is a sine of the position with one period per turn, whatever the speed",
    parameters=(
        Parameter("amplitude", "{u}", "G = m g l", lower=0.0),
        Parameter("phase", "rad", "phi, angle from hanging straight down at q = 0", -np.pi, np.pi, linear=False),
    ),
    needs=("position",),
    columns=_columns,
)
