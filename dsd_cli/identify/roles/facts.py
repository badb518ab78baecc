"""What one channel does by itself: rises evenly, stays, switches, counts, or moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dsd_cli.signals.log import Array

#: What a channel may be by itself.
Kind = Literal["empty", "text", "constant", "boolean", "clock", "counter", "drift", "signal"]
#: Of a clock: the share of its steps that go forward, of those the share within half of the median one, and by how much
#: of the median its usual steps differ.
FORWARD, USUAL = 0.97, 0.9
#: A channel of fewer values than this, all of them whole, that never goes far from one to the next, is a state word.
DRIFTS = 0.98


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
    if channel.boolean or (x.size > 4 and np.unique(x[:: max(x.size // 20_000, 1)]).size <= 2 and _whole(x)):
        return Facts("boolean", low, high)
    steps = np.diff(x)
    forward = steps[steps > 0.0]
    if forward.size >= FORWARD * steps.size and forward.size > 2:
        step = float(np.median(forward))
        usual = np.abs(forward - step) <= 0.5 * step
        if np.mean(usual) >= USUAL:
            mean = float(np.mean(forward[usual]))
            even = float(np.std(forward[usual]) / mean)
            counts = even < 1e-12 and step == 1.0 and _whole(x)
            return Facts("counter" if counts else "clock", low, high, mean, even)
    turns = np.count_nonzero(np.diff(np.sign(steps[steps != 0.0])))
    if np.abs(steps.sum()) >= DRIFTS * np.abs(steps).sum() and turns < 3:
        return Facts("drift", low, high)
    return Facts("signal", low, high)


def _whole(x: Array) -> bool:
    return bool(np.all(x == np.round(x)))
