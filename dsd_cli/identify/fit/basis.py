"""Free-form functions of channels: sums of hats over quantiles, with a jump at zero speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

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


def basis(
    inputs: Sequence[Regressors], channels: Sequence[str], counts: Sequence[int], apart: float = APART
) -> tuple[list[Array], Array]:
    """Unit functions of the channels (tensor product of two), per piece (n_i, c), and the penalty on their bends."""
    bases = [_basis(inputs, channel, count, apart) for channel, count in zip(channels, counts, strict=True)]
    raw, penalty = bases[0]
    for values, other in bases[1:]:
        penalty = np.kron(penalty, np.eye(len(other))) + np.kron(np.eye(len(penalty)), other)
        raw = [np.einsum("ni,nj->nij", a, b).reshape(len(a), -1) for a, b in zip(raw, values, strict=True)]
    return raw, penalty


def _basis(inputs: Sequence[Regressors], channel: str, count: int, apart: float) -> tuple[list[Array], Array]:
    """(unit functions of the channel per piece, shape (n_i, c) summing to 1; penalty on their bends)."""
    if channel not in ("velocity", "direction"):
        knots = _knots(np.concatenate([piece.values[channel] for piece in inputs]), count, apart)
        return [_hats(piece.values[channel], knots) for piece in inputs], _bends(len(knots))
    half = max(count // 2, 2)
    speeds = np.concatenate([piece.values["velocity"] for piece in inputs])
    sides = []
    for side in (1.0, -1.0):
        own = side * speeds[side * speeds > 0.0]
        sides.append((side, _knots(own, half, apart) if channel == "velocity" and own.size else np.zeros(1)))
    values = []
    for piece in inputs:
        moving = np.nan_to_num(piece.sign, nan=0.0)
        rest = np.isnan(piece.sign)
        parts = [
            np.where(rest, 0.0, 0.5 * (1.0 + side * moving))[:, None] * _hats(side * piece.values["velocity"], knots)
            for side, knots in sides
        ]
        values.append(np.column_stack([*parts, rest.astype(np.float64)]))
    sizes = [len(knots) for _, knots in sides]
    penalty = np.zeros((sum(sizes) + 1,) * 2)
    penalty[: sizes[0], : sizes[0]] = _bends(sizes[0])
    penalty[sizes[0] : -1, sizes[0] : -1] = _bends(sizes[1])
    return values, penalty


def _knots(x: Array, count: int, apart: float) -> Array:
    """Quantiles of the channel, without those that are nearer than that share of its range to the one before."""
    least, kept = apart * max(float(np.ptp(x)), 1e-300), list[float]()
    for knot in np.quantile(x, np.linspace(0.0, 1.0, count)).tolist():
        if not kept or knot - kept[-1] > least:
            kept.append(knot)
    return np.array(kept)


def _hats(x: Array, knots: Array) -> Array:
    """Linear B-splines over the knots, shape (n, len(knots)); constant beyond the ends, so they sum to 1."""
    if len(knots) == 1:
        return np.ones((len(x), 1))
    left = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((x - knots[left]) / (knots[left + 1] - knots[left]), 0.0, 1.0)
    out = np.zeros((len(x), len(knots)))
    rows = np.arange(len(x))
    out[rows, left] = 1.0 - share
    out[rows, left + 1] = share
    return out


def _bends(count: int) -> Array:
    """Sum of squared second differences of the weights, as a matrix."""
    second = np.diff(np.eye(count), 2, axis=0) if count > 2 else np.zeros((0, count))
    return np.asarray(second.T @ second)
