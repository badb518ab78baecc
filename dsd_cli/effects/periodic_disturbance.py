"""A force that oscillates in time, whatever the axis does."""

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
from dsd_cli.effects.joint_terms import JointTerms
from dsd_cli.signals.passes import sine_and_cosine_of


def _columns(channels: Channels, shape: Shape) -> tuple[Any, ...]:
    """Mean over the interval around t, exact."""
    frequency = shape["frequency"]
    angle = 2.0 * np.pi * frequency * channels.t
    sine, cosine = sine_and_cosine_of(angle)
    if not np.any(channels.interval):
        return sine, cosine
    mean = sinc(frequency * channels.interval)
    return mean * sine, mean * cosine


def _starts(_: Ranges) -> list[Shape]:
    """None: the frequency is seen as a line in the spectrum of the residual, not from the ranges."""
    return []


def _split(values: Values, _: float) -> tuple[tuple[float, ...], Shape]:
    return sine_and_cosine(values["amplitude"], values["phase"]), {"frequency": values["frequency"]}


def _join(coefficients: tuple[float, ...], shape: Shape, _: float) -> Values:
    amplitude, phase = amplitude_and_phase(*coefficients)
    return {"amplitude": amplitude, "frequency": shape["frequency"], "phase": phase}


EFFECT = Effect(
    id="periodic_disturbance",
    role=Role.APPLIED,
    law="A sin(2 pi f t + phi)",
    summary="A force that oscillates in time whatever the axis does: an unbalanced fan, mains hum, a shaking base.",
    pattern="the residual has one sharp line in its spectrum that stays when speed and position change",
    parameters=(
        Parameter("amplitude", "{u}", "A", lower=0.0),
        Parameter("frequency", "Hz", "f", 1e-6, linear=False),
        Parameter("phase", "rad", "phi, at t = 0 of the log", -np.pi, np.pi),
    ),
    needs=(),
    columns=_columns,
    starts=_starts,
    seeds=lambda lines: [{"frequency": f} for f in lines.over_time],
    periods=lambda shape, ranges: shape["frequency"] * ranges.duration,
    repeats=lambda _: True,
    split=_split,
    join=_join,
    joint=lambda values, _: JointTerms(missing="force over time: whoever steps the simulation applies it"),
)
