"""Where a model fails: by what the axis does, by time, speed, position and frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.compare.balance import Left, PieceResidual, acceleration
from dsd_cli.signals.log import Array
from dsd_cli.signals.runs import runs
from dsd_cli.signals.spread import rms

Mask = NDArray[np.bool_]

#: s after a rest that are breakaway, and s on either side of a change of direction that are reversal.
BREAKAWAY, REVERSAL = 0.05, 0.05
#: Regimes that lie across the others; those exclude each other and together are all samples.
ACROSS = ("accelerating", "decelerating", "saturated")
SEGMENTS, BINS, OCTAVES = 10, 10, 9
#: Acceleration counts from this share of its 99th percentile on.
_ACCELERATES = 0.2
#: |u| is at its limit within this share of its maximum, for at least so many samples at once.
_AT_LIMIT, _PLATEAU = 1e-4, 5


@dataclass(frozen=True)
class Regime:
    """Error in one regime; `overlaps`: it lies across the exclusive ones, whose shares sum to 1."""

    regime: str
    share_of_samples: float
    share_of_error: float
    rmse: float
    overlaps: bool = False


@dataclass(frozen=True)
class Bin:
    """Error of the samples from `start` to `end` (s, rad/s or m/s, rad or m); `log` names the log of a time segment."""

    start: float
    end: float
    share_of_samples: float
    share_of_error: float
    rmse: float
    bias: float
    log: str = ""


@dataclass(frozen=True)
class Band:
    """Share of the squared error between two frequencies, Hz; rmse in the unit of u. The lowest holds the bias."""

    start: float
    end: float
    share_of_error: float
    rmse: float


@dataclass(frozen=True)
class Where:
    """All the tables; those of a channel that the log lacks are empty."""

    regimes: tuple[Regime, ...]
    time: tuple[Bin, ...]
    velocity: tuple[Bin, ...]
    position: tuple[Bin, ...]
    frequency: tuple[Band, ...]


def where(left: Left) -> Where:
    """What is left in the rows that count, by regime, time, speed, position and frequency."""
    errors = left.errors
    return Where(
        regimes=_regimes(left, errors),
        time=_segments(left),
        velocity=_bins(left, "velocity", errors),
        position=_bins(left, "position", errors),
        frequency=_bands(left, errors),
    )


def _regimes(left: Left, errors: Array) -> tuple[Regime, ...]:
    if any("velocity" not in part.log for part in left.parts):
        return ()
    masks = regime_masks(left)
    found, energy = [], float(np.sum(errors**2))
    for name, mask in masks.items():
        if mask.any():
            share = float(np.sum(errors[mask] ** 2)) / energy if energy > 0.0 else 0.0
            found.append(Regime(name, float(mask.mean()), share, rms(errors[mask]), overlaps=name in ACROSS))
    return tuple(found)


def regime_masks(left: Left) -> dict[str, Mask]:
    """Regime -> which of the rows that count belong to it, shape (n,)."""
    turns = [_transitions(part) for part in left.parts]
    rest, breakaway, reversal = (
        np.concatenate([mask[part.rows] for mask, part in zip(masks, left.parts, strict=True)])
        for masks in zip(*turns, strict=True)
    )
    velocity = left.pooled(lambda part: part.log["velocity"])
    speed = np.abs(velocity)
    moving = ~(rest | breakaway | reversal)
    low, high = np.quantile(speed[moving], (1 / 3, 2 / 3)) if moving.any() else (0.0, 0.0)
    change = left.pooled(lambda part: acceleration(part.log, left.time_constant))
    gaining = change * np.sign(velocity)
    enough = _ACCELERATES * float(np.percentile(np.abs(change), 99))
    top = max(float(np.abs(part.log["u"]).max()) for part in left.parts)
    return {
        "rest": rest & ~breakaway & ~reversal,
        "breakaway": breakaway,
        "reversal": reversal & ~breakaway,
        "slow": moving & (speed <= low),
        "medium": moving & (speed > low) & (speed <= high),
        "fast": moving & (speed > high),
        "accelerating": ~rest & (gaining > enough),
        "decelerating": ~rest & (gaining < -enough),
        "saturated": np.concatenate([_saturated(part.log["u"], top)[part.rows] for part in left.parts]),
    }


def _transitions(part: PieceResidual) -> tuple[Mask, Mask, Mask]:
    """(rest, the time after a rest, the time around a change of direction), of all samples."""
    v, t = part.log["velocity"], part.log["t"]
    rest = np.abs(v) <= part.rest_speed
    sign = np.where(rest, 0.0, np.sign(v))
    index = np.arange(len(v))
    last = np.maximum.accumulate(np.where(sign != 0.0, index, -1))  # last moving row up to each
    starts = np.flatnonzero(rest[:-1] & ~rest[1:]) + 1
    before = last[starts - 1]
    rested = (before < 0) | (t[starts] - t[np.maximum(before, 0)] > REVERSAL)
    breakaway = _within(t, t[starts[rested]], 0.0, BREAKAWAY) & ~rest
    moved = np.flatnonzero(sign[1:] != 0.0) + 1
    earlier = last[moved - 1]
    turned = moved[(earlier >= 0) & (sign[np.maximum(earlier, 0)] == -sign[moved])]
    quick = turned[t[turned] - t[last[turned - 1]] <= REVERSAL]
    reversal = _within(t, t[quick], REVERSAL, REVERSAL)
    return rest, breakaway, reversal


def _within(t: Array, events: Array, before: float, after: float) -> Mask:
    """Stamps within `before` s before or `after` s after an event."""
    inside = np.zeros(len(t) + 1, dtype=np.int64)
    np.add.at(inside, np.searchsorted(t, events - before), 1)
    np.add.at(inside, np.searchsorted(t, events + after), -1)
    return np.cumsum(inside)[:-1] > 0


def _saturated(u: Array, top: float) -> Mask:
    """|u| at its maximum for at least `_PLATEAU` samples at once."""
    at = np.abs(u) >= (1.0 - _AT_LIMIT) * top if top > 0.0 else np.zeros(len(u), dtype=bool)
    mask = np.zeros(len(u), dtype=bool)
    for a, b in runs(at):
        mask[a:b] = _PLATEAU <= b - a < len(u)
    return mask


def _segments(left: Left) -> tuple[Bin, ...]:
    """Equal parts of every log, `SEGMENTS` in all or one per log."""
    names = tuple(dict.fromkeys(part.name for part in left.parts))
    total, found = left.errors, []
    for name in names:
        own = left.of(name)
        errors, t = own.errors, own.pooled(lambda part: part.log["t"])
        rows = np.array_split(np.arange(len(errors)), max(SEGMENTS // len(names), 1))
        found += [_bin(float(t[i[0]]), float(t[i[-1]]), errors[i], total, name) for i in rows if len(i)]
    return tuple(found)


def _bins(left: Left, channel: str, errors: Array) -> tuple[Bin, ...]:
    """Bins of equal width over the range of the channel, with an edge at 0; empty ones are left out."""
    if any(channel not in part.log for part in left.parts):
        return ()
    x = left.pooled(lambda part: part.log[channel])
    width = float(np.ptp(x)) / BINS
    if width <= 0.0:
        return ()
    number = np.floor(x / width).astype(np.int64)
    return tuple(_bin(float(i * width), float((i + 1) * width), errors[number == i], errors) for i in np.unique(number))


def _bin(start: float, end: float, errors: Array, total: Array, log: str = "") -> Bin:
    energy = float(np.sum(total**2))
    share = float(np.sum(errors**2)) / energy if energy > 0.0 else 0.0
    return Bin(start, end, len(errors) / len(total), share, rms(errors), float(errors.mean()), log)


def _bands(left: Left, errors: Array) -> tuple[Band, ...]:
    """Octaves below half the rate of the rows; the lowest goes down to 0. Irregular stamps are taken as regular."""
    top = 0.5 / left.interval
    edges = np.concatenate([[0.0], top * 2.0 ** np.arange(-OCTAVES, 1.0)])
    energy = np.zeros(len(edges) - 1)
    for part in left.parts:
        own = part.series
        power = np.abs(np.fft.rfft(own)) ** 2 / max(len(own), 1)
        power[1 : (len(own) + 1) // 2] *= 2.0
        frequency = np.fft.rfftfreq(len(own), part.interval)
        number = np.clip(np.searchsorted(edges, frequency, side="right") - 1, 0, len(energy) - 1)
        energy += np.bincount(number, power, minlength=len(energy))
    total = float(energy.sum())
    return tuple(
        Band(float(a), float(b), float(x) / total if total > 0.0 else 0.0, float(np.sqrt(x / len(errors))))
        for a, b, x in zip(edges[:-1], edges[1:], energy, strict=True)
    )
