"""Pushes from outside at known times: a collision, a hand, a load that is set down and taken away."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Ranges, Role, Shape, Values
from dsd_cli.effects.joint_terms import JointTerms


def _columns(channels: Channels, shape: Shape) -> tuple[Any, ...]:
    """For each pulse the share of the interval around t that it covers; without interval whether it is on."""
    return tuple(_covered(channels, start, end) for start, end in shape["edges"])


def _covered(channels: Channels, start: float, end: float) -> Any:
    t, interval = channels.t, channels.interval
    if isinstance(t, float) and isinstance(interval, float):  # in a simulation, sample by sample
        if not interval > 0.0:
            return 1.0 if start <= t < end else 0.0
        common = min(t + 0.5 * interval, end) - max(t - 0.5 * interval, start)
        return min(max(common, 0.0), interval) / interval
    common = np.minimum(t + 0.5 * interval, end) - np.maximum(t - 0.5 * interval, start)
    share = np.clip(common, 0.0, interval) / np.where(interval > 0.0, interval, 1.0)
    on = np.where((start <= t) & (t < end), 1.0, 0.0)
    return np.where(interval > 0.0, share, on)


def _starts(_: Ranges) -> list[Shape]:
    """None: when something pushed is seen in the residual over time, not from the ranges."""
    return []


def _split(values: Values, _: float) -> tuple[tuple[float, ...], Shape]:
    events = values["events"]
    edges = tuple((float(event["start"]), float(event["end"])) for event in events)
    return tuple(float(event["force"]) for event in events), {"edges": edges}


def _join(coefficients: tuple[float, ...], shape: Shape, _: float) -> Values:
    pulses = zip(shape["edges"], coefficients, strict=True)
    return {"events": [{"start": start, "end": end, "force": force} for (start, end), force in pulses]}


EFFECT = Effect(
    id="external_force",
    role=Role.APPLIED,
    law="sum of F_i while start_i <= t < end_i",
    summary="Pushes from outside at certain times: a collision, a hand, a part that is set down and taken away.",
    pattern="the residual steps up and back at instants that neither speed, position nor command explain",
    parameters=(
        Parameter("events", "s, s, {u}", "list of { start, end, force }, each a rectangular pulse", listed=True),
    ),
    needs=(),
    columns=_columns,
    starts=_starts,
    split=_split,
    join=_join,
    joint=lambda values, _: JointTerms(missing="force over time: whoever steps the simulation applies it"),
)
