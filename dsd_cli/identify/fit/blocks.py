"""Blocks of rows that are held out in turn, with a gap beside them, and inner products of rows per segment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsd_cli.errors import TooShort
from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array
from dsd_cli.signals.passes import products
from dsd_cli.signals.signed import normal_equations


@dataclass(frozen=True)
class Blocks:
    """Segments of consecutive rows, three to a block: head, core, tail (head and tail are `gap` rows long; in a block
    shorter than two gaps the core is what is within the gap of either neighbour).

    starts : first row of each segment, shape (3 B,); a segment ends where the next begins.
    fold : of each block, shape (B,).
    before, after : whether the block before (after) is its neighbour in the same stretch, shape (B,).
    short : whether it is shorter than two gaps, shape (B,).
    """

    starts: NDArray[np.int_]
    rows: int
    fold: NDArray[np.int_]
    before: NDArray[np.bool_]
    after: NDArray[np.bool_]
    short: NDArray[np.bool_]

    @property
    def count(self) -> int:
        """B."""
        return len(self.fold)

    @property
    def folds(self) -> int:
        """Number of folds."""
        return int(self.fold.max()) + 1

    def block_of_rows(self) -> NDArray[np.int_]:
        """Block of each row, shape (rows,)."""
        return np.repeat(np.arange(self.count), self.block_rows)

    @cached_property
    def block_rows(self) -> NDArray[np.int_]:
        """Rows of each block, shape (B,)."""
        return np.asarray(np.diff(np.append(self.starts[::3], self.rows)))

    @cached_property
    def fitted_rows(self) -> list[int]:
        """Rows that each fold's fit sees."""
        lengths = np.diff(np.append(self.starts, self.rows))
        return [int(rows) for rows in self.weights @ lengths]

    @cached_property
    def weights(self) -> NDArray[np.float64]:
        """`fitted` of every fold, shape (K, 3 B)."""
        return np.stack([self.fitted(fold) for fold in range(self.folds)])

    def fitted(self, fold: int) -> NDArray[np.float64]:
        """Weight of each segment in the fit that holds `fold` out: 1 or 0, shape (3 B,)."""
        held = self.fold == fold
        weight = np.repeat(np.where(held, 0.0, 1.0), 3).reshape(-1, 3)
        next_held = np.append(held[1:], False) & self.after
        last_held = np.insert(held[:-1], 0, False) & self.before
        weight[next_held, 2] = 0.0
        weight[last_held, 0] = 0.0
        weight[(next_held | last_held) & self.short, 1] = 0.0
        return weight.reshape(-1)


def lay_blocks(lengths: Sequence[int], gap: int, name: str, most: int = POLICY.most_blocks) -> Blocks:
    """`most` blocks over stretches of that many rows each; `gap` : rows between what is fitted and what is judged.

    Raises TooShort where they are too short for two folds.
    """
    total = sum(lengths)
    usual = POLICY.block_gaps * gap
    if total < 2 * max(usual, 1):
        raise TooShort(
            f"{name}: too short: the log has {total} independent samples in the band,"
            f" cross-validation needs {2 * max(usual, 1)}",
            "a longer log, or a finer sensor",
        )
    # as many as folds at least: of two halves one speeds up and the other slows down
    long = max(min(usual, total // POLICY.folds), total // most, 1)
    starts: list[int] = []
    before: list[bool] = []
    after: list[bool] = []
    short: list[bool] = []
    row = 0
    for length in lengths:
        count = max(1, length // long)
        edges = [row + round(length * i / count) for i in range(count + 1)]
        for i in range(count):
            room = edges[i + 1] - edges[i]
            first, last = sorted((min(gap, room), max(room - gap, 0)))
            starts += [edges[i], edges[i] + first, edges[i] + last]
            short.append(room < 2 * gap)
            before.append(i > 0)
            after.append(i + 1 < count)
        row += length
    blocks = len(before)
    if blocks < 2:
        raise TooShort(f"{name}: too short: one held-out block only", "a longer log, or a finer sensor")
    fold = np.arange(blocks) % min(POLICY.folds, blocks)
    return Blocks(np.array(starts), row, fold, np.array(before), np.array(after), np.array(short))


def spread_over_blocks(gains: Array) -> bool:
    """Whether the gain is spread over the blocks: not one block alone, and few blocks lose. Gains may be unequal: a
    cubic spring shows where the axis goes far."""
    lost = -float(gains[gains < 0.0].sum())
    won = float(gains[gains > 0.0].sum())
    return won - float(gains.max()) - lost > POLICY.least_gain and lost < POLICY.most_lost * won


class Grams(NamedTuple):
    """Inner products of y (first) and p columns.

    total : over all rows, shape (p+1, p+1). fitted : per fold, over the rows of the fit that holds it out, shape
    (K, p+1, p+1). held_out : per block, shape (B, p+1, p+1).
    """

    total: Array
    fitted: Array
    held_out: Array

    def of(self, rows: Sequence[int]) -> Grams:
        """Of some rows, y first."""
        return Grams(*(gram[..., rows, :][..., rows] for gram in self))


#: Rows that are condensed at once, so that they stay at hand.
_CONDENSED = 2048


def total_gram(rows: Sequence[Array]) -> Array:
    """Over all rows, shape (p+1, p+1)."""
    return products(rows, (0,))[0]


def condensed(rows: Sequence[Array]) -> Array:
    """Much shorter rows, shape (p, n), with the same inner products as these p, piece by piece, each of p at most."""
    pieces = ([x[i : i + _CONDENSED] for x in rows] for i in range(0, len(rows[0]) or 1, _CONDENSED))
    return np.concatenate([np.asarray(np.linalg.qr(np.transpose(x), mode="r")).T for x in pieces], axis=1)


def without_noise(gram: Array, noise: Array, rows: ArrayLike) -> Array:
    """Gram matrices, shape (..., p+1, p+1), less what noise in the columns adds to them.

    noise : covariance of the noise in a row of the columns, shape (p, p). rows : how many rows each matrix sums over,
        shape (...). No more is taken than half of what a column has.
    """
    sizes, rows = noise.diagonal(), np.asarray(rows)
    noisy = np.flatnonzero(sizes > 0.0)
    if not noisy.size:
        return gram
    own = gram[..., 1 + noisy, 1 + noisy]
    times = rows * np.minimum(1.0, np.min(0.5 * own / np.maximum(sizes[noisy] * rows[..., None], 1e-300), axis=-1))
    gram = gram.copy()
    gram[..., 1:, 1:] -= times[..., None, None] * noise
    return gram


def grams(rows: Sequence[Array], blocks: Blocks) -> Grams:
    """All sums that a cross-validated fit needs; `rows` are the drive and the columns, shape (N,) each."""
    segments = products(rows, blocks.starts)
    held_out = segments.reshape(-1, 3, *segments.shape[1:]).sum(axis=1)
    return Grams(segments.sum(axis=0), np.tensordot(blocks.weights, segments, axes=1), held_out)


def solve(matrices: Array, ridge: float | Array = 1e-9) -> Array:
    """Least-squares coefficients, shape (M, p), of `normal_equations`."""
    normal, right, scale = normal_equations(matrices, ridge)
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0] / scale)


def losses(theta: Array, found: Grams, blocks: Blocks) -> Array:
    """Squared residuals of each block by the fit that did not see it, shape (B,); `theta` : by fold, shape (K, p)."""
    residual = np.concatenate([np.ones((len(theta), 1)), -theta], axis=1)[blocks.fold]
    return np.asarray(np.einsum("bi,bij,bj->b", residual, found.held_out, residual))


def squares(matrix: Array, theta: Array) -> float:
    """Sum of squared residuals of coefficients under one Gram matrix."""
    weights = np.concatenate([[1.0], -theta])
    return float(max(weights @ matrix @ weights, 0.0))
