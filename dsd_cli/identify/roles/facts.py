"""What one channel does by itself: rises evenly, stays, switches, counts, or moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dsd_cli.signals.log import Array
from dsd_cli.signals.rounding import ROUNDING

#: What a channel may be by itself.
Kind = Literal["empty", "text", "constant", "boolean", "clock", "counter", "drift", "signal"]
#: Of a clock: the share of its steps that go forward, of those the share that is usual, and by how much of the median
#: the usual ones differ from it.
FORWARD, USUAL, APART = 0.97, 0.9, 0.5
#: A channel drifts whose ends are this share of its whole way apart, with fewer turns than that.
DRIFTS, TURNS = 0.98, 3
#: Values out of which a channel of two of them is a state, at least, and how many are looked at.
STATES, LOOKED_AT = 5, 20_000


@dataclass(frozen=True, eq=False)
class Channel:
    """Name, unit as the log says it, and values, shape (n,), NaN where there is none; None: text."""

    name: str
    values: Array | None
    unit: str = ""
    boolean: bool = False


@dataclass(frozen=True)
class Facts:
    """`low`, `high`, in the channel's own unit; of a clock the `step` between rows and how `even`, 0 is best."""

    kind: Kind
    low: float = float("nan")
    high: float = float("nan")
    step: float = 0.0
    even: float = 0.0

    @property
    def moves(self) -> bool:
        """Whether it may be a signal of the axis."""
        return self.kind in ("signal", "drift", "clock")


def facts_of(channel: Channel) -> Facts:
    """What the values show."""
    if channel.values is None:
        return Facts("text")
    x = channel.values[np.isfinite(channel.values)]
    if not x.size:
        return Facts("empty")
    low, high = float(x.min()), float(x.max())
    if low == high:
        return Facts("constant", low, high)
    two = x.size >= STATES and np.unique(x[:: max(x.size // LOOKED_AT, 1)]).size <= 2
    if channel.boolean or (two and _whole(x)):
        return Facts("boolean", low, high)
    steps = np.diff(x)
    forward = steps[steps > 0.0]
    if forward.size >= FORWARD * steps.size and forward.size > 2:
        step = float(np.median(forward))
        usual = np.abs(forward - step) <= APART * step
        if np.mean(usual) >= USUAL:
            mean = float(np.mean(forward[usual]))
            even = float(np.std(forward[usual]) / mean)
            counts = even < ROUNDING and step == 1.0 and _whole(x)
            return Facts("counter" if counts else "clock", low, high, mean, even)
    turns = np.count_nonzero(np.diff(np.sign(steps[steps != 0.0])))
    if np.abs(steps.sum()) >= DRIFTS * np.abs(steps).sum() and turns < TURNS:
        return Facts("drift", low, high)
    return Facts("signal", low, high)


def _whole(x: Array) -> bool:
    return bool(np.all(x == np.round(x)))
