"""On what the residual depends: how much of it a free-form function of each channel explains on held-out blocks.

The residual is that of the balance of forces, in the band. The functions are sums of hats over quantiles of the
channel, with a jump at zero speed; each hat is a force that passes the low-pass of the band like every force does. A
share above zero is one that held: the function was fitted elsewhere in the log.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from dsd_cli.identify.compare.balance import Balance, acceleration, all_rows
from dsd_cli.identify.fit.bank import drive, inputs_of
from dsd_cli.identify.fit.basis import basis
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.freeform import Piece, piece_of
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: Hats of one channel alone, of each channel in a pair, and fine ones for what repeats along the position.
HATS, HATS_IN_PAIR, FINE_HATS = 12, 6, 48
#: The time is cut into held-out blocks itself: its hats must be wider than these.
TIME_HATS = 5
#: A pair is named if it explains so much more than either channel alone.
PAIR_GAIN = 0.05
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


class Columns(NamedTuple):
    """Regressors as rows of the balance (those that count), shape (n, c), and the penalty on their weights, (c, c)."""

    values: Array
    penalty: Array


@dataclass(frozen=True)
class Channels:
    """What free-form functions look at: velocity, position, u (delayed), acceleration, time of every stretch."""

    equations: Equations
    pieces: tuple[Piece, ...]

    @property
    def names(self) -> list[str]:
        """Those that all stretches have, and that vary."""
        found = ("velocity", "position", "u", "acceleration", "time")
        return [n for n in found if all(n in p.values and np.ptp(p.values[n]) > 0.0 for p in self.pieces)]

    def columns(self, channels: Sequence[str], hats: int | None = None) -> Columns:
        """Columns of a free-form function of one channel, or of two together (tensor product), over all stretches.

        channels : some of `names`, or "direction" for sgn v alone.
        hats : per channel; by default `HATS` for one and `HATS_IN_PAIR` for each of two.
        """
        count = hats or (HATS if len(channels) == 1 else HATS_IN_PAIR)
        units, penalty = basis(
            self.pieces, channels, [min(count, TIME_HATS) if c == "time" else count for c in channels]
        )
        rows = [
            self.equations.acting([one.column(i) for one in units], smooth=False, held=True)
            for i in range(units[0].size)
        ]
        return Columns(np.stack(rows, axis=1)[self.equations.kept], penalty)


def channels_of(equations: Equations, model: PlantModel) -> Channels:
    """Of every stretch, per interval; the acceleration as wide as a period of the band's end."""
    pieces = []
    for stretch, u in zip(equations.stretches, drive(equations, inputs_of(terms_of(model)), model.delay), strict=True):
        piece = piece_of(stretch, u)
        slope = acceleration(stretch.log, 0.5 / equations.band.hz)
        pieces.append(Piece({**piece.values, "acceleration": slope}, piece.sign))
    return Channels(equations, tuple(pieces))


def explained_share(residual: Array, columns: Columns, gap: int, least: float = 0.0) -> float | None:
    """Share of the residual's variance about its mean that the columns explain on blocks that the fit did not see.

    Parameters
    ----------
    residual : shape (n,), the rows of `columns`.
    gap : rows left out between what is fitted and what is held out.
    least : rms of a residual that matters; of one below it the share is that of `least`.

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
    whole_of_it = max(around_mean, len(residual) * least**2)
    return (around_mean - left) / whole_of_it if whole_of_it > 0.0 else 0.0


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


def dependence(balance: Balance) -> tuple[Dependence, ...]:
    """Every channel, and pairs that explain more than theirs; largest share first, none below 0; () if too short."""
    equations = balance.excerpt.equations
    residual = all_rows(balance.excerpt, balance.model)[equations.kept]
    channels = channels_of(equations, balance.model)

    def share(*on: str, hats: int | None = None) -> float | None:
        return explained_share(residual, channels.columns(on, hats), POLICY.gap_rows, balance.least)

    singles = {name: share(name) for name in ("direction", *channels.names)}
    if any(value is None for value in singles.values()):
        return ()
    alone = {name: value or 0.0 for name, value in singles.items()}
    if "position" in alone:
        alone["position"] = max(alone["position"], share("position", hats=FINE_HATS) or 0.0)
    found = [Dependence((name,), max(value, 0.0)) for name, value in alone.items()]
    if max(alone.values()) < 1.0 - PAIR_GAIN:
        found += _pairs(alone, channels.names, share)
    return tuple(sorted(found, key=lambda d: -d.explains))


def _pairs(alone: dict[str, float], names: Sequence[str], share: Callable[..., float | None]) -> list[Dependence]:
    """Pairs that explain more than either channel; not u with the acceleration, of which any r is a function."""
    found = []
    for pair in combinations(names, 2):
        if pair == ("u", "acceleration"):
            continue
        together = share(*pair) or 0.0
        if together >= max(*(alone[name] for name in pair), 0.0) + PAIR_GAIN:
            found.append(Dependence(pair, together))
    return found
