"""The weight of a pendulum or of any arm that turns in a vertical plane."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Role, Shape, Values, amplitude_and_phase, sine_and_cosine
from dsd_cli.effects.joint_terms import JointTerms, Sine
from dsd_cli.signals.passes import sine_and_cosine_of


def _columns(channels: Channels, _: Shape) -> tuple[Any, ...]:
    sine, cosine = sine_and_cosine_of(channels.position)
    return -sine, -cosine


def _split(values: Values, _: float) -> tuple[tuple[float, ...], Shape]:
    return sine_and_cosine(values["amplitude"], values["phase"]), {}


def _join(coefficients: tuple[float, ...], _: Shape, __: float) -> Values:
    return dict(zip(("amplitude", "phase"), amplitude_and_phase(*coefficients), strict=True))


EFFECT = Effect(
    id="gravity",
    role=Role.APPLIED,
    law="-G sin(q + phi)",
    summary="Weight of an arm or pendulum; q + phi is the angle from hanging straight down.",
    pattern="the residual is a sine of the position with one period per turn, whatever the speed",
    parameters=(
        Parameter("amplitude", "{u}", "G = m g l", lower=0.0),
        Parameter("phase", "rad", "phi, angle from hanging straight down at q = 0", -np.pi, np.pi),
    ),
    needs=("position",),
    columns=_columns,
    split=_split,
    join=_join,
    rarity=3,
    of_angle=True,
    told_apart={
        "inertia": "hold the axis at several angles, or move slowly over a whole turn: gravity acts at rest,"
        " inertia does not",
        "stiffness": "move over half a turn or more: a spring keeps growing, gravity turns back",
        "constant_load": "move over half a turn: gravity changes with the angle, a constant load does not",
    },
    joint=lambda values, _: JointTerms(weights=(Sine(-values["amplitude"], 1.0, values["phase"]),)),
    of_joint=lambda terms, _: [_join(sine_and_cosine(-w.amplitude, w.phase), {}, 1.0) for w in terms.weights],
)
