"""Free-form functions of channels: sums of hats over quantiles, with a jump at zero speed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple, Protocol

import numpy as np

from dsd_cli.signals.log import Array


class Regressors(Protocol):
    """What free-form functions look at: channels and the mean of sgn v (NaN at rest) per interval, shape (n,)."""

    @property
    def values(self) -> Mapping[str, Array]: ...

    @property
    def sign(self) -> Array: ...


#: Share of a channel's range by which knots are apart at least.
APART = 1e-6


class Units(NamedTuple):
    """So many unit functions of channels of one piece, each of shape (n,) and made when asked for: all of them at once
    are a hundred times the channels of a long log."""

    size: int
    column: Callable[[int], Array]

    def times(self, x: Array) -> Units:
        """Each times x, shape (n,)."""
        return Units(self.size, lambda i: x * self.column(i))

    def beside(self, other: Units) -> Units:
        """These, then those."""
        return Units(self.size + other.size, lambda i: self.column(i) if i < self.size else other.column(i - self.size))

    def by(self, other: Units) -> Units:
        """All products, those of the first function first."""
        own, count = lru_cache(maxsize=1)(self.column), other.size
        return Units(self.size * count, lambda i: own(i // count) * other.column(i % count))


def basis(
    inputs: Sequence[Regressors], channels: Sequence[str], counts: Sequence[int], apart: float = APART
) -> tuple[list[Units], Array]:
    """Unit functions of the channels (tensor product of two) of every piece, and the penalty on their bends."""
    bases = [_basis(inputs, channel, count, apart) for channel, count in zip(channels, counts, strict=True)]
    raw, penalty = bases[0]
    for values, other in bases[1:]:
        penalty = np.kron(penalty, np.eye(len(other))) + np.kron(np.eye(len(penalty)), other)
        raw = [a.by(b) for a, b in zip(raw, values, strict=True)]
    return raw, penalty


def _basis(inputs: Sequence[Regressors], channel: str, count: int, apart: float) -> tuple[list[Units], Array]:
    """(unit functions of the channel per piece, which sum to 1; penalty on their bends)."""
    if channel not in ("velocity", "direction"):
        knots = _knots(np.concatenate([piece.values[channel] for piece in inputs]), count, apart)
        return [_hats(piece.values[channel], knots) for piece in inputs], _bends(len(knots))
    half = max(count // 2, 2)
    speeds = np.concatenate([piece.values["velocity"] for piece in inputs])
    sides = []
    for side in (1.0, -1.0):
        own = side * speeds[side * speeds > 0.0]
        sides.append((side, _knots(own, half, apart) if channel == "velocity" and own.size else np.zeros(1)))
    sizes = [len(knots) for _, knots in sides]
    penalty = np.zeros((sum(sizes) + 1,) * 2)
    penalty[: sizes[0], : sizes[0]] = _bends(sizes[0])
    penalty[sizes[0] : -1, sizes[0] : -1] = _bends(sizes[1])
    return [_of_direction(piece, sides) for piece in inputs], penalty


def _of_direction(piece: Regressors, sides: Sequence[tuple[float, Array]]) -> Units:
    """Hats over the speed for each direction (1 or -1, knots), and 1 at rest."""
    rest = np.isnan(piece.sign)
    moving = np.nan_to_num(piece.sign, nan=0.0)
    (forth, back) = (
        _hats(side * piece.values["velocity"], knots).times(np.where(rest, 0.0, 0.5 * (1.0 + side * moving)))
        for side, knots in sides
    )
    return forth.beside(back).beside(Units(1, lambda _: rest.astype(np.float64)))


def _knots(x: Array, count: int, apart: float) -> Array:
    """Quantiles of the channel, without those that are nearer than that share of its range to the one before."""
    least, kept = apart * max(float(np.ptp(x)), 1e-300), list[float]()
    for knot in np.quantile(x, np.linspace(0.0, 1.0, count)).tolist():
        if not kept or knot - kept[-1] > least:
            kept.append(knot)
    return np.array(kept)


def _hats(x: Array, knots: Array) -> Units:
    """Linear B-splines over the knots; constant beyond the ends, so they sum to 1."""
    if len(knots) == 1:
        return Units(1, lambda _: np.ones(len(x)))
    left = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((x - knots[left]) / (knots[left + 1] - knots[left]), 0.0, 1.0)
    left, rest = left.astype(np.int16), 1.0 - share

    def column(i: int) -> Array:
        return np.where(left == i, rest, np.where(left == i - 1, share, 0.0))

    return Units(len(knots), column)


def _bends(count: int) -> Array:
    """Sum of squared second differences of the weights, as a matrix."""
    second = np.diff(np.eye(count), 2, axis=0) if count > 2 else np.zeros((0, count))
    return np.asarray(second.T @ second)
