"""The actuator follows its command with a delay of first order."""

from typing import Any

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Ranges, Role, Shape, decay, log_spaced
from dsd_cli.effects.joint_terms import JointTerms, Shaping
from dsd_cli.effects.memory import before_each, one_pole


def _columns(channels: Channels, shape: Shape, state: float | None) -> tuple[tuple[Any, ...], float]:
    """Mean of x over the interval that begins at each row, exact for a held u; state is x at its end.

    Without state the lag has settled on the first u.
    """
    u = channels.u
    time_constant = shape["time_constant"]
    even = isinstance(channels.interval, np.ndarray) and not any(channels.interval.strides)  # one for all rows
    interval = channels.interval[:1] if even else channels.interval
    left, mean_left = decay(interval / time_constant if time_constant > 0.0 else np.inf * (u * 0.0 + 1.0))
    if np.ndim(u) == 0:
        before = u if state is None else state
        return (u + (before - u) * mean_left,), left * before + (1.0 - left) * u
    left, mean_left = np.broadcast_to(left, u.shape), np.broadcast_to(mean_left, u.shape)
    before = state if state is not None else float(u[0]) if u.size else 0.0
    x = one_pole(left, (1.0 - left) * u, before)
    return (u + (before_each(x, before) - u) * mean_left,), float(x[-1]) if x.size else before


def _starts(ranges: Ranges) -> list[Shape]:
    longest = min(0.5, 300.0 * ranges.sample_time)
    return [{"time_constant": t} for t in log_spaced(0.3 * ranges.sample_time, longest, 12)]


EFFECT = Effect(
    id="actuator_lag",
    role=Role.INPUT,
    law="T x' + x = u, u_eff = x",
    summary="The actuator follows its command as a lag of first order: current loop, valve, drive with a filter.",
    pattern="the residual peaks wherever the command changes quickly and dies away with one time constant",
    parameters=(Parameter("time_constant", "s", "T of the lag", lower=0.0, linear=False),),
    needs=(),
    columns=_columns,
    starts=_starts,
    memory=True,
    lateness=lambda shape: float(shape["time_constant"]),
    told_apart={
        "delay": "apply steps of u and log at a higher rate: a lag rises gradually, a delay jumps",
    },
    joint=lambda values, _: JointTerms(command=(Shaping("lag", values["time_constant"]),)),
    of_joint=lambda terms, _: [{"time_constant": s.value} for s in terms.command if s.kind == "lag"],
)
