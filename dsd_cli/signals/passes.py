"""Passes over samples of which an identification makes thousands: compiled where the build had a compiler, else NumPy.

The sums of `_passes.c` differ from those that stand here by rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsd_cli.signals.compiled import compiled_module
from dsd_cli.signals.decimating import decimated, in_groups
from dsd_cli.signals.log import Array

#: First samples of segments; each ends where the next begins.
Starts = Sequence[int] | NDArray[np.int_]
#: Values that NumPy makes at once, as a product with a matrix of the taps: less than half of what `np.convolve` takes.
_PIECE = 32

#: The compiled module, or None where the build had no compiler.
COMPILED = compiled_module("dsd_cli.signals._passes")


def passed(x: Array, taps: Array, before: int, compiled: Any = COMPILED) -> Array:
    """y_i = sum_k taps_k x_(i + k - before), shape (n,) as x; beyond its ends x stays as it is there."""
    if not len(x):
        return np.zeros(0)
    if compiled is not None:
        out = np.empty(len(x))
        compiled.passed(_row(x), _row(taps), before, 1, out)
        return out
    behind = len(taps) - 1 - before
    if len(taps) > _PIECE or max(before, behind) > _PIECE:
        return np.convolve(np.pad(x, (before, behind), mode="edge"), taps[::-1], mode="valid")
    longer = np.empty((-(-len(x) // _PIECE) + 1, _PIECE))
    flat, end = longer.reshape(-1), before + len(x)
    flat[:before], flat[before:end], flat[end:] = x[0], x, x[-1]
    shifted = np.zeros((_PIECE, 2 * _PIECE))  # each piece and what it needs of the next, times the taps as a matrix
    for i in range(_PIECE):
        shifted[i, i : i + len(taps)] = taps
    reach = len(taps) - 1
    found = longer[:-1] @ shifted[:, :_PIECE].T
    found += longer[1:, :reach] @ shifted[:, _PIECE : _PIECE + reach].T
    return np.asarray(found.reshape(-1)[: len(x)])


def every(x: Array, taps: Array, step: int, count: int, compiled: Any = COMPILED) -> Array:
    """`count` values, shape (count,): the taps times x, finite, from each `step` samples on; none reach beyond x."""
    if compiled is None or not count:
        return decimated(x, _groups(taps.tobytes(), step), count)
    out = np.empty(count)
    compiled.passed(_row(x), _row(taps), 0, step, out)
    return out


@lru_cache(maxsize=16)
def _groups(taps: bytes, step: int) -> Array:
    return in_groups(np.frombuffer(taps), step)


def products(columns: Sequence[Array], starts: Starts, compiled: Any = COMPILED) -> Array:
    """Inner products of p columns, shape (N,) each, of segments that begin at `starts` and end where the next begins,
    the last at N: shape (segments, p, p)."""
    edges = _edges(columns, starts)
    found = np.zeros((len(edges) - 1, len(columns), len(columns)))
    if compiled is not None:
        compiled.products(tuple(map(_row, columns)), edges, found)
        return found
    x = np.stack(columns)
    for a, b, own in zip(edges, edges[1:], found, strict=False):
        np.matmul(x[:, a:b], x[:, a:b].T, out=own)
    return found


def mixed(columns: Sequence[Array], weights: Array, starts: Starts = (0,), compiled: Any = COMPILED) -> Array:
    """Sum of p columns, shape (N,) each, times weights, shape (N,); weights: shape (p,), or (segments, p) where each
    segment that begins at `starts` has its own."""
    edges, found, each = _edges(columns, starts), np.zeros(len(columns[0])), _row(np.atleast_2d(weights))
    if compiled is not None:
        compiled.mixed(tuple(map(_row, columns)), edges, each, found)
        return found
    for a, b, own in zip(edges, edges[1:], each, strict=False):
        found[a:b] = own @ np.stack([x[a:b] for x in columns])
    return found


def _edges(columns: Sequence[Array], starts: Starts) -> NDArray[np.int64]:
    return np.array([*starts, len(columns[0])], dtype=np.int64)


def sine_and_cosine_of(angle: Any, compiled: Any = COMPILED) -> tuple[Any, Any]:
    """(sine, cosine) of an angle, or of each of an array of shape (n,), in radians."""
    if compiled is None or not isinstance(angle, np.ndarray) or angle.dtype != np.float64:
        return np.sin(angle), np.cos(angle)
    sine, cosine = np.empty(angle.shape), np.empty(angle.shape)
    compiled.sine_cosine(_row(angle), sine, cosine)
    return sine, cosine


def _row(x: Array) -> Array:
    return np.ascontiguousarray(x, dtype=np.float64)
