"""What a channel does: rises evenly, stays, switches, counts, moves, or is the slope of another one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

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


#: Samples over which both are averaged, one after the other: an encoder's steps ask for more.
SPANS = (1, 3, 9, 27, 81)
#: Of two positions that a speed is the slope of, that is the measured one of which so many times less is left.
CLOSER = 3.0
#: Windows of that span that a log must have.
FEWEST = 30
#: Longest lag that is looked for, samples.
LAGS = 40
#: A longer average is the better one from this much more of the square on.
BETTER_SLOPE = 1e-3
#: No axis goes through more than this share of its travel from one row to the next: there its position wraps.
WRAPS = 0.5


class Slope(NamedTuple):
    """w = scale * dp/dt, delayed by `lag` samples; `share` of w's square it explains, `span` samples averaged over."""

    scale: float
    share: float
    lag: int
    span: int


def slope_of(t: Array, p: Array, w: Array, fewest: int = FEWEST, spans: Sequence[int] = SPANS) -> Slope:
    """How well `w` is the slope of `p`: over spans of samples the mean of w is the increase of p by their length.

    Parameters
    ----------
    t : s (or any unit: the scale is per that), rising, shape (n,); p, w : finite, shape (n,).
    fewest : windows of a span. spans : samples that are averaged over, of which the best is taken.
    """
    best = Slope(0.0, 0.0, 0, 1)
    p = _unwrapped(p)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(t))])
    for span in spans:
        if t.size < fewest * span:
            break
        length = t[span:] - t[:-span]
        slope = (p[span:] - p[:-span]) / length
        mean = (area[span:] - area[:-span]) / length
        lag = lag_of(slope, mean, LAGS)
        a, b = (slope[: slope.size - lag], mean[lag:]) if lag >= 0 else (slope[-lag:], mean[:lag])
        power, own = float(a @ a), float(b @ b)
        if power <= 0.0 or own <= 0.0:
            continue
        scale = float(a @ b) / power
        share = scale * float(a @ b) / own
        if share > best.share + BETTER_SLOPE:
            best = Slope(scale, share, lag, span)
    return best


def is_rather_the_motion(t: Array, one: tuple[Array, Array], other: tuple[Array, Array], span: int) -> bool:
    """Whether of two pairs of a position and its slope the first is the measured motion; `span`: see `Slope`.

    Of two positions with the same slope it is the one to which that stays closer: over the longest spans, where steps
    of an encoder are averaged out and what is left of a target is the tracking error.
    """
    if one[1] is other[1]:
        spans = (max((many for many in SPANS if t.size >= FEWEST * many), default=1),)
        left, its_left = (1.0 - slope_of(t, *pair, spans=spans).share for pair in (one, other))
        if left > CLOSER * its_left or its_left > CLOSER * left:
            return left < its_left
    mine, its = (slope_of(t, *pair, spans=(span,)) for pair in (one, other))
    return (mine.lag >= 0, mine.share) > (its.lag >= 0, its.share + BETTER_SLOPE)


def _unwrapped(p: Array) -> Array:
    """The same with the steps of the rows around it where it wraps, or where a value is none of the axis's."""
    steps = np.diff(p)
    far = np.abs(steps) > WRAPS * np.ptp(p)
    if far.all():
        return p
    steps[far] = np.interp(np.flatnonzero(far), np.flatnonzero(~far), steps[~far])
    return np.concatenate([p[:1], p[0] + np.cumsum(steps)])


def lag_of(x: Array, y: Array, longest: int) -> int:
    """By how many samples y comes after x, at most `longest`: where they are most alike."""
    size = 1 << int(np.ceil(np.log2(2 * x.size)))
    across = np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)
    most = min(longest, x.size // 8)
    lags = np.r_[0 : most + 1, -most:0]
    return int(lags[int(np.argmax(np.abs(across[lags])))])
