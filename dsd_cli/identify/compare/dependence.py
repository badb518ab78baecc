"""On what the residual depends: how much of it a free-form function of each channel explains on held-out blocks.

The residual is that of the balance of forces, in the band; functions and blocks are those of `fit.freeform`. A share
above zero is one that held: the function was fitted elsewhere in the log.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dsd_cli.identify.compare.balance import Balance, acceleration
from dsd_cli.identify.fit.bank import drive, inputs_of
from dsd_cli.identify.fit.basis import basis
from dsd_cli.identify.fit.blocks import Blocks, grams, lay_blocks, losses, solve
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.freeform import BENDS, HATS, HATS_IN_PAIR, Piece, piece_of
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: Hats for what repeats along the position.
FINE_HATS = 48
#: The time is cut into held-out blocks itself: its hats must be wider than these.
TIME_HATS = 5
#: A pair is named if it explains so much more than either channel alone.
PAIR_GAIN = 0.05
#: Penalty on the size of the function, as a share of the mean information on a hat.
_SIZE = 1e-6
#: Held-out blocks at most: long ones, for a function of two channels must be met in the others.
MOST_BLOCKS = 20
#: Of fewer rows that count nothing is said.
FEWEST_ROWS = 60


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
class Channels:
    """What free-form functions look at: velocity, position, u (delayed), acceleration, time of every stretch."""

    equations: Equations
    pieces: tuple[Piece, ...]

    @property
    def names(self) -> list[str]:
        """Those that all stretches have, and that vary."""
        found = ("velocity", "position", "u", "acceleration", "time")
        return [n for n in found if all(n in p.values and np.ptp(p.values[n]) > 0.0 for p in self.pieces)]

    def columns(self, channels: Sequence[str], hats: int | None = None) -> tuple[list[Array], Array]:
        """Hats of one channel (of `names`, or "direction" for sgn v alone), or of two together (tensor product), as
        rows, and the penalty on their bends; `hats` : per channel."""
        count = hats or (HATS if len(channels) == 1 else HATS_IN_PAIR)
        counts = [min(count, TIME_HATS) if c == "time" else count for c in channels]
        units, penalty = basis(self.pieces, channels, counts)
        every = ([one.column(i) for one in units] for i in range(units[0].size))
        return [self.equations.acting(x, smooth=False, held=True)[self.equations.kept] for x in every], penalty


def channels_of(equations: Equations, model: PlantModel) -> Channels:
    """Of every stretch, per interval; the acceleration as wide as a period of the band's end."""
    pieces = []
    for stretch, u in zip(equations.stretches, drive(equations, inputs_of(terms_of(model)), model.delay), strict=True):
        piece = piece_of(stretch, u)
        slope = acceleration(stretch.log, 0.5 / equations.band.hz)
        pieces.append(Piece({**piece.values, "acceleration": slope}, piece.sign))
    return Channels(equations, tuple(pieces))


def explained_share(
    residual: Array, columns: Sequence[Array], penalty: Array, blocks: Blocks, least: float = 0.0
) -> float:
    """Share of the residual's variance about its mean that the columns explain on blocks that the fit did not see: at
    most 1, below 0 where the fit only harms.

    least : rms of a residual that matters; of one below it the share is that of `least`.
    """
    before, found = (grams([residual, *rows], blocks) for rows in ([np.ones(len(residual))], columns))
    around_mean = float(losses(solve(before.fitted), before, blocks).sum())
    theta = np.stack([_solved(gram, penalty) for gram in found.fitted])
    left = float(losses(theta, found, blocks).sum())
    whole = max(around_mean, len(residual) * least**2)
    return (around_mean - left) / whole if whole > 0.0 else 0.0


def _solved(gram: Array, penalty: Array) -> Array:
    """Weights of the hats: those over places that the axis hardly met bend with the others."""
    inner = gram[1:, 1:]
    ridge = float(np.trace(inner)) / len(inner) * (BENDS * penalty + _SIZE * np.eye(len(inner)))
    return np.asarray(np.linalg.solve(inner + ridge + 1e-300 * np.eye(len(inner)), gram[1:, 0]))


def dependence(balance: Balance) -> tuple[Dependence, ...]:
    """Every channel, and pairs that explain more than theirs; largest share first, none below 0; () if too short."""
    errors = balance.excerpt
    residual, channels = errors.rows_of_model(balance.model), channels_of(errors.equations, balance.model)
    lengths = [int(kept.sum()) for kept in errors.equations.by_stretch(errors.equations.kept)]
    if len(residual) < FEWEST_ROWS:
        return ()
    blocks = lay_blocks(lengths, POLICY.gap_rows, balance.problem.recordings[0].name, MOST_BLOCKS)

    def share(*on: str, hats: int | None = None) -> float:
        return explained_share(residual, *channels.columns(on, hats), blocks, balance.least)

    alone = {name: share(name) for name in ("direction", *channels.names)}
    if "position" in alone:
        alone["position"] = max(alone["position"], share("position", hats=FINE_HATS))
    found = [Dependence((name,), max(value, 0.0)) for name, value in alone.items()]
    if max(alone.values()) < 1.0 - PAIR_GAIN:
        found += _pairs(alone, channels.names, share)
    return tuple(sorted(found, key=lambda d: -d.explains))


def _pairs(alone: dict[str, float], names: Sequence[str], share: Callable[..., float]) -> list[Dependence]:
    """Pairs that explain more than either channel; not u with the acceleration, of which any r is a function."""
    pairs = [pair for pair in combinations(names, 2) if pair != ("u", "acceleration")]
    found = [Dependence(pair, share(*pair)) for pair in pairs]
    return [d for d in found if d.explains >= max(*(alone[name] for name in d.channels), 0.0) + PAIR_GAIN]
