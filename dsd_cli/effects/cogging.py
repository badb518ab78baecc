"""Torque ripple of a motor or of a transmission over position."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import (
    Channels,
    Effect,
    Parameter,
    Ranges,
    Role,
    Shape,
    Values,
    amplitude_and_phase,
    sinc,
    sine_and_cosine,
)
from dsd_cli.effects.joint_terms import JointTerms, Sine
from dsd_cli.signals.passes import sine_and_cosine_of


def _columns(channels: Channels, shape: Shape) -> tuple[Any, ...]:
    """Mean over the interval at its mean speed; the speed is there wherever the position is."""
    periods = shape["periods"]
    angle = periods * channels.position
    sine, cosine = sine_and_cosine_of(angle)
    if not np.any(channels.interval):
        return sine, cosine
    moved = sinc(periods * channels.velocity * channels.interval / (2.0 * np.pi))
    return moved * sine, moved * cosine


def _starts(_: Ranges) -> list[Shape]:
    """None: which of some hundred periods it may be is seen in the residual over position, not from the ranges."""
    return []


def _split(values: Values, _: float) -> tuple[tuple[float, ...], Shape]:
    return sine_and_cosine(values["amplitude"], values["phase"]), {"periods": values["periods"]}


def _join(coefficients: tuple[float, ...], shape: Shape, _: float) -> Values:
    amplitude, phase = amplitude_and_phase(*coefficients)
    return {"amplitude": amplitude, "periods": shape["periods"], "phase": phase}


EFFECT = Effect(
    id="cogging",
    role=Role.APPLIED,
    law="A sin(n q + phi)",
    summary="Ripple over position: cogging of the motor, pitch of a screw or belt, a wobbling gear.",
    pattern="the residual is a sine of the position with many periods per turn or stroke, at the same places each pass",
    parameters=(
        Parameter("amplitude", "{u}", "A", lower=0.0),
        Parameter("periods", "rad/({q})", "n: periods per turn (rotary), 2 pi / pitch (linear)", 1e-6, linear=False),
        Parameter("phase", "rad", "phi", -np.pi, np.pi),
    ),
    needs=("position",),
    columns=_columns,
    starts=_starts,
    seeds=lambda lines: [{"periods": n} for n in lines.over_position],
    periods=lambda shape, ranges: shape["periods"] * ranges.travel / (2.0 * np.pi),
    repeats=lambda ranges: ranges.passes >= 2.0,
    split=_split,
    join=_join,
    told_apart={
        "periodic_disturbance": "move at two different speeds: cogging keeps its place, not its frequency",
    },
    joint=lambda values, _: JointTerms(ripples=(Sine(values["amplitude"], values["periods"], values["phase"]),)),
    of_joint=lambda terms, _: [
        _join(sine_and_cosine(r.amplitude, r.phase), {"periods": r.periods}, 1.0) for r in terms.ripples
    ],
)
