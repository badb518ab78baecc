"""On what the residual depends: how much of it a free-form function of each channel explains on held-out blocks.

The functions are sums of hats over quantiles of the channel, with a jump at zero speed; each hat is a force that passes
Q like every force does. A share above zero is one that held: the function was fitted elsewhere in the log.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from dsd_cli.identify.compare.evaluation import Evaluation, Stretch
from dsd_cli.identify.fit.basis import basis
from dsd_cli.identify.recordings.motion import acceleration
from dsd_cli.plant.filtering import poles_of
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.log import Array, Log

#: Hats of one channel alone, of each channel in a pair, and fine ones for what repeats along the position.
HATS, HATS_IN_PAIR, FINE_HATS = 12, 6, 48
#: The time is cut into held-out blocks itself: its hats must be wider than these.
TIME_HATS = 5
#: A pair is named if it explains so much more than either channel alone.
PAIR_GAIN = 0.05
#: Rows that are used at most; of a longer log, chunks of about this length spread over it.
MOST_ROWS, CHUNK = 40_000, 4_000
FOLDS, MOST_BLOCKS, FEWEST_BLOCKS = 5, 20, 4
#: A block is at least this many gaps long.
SHORTEST_BLOCK = 3
#: Penalty on bends of the function, and on its size, as a share of the mean information on a hat.
_BENDS, _SIZE = 1e-3, 1e-6


@dataclass(frozen=True)
class Dependence:
    """`explains`: share of the residual's variance, on held-out blocks, that a function of the channels `on` takes."""

    channels: tuple[str, ...]
    explains: float

    @property
    def on(self) -> str:
        """`velocity`, or `velocity x position` for a pair."""
        return " x ".join(self.channels)


@dataclass(frozen=True)
class Inputs:
    """What free-form functions look at: means over the interval that ends at each row, shape (n,).

    Attributes
    ----------
    values : channel -> velocity, position, u (delayed, at the plant), acceleration, time; those that the log has.
    sign : mean of sgn v; NaN at rest.
    held : net force of the model at rest, where friction would hold what the model thinks moves; 0 while moving.
    first : the rows before it do not count.
    """

    frame: Frame
    observer: ObserverSettings
    values: Mapping[str, Array]
    sign: Array
    held: Array
    first: int


class Columns(NamedTuple):
    """Regressors as d_hat shows them (rows that count), shape (n, c), and the penalty on their weights, (c, c)."""

    values: Array
    penalty: Array


def inputs_of(piece: Log, model: PlantModel, observer: ObserverSettings, first: int) -> Inputs:
    """The channels of a piece of a recording (which has t, u and velocity)."""
    frame = Frame(piece)
    motion = frame.motion(model.rest_speed)
    slope = acceleration(piece, observer.time_constant)
    values = {
        "velocity": motion.velocity,
        "u": frame.mean_u(frame.command(model.effects), model.delay),
        "acceleration": 0.5 * (slope + np.concatenate([slope[:1], slope[:-1]])),
        "time": frame.times - 0.5 * frame.intervals,
    }
    if "position" in piece:
        values["position"] = motion.position
    held = np.where(np.isnan(motion.sign), frame.net_force(model), 0.0)
    return Inputs(frame, observer, values, motion.sign, held, first)


def freeform_columns(inputs: Sequence[Inputs], channels: Sequence[str], hats: int | None = None) -> Columns:
    """Columns of a free-form function of one channel, or of two together (tensor product), over all pieces.

    Parameters
    ----------
    channels : names in `Inputs.values`, or "direction" for sgn v alone.
    hats : per channel; by default `HATS` for one and `HATS_IN_PAIR` for each of two.
    """
    count = hats or (HATS if len(channels) == 1 else HATS_IN_PAIR)
    counts = [min(count, TIME_HATS) if channel == "time" else count for channel in channels]
    units, penalty = basis(inputs, channels, counts)
    raw = [one.together() for one in units]
    if {"velocity", "direction"} & set(channels):
        top = max(float(np.abs(piece.held).max()) for piece in inputs)
        if top > 0.0:
            raw = [np.column_stack([a, piece.held / top]) for a, piece in zip(raw, inputs, strict=True)]
            penalty = np.pad(penalty, (0, 1))
    seen = [seen_columns(a, piece)[piece.first :] for a, piece in zip(raw, inputs, strict=True)]
    return Columns(np.concatenate(seen), penalty)


def seen_columns(x: Array, piece: Inputs) -> Array:
    """`Frame.seen` of every column of x, shape (n, c), all in one pass."""
    x = np.column_stack([piece.frame.seen(column, None) for column in x.T])
    poles = poles_of(piece.frame.intervals.tolist(), piece.observer.time_constant)
    out = (1.0 - poles)[:, None] * x
    state = x[0]
    for row, pole in zip(out, poles.tolist(), strict=True):
        state = row + pole * state
        row[:] = state
    return out


def explained_share(residual: Array, columns: Columns, gap: int) -> float | None:
    """Share of the residual's variance about its mean that the columns explain on blocks that the fit did not see.

    Parameters
    ----------
    residual : shape (n,), the rows of `columns`.
    gap : samples left out between what is fitted and what is held out.

    Returns
    -------
    At most 1, below 0 where the fit only harms; None if n is too small for blocks with such gaps.
    """
    folds = held_out_folds(len(residual), gap)
    if not folds:
        return None
    x = np.column_stack([columns.values, np.ones(len(residual)), residual])
    whole = _gram(x)
    left = around_mean = 0.0
    for fold in folds:
        sums = whole - sum(_gram(x[omitted]) for _, omitted in fold)
        weights = _solve(sums[:-2, :-2], sums[:-2, -1], columns.penalty)
        mean = sums[-2, -1] / sums[-2, -2]
        for tested, _ in fold:
            predicted = np.einsum("nc,c->n", columns.values[tested], weights)
            left += float(np.sum((residual[tested] - predicted) ** 2))
            around_mean += float(np.sum((residual[tested] - mean) ** 2))
    return 1.0 - left / around_mean if around_mean > 0.0 else 0.0


def _gram(x: Array) -> Array:
    """x' x without BLAS, whose threads are hundreds of times slower for tall matrices when a core is busy."""
    return np.asarray(np.einsum("ni,nj->ij", x, x))


def _solve(gram: Array, moment: Array, penalty: Array) -> Array:
    scale = float(np.trace(gram)) / len(gram)
    ridge = scale * (_BENDS * penalty + _SIZE * np.eye(len(gram))) + 1e-300 * np.eye(len(gram))
    return np.asarray(np.linalg.solve(gram + ridge, moment))


def held_out_folds(rows: int, gap: int) -> list[list[tuple[slice, slice]]]:
    """Per fold its blocks: (rows tested, rows not to fit to: those and `gap` on either side); [] if too short.

    Neighbouring blocks are in different folds, and what two blocks of a fold leave out does not overlap.
    """
    blocks = min(rows // (SHORTEST_BLOCK * max(gap, 1)), MOST_BLOCKS)
    if blocks < FEWEST_BLOCKS:
        return []
    edges = np.linspace(0, rows, blocks + 1).astype(int).tolist()
    cuts = [(slice(start, end), slice(max(start - gap, 0), min(end + gap, rows))) for start, end in pairwise(edges)]
    folds = min(FOLDS, blocks)
    return [cuts[fold::folds] for fold in range(folds)]


def dependence(evaluation: Evaluation, window: int) -> tuple[Dependence, ...]:
    """Every channel, and pairs that explain more than theirs; largest share first, none below 0; () if too short.

    Parameters
    ----------
    window : samples over which the rig's detector averages; the gap to held-out blocks, where the log is long enough;
        else the time that Q and the delay need.
    """
    parts = [part for stretch in evaluation.stretches for part in _chunks(stretch, evaluation)]
    inputs = [inputs_of(s.log, s.model, evaluation.observer, s.first) for s in parts]
    residual = np.concatenate([s.errors for s in parts])
    settled = math.ceil(evaluation.lead / evaluation.sample_time)
    gap = max(window, settled)
    if not held_out_folds(len(residual), gap):
        gap = max(settled, 1)

    def share(*channels: str, hats: int | None = None) -> float | None:
        return explained_share(residual, freeform_columns(inputs, channels, hats), gap)

    names = [name for name in ("velocity", "position", "u", "acceleration", "time") if _all_have(inputs, name)]
    singles = {name: share(name) for name in ("direction", *names)}
    if any(value is None for value in singles.values()):
        return ()
    alone = {name: value or 0.0 for name, value in singles.items()}
    if "position" in alone:
        alone["position"] = max(alone["position"], share("position", hats=FINE_HATS) or 0.0)
    found = [Dependence((name,), max(value, 0.0)) for name, value in alone.items()]
    best = max(alone.values())
    if best < 1.0 - PAIR_GAIN:
        for pair in combinations(names, 2):
            together = share(*pair) or 0.0
            if together >= max(*(alone[name] for name in pair), 0.0) + PAIR_GAIN:
                found.append(Dependence(pair, together))
    return tuple(sorted(found, key=lambda d: -d.explains))


def _all_have(inputs: Sequence[Inputs], name: str) -> bool:
    return all(name in piece.values and np.ptp(piece.values[name]) > 0.0 for piece in inputs)


def _chunks(stretch: Stretch, evaluation: Evaluation) -> list[Stretch]:
    """The stretch; of long logs chunks spread over it, each of which settles anew."""
    total = sum(len(s.log) for s in evaluation.stretches)
    length = max(CHUNK, 4 * stretch.first)
    wanted = max(round(len(stretch.log) * MOST_ROWS / (total * length)), 1)
    if total <= MOST_ROWS or len(stretch.log) <= wanted * length:
        return [stretch]
    starts = np.linspace(0, len(stretch.log) - length, wanted).astype(int)
    return [_cut(stretch, int(a), int(a) + length) for a in starts]


def _cut(stretch: Stretch, a: int, b: int) -> Stretch:
    channels = {name: x[a:b] for name, x in stretch.log.channels.items()}
    arrays = {name: getattr(stretch, name)[a:b] for name in ("predicted", "residual", "net", "drive")}
    return replace(stretch, log=replace(stretch.log, channels=channels), **arrays)
