"""Inner products of rows per segment: a fit over some segments needs only the sum of their Gram matrices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dsd_cli.identify.fit.blocks import Blocks
from dsd_cli.signals.log import Array


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


def total_gram(rows: Sequence[Array]) -> Array:
    """Over all rows, shape (p+1, p+1)."""
    x = np.stack(rows)
    return np.asarray(x @ x.T)


def without_noise(gram: Array, noise: Array, rows: ArrayLike) -> Array:
    """Gram matrices, shape (..., p+1, p+1), less what noise in the columns adds to them.

    Parameters
    ----------
    noise : covariance of the noise in a row of the columns, shape (p, p). rows : how many rows each matrix sums over,
        shape (...). No more is taken than half of what a column has.
    """
    noisy = np.flatnonzero(np.diag(noise) > 0.0)
    if not noisy.size:
        return gram
    own = gram[..., 1 + noisy, 1 + noisy]
    expected = np.diag(noise)[noisy] * np.asarray(rows)[..., None]
    times = np.asarray(rows) * np.minimum(1.0, np.min(0.5 * own / np.maximum(expected, 1e-300), axis=-1))
    gram = gram.copy()
    gram[..., 1:, 1:] -= times[..., None, None] * noise
    return gram


def grams(rows: Sequence[Array], blocks: Blocks) -> Grams:
    """All sums that a cross-validated fit needs; `rows` are the drive and the columns, shape (N,) each."""
    x = np.stack(rows)
    segments = np.empty((len(blocks.segments), len(x), len(x)))
    for rows_of, gram in zip(blocks.segments, segments, strict=True):
        part = x[:, rows_of]
        np.matmul(part, part.T, out=gram)
    held_out = segments.reshape(-1, 3, *segments.shape[1:]).sum(axis=1)
    return Grams(segments.sum(axis=0), np.tensordot(blocks.weights, segments, axes=1), held_out)


def solve(matrices: Array, ridge: float | Array = 1e-9) -> Array:
    """Least-squares coefficients for a stack of Gram matrices of (y, columns), shape (M, p).

    `ridge` is added to the columns scaled to unit length (by their mean over the stack, so that a column that one
    fold never saw is ruled by it); a number or a matrix of shape (p, p).
    """
    a, b = matrices[:, 1:, 1:], matrices[:, 1:, 0]
    size = a.shape[1]
    if size == 0:
        return np.zeros((len(matrices), 0))
    size_of = np.abs(a.diagonal(axis1=1, axis2=2).sum(axis=0))  # below 0 where the noise that was taken off was all
    scale = np.sqrt(np.maximum(size_of / len(a), 1e-300))
    normal = a / (scale[:, None] * scale)
    if isinstance(ridge, float):
        index = np.arange(size)
        normal[:, index, index] += ridge
    else:
        normal += ridge
    return np.linalg.solve(normal, (b / scale)[..., None])[..., 0] / scale


def losses(theta: Array, found: Grams, blocks: Blocks) -> Array:
    """Squared residuals of each block by the fit that did not see it, shape (B,); `theta` : by fold, shape (K, p)."""
    residual = np.concatenate([np.ones((len(theta), 1)), -theta], axis=1)[blocks.fold]
    return np.asarray(np.einsum("bi,bij,bj->b", residual, found.held_out, residual))


def squares(matrix: Array, theta: Array) -> float:
    """Sum of squared residuals of coefficients under one Gram matrix."""
    weights = np.concatenate([[1.0], -theta])
    return float(max(weights @ matrix @ weights, 0.0))
