"""Where a model fails: by what the axis does, by time, speed, position and frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.compare.evaluation import Evaluation, Stretch
from dsd_cli.identify.recordings.motion import acceleration
from dsd_cli.signals.log import Array
from dsd_cli.signals.runs import runs

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


def where(evaluation: Evaluation) -> Where:
    """The error of the rows that count, by regime, time, speed, position and frequency."""
    errors = evaluation.errors
    return Where(
        regimes=_regimes(evaluation, errors),
        time=_segments(evaluation),
        velocity=_bins(evaluation, "velocity", errors),
        position=_bins(evaluation, "position", errors),
        frequency=_bands(evaluation, errors),
    )


def _regimes(evaluation: Evaluation, errors: Array) -> tuple[Regime, ...]:
    if any("velocity" not in s.log for s in evaluation.stretches):
        return ()
    masks = regime_masks(evaluation)
    found = []
    for name, mask in masks.items():
        if mask.any():
            share = _share(errors, mask)
            found.append(Regime(name, float(mask.mean()), share, _rms(errors[mask]), overlaps=name in ACROSS))
    return tuple(found)


def regime_masks(evaluation: Evaluation) -> dict[str, Mask]:
    """Regime -> which of the rows that count belong to it, shape (n,)."""
    stretches = evaluation.stretches
    rest, breakaway, reversal = (
        np.concatenate(parts) for parts in zip(*(_transitions(s) for s in stretches), strict=True)
    )
    speed = np.abs(evaluation.pooled(lambda s: s.log["velocity"]))
    moving = ~(rest | breakaway | reversal)
    low, high = np.quantile(speed[moving], (1 / 3, 2 / 3)) if moving.any() else (0.0, 0.0)
    change = evaluation.pooled(lambda s: acceleration(s.log, evaluation.observer.time_constant))
    gaining = change * np.sign(evaluation.pooled(lambda s: s.log["velocity"]))
    enough = _ACCELERATES * float(np.percentile(np.abs(change), 99))
    top = max(float(np.abs(s.log["u"]).max()) for s in stretches)
    return {
        "rest": rest & ~breakaway & ~reversal,
        "breakaway": breakaway,
        "reversal": reversal & ~breakaway,
        "slow": moving & (speed <= low),
        "medium": moving & (speed > low) & (speed <= high),
        "fast": moving & (speed > high),
        "accelerating": ~rest & (gaining > enough),
        "decelerating": ~rest & (gaining < -enough),
        "saturated": np.concatenate([_saturated(s.log["u"], top)[s.first :] for s in stretches]),
    }


def _transitions(stretch: Stretch) -> tuple[Mask, Mask, Mask]:
    """(rest, the time after a rest, the time around a change of direction), rows that count."""
    v, t = stretch.log["velocity"], stretch.log["t"]
    rest = np.abs(v) <= stretch.model.rest_speed
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
    return rest[stretch.first :], breakaway[stretch.first :], reversal[stretch.first :]


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


def _segments(evaluation: Evaluation) -> tuple[Bin, ...]:
    """Equal parts of every log, `SEGMENTS` in all or one per log."""
    names = tuple(dict.fromkeys(s.name for s in evaluation.stretches))
    total, found = evaluation.errors, []
    for name in names:
        own = evaluation.of(name)
        errors, t = own.errors, own.pooled(lambda s: s.log["t"])
        rows = np.array_split(np.arange(len(errors)), max(SEGMENTS // len(names), 1))
        found += [_bin(float(t[i[0]]), float(t[i[-1]]), errors[i], total, name) for i in rows if len(i)]
    return tuple(found)


def _bins(evaluation: Evaluation, channel: str, errors: Array) -> tuple[Bin, ...]:
    """Bins of equal width over the range of the channel, with an edge at 0; empty ones are left out."""
    if any(channel not in s.log for s in evaluation.stretches):
        return ()
    x = evaluation.pooled(lambda s: s.log[channel])
    width = float(np.ptp(x)) / BINS
    if width <= 0.0:
        return ()
    number = np.floor(x / width).astype(np.int64)
    return tuple(_bin(float(i * width), float((i + 1) * width), errors[number == i], errors) for i in np.unique(number))


def _bin(start: float, end: float, errors: Array, total: Array, log: str = "") -> Bin:
    energy = float(np.sum(total**2))
    share = float(np.sum(errors**2)) / energy if energy > 0.0 else 0.0
    return Bin(start, end, len(errors) / len(total), share, _rms(errors), float(errors.mean()), log)


def _bands(evaluation: Evaluation, errors: Array) -> tuple[Band, ...]:
    """Octaves below half the sampling rate; the lowest band goes down to 0. Irregular stamps are taken as regular."""
    top = 0.5 / evaluation.sample_time
    edges = np.concatenate([[0.0], top * 2.0 ** np.arange(-OCTAVES, 1.0)])
    energy = np.zeros(len(edges) - 1)
    for stretch in evaluation.stretches:
        own = stretch.errors
        power = np.abs(np.fft.rfft(own)) ** 2 / len(own)
        power[1 : (len(own) + 1) // 2] *= 2.0
        frequency = np.fft.rfftfreq(len(own), evaluation.sample_time)
        number = np.clip(np.searchsorted(edges, frequency, side="right") - 1, 0, len(energy) - 1)
        energy += np.bincount(number, power, minlength=len(energy))
    total = float(energy.sum())
    return tuple(
        Band(float(a), float(b), float(x) / total if total > 0.0 else 0.0, float(np.sqrt(x / len(errors))))
        for a, b, x in zip(edges[:-1], edges[1:], energy, strict=True)
    )


def _share(errors: Array, mask: Mask) -> float:
    energy = float(np.sum(errors**2))
    return float(np.sum(errors[mask] ** 2)) / energy if energy > 0.0 else 0.0


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))
