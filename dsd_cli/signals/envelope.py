"""A long signal for a narrow picture: of each stretch its lowest and its highest value, so that no peak is lost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def envelope(t: Array, x: Array, points: int) -> tuple[Array, Array]:
    """The samples of `x` that a line of at most `points` points needs to look like all of them.

    `t` and `x` are float64 of one shape (n,), `t` in any unit. Up to `points` samples come back as they are. More are
    cut into stretches of equally many samples, and each gives its lowest and its highest sample, in their order of time
    and at their own times (one sample where both are the same). What is not finite is a gap: it comes back as NaN, at
    most one per stretch, so that a line breaks there; a gap that reaches over the end of a stretch is never lost.

    Raises
    ------
    ValueError : `t` and `x` differ in shape, or `points` is below 3.
    """
    t, x = np.asarray(t, dtype=np.float64), np.asarray(x, dtype=np.float64)
    if t.shape != x.shape or t.ndim != 1:
        raise ValueError(f"t {t.shape} and x {x.shape} must be of one shape (n,)")
    if points < 3:
        raise ValueError(f"points is {points}, and must be 3 or more")
    finite = np.isfinite(x)
    if x.size <= points:
        return t, np.where(finite, x, np.nan)
    keep = _chosen(x, finite, points)
    return t[keep], np.where(finite[keep], x[keep], np.nan)


def _chosen(x: Array, finite: NDArray[np.bool_], points: int) -> NDArray[np.intp]:
    """The places, ascending: of each stretch its lowest, its highest and its first sample that is not finite."""
    each = 2 if finite.all() else 3
    width = -(-x.size // (points // each))
    start = np.arange(0, x.size, width)
    lowest = start + _stretches(np.where(finite, x, np.inf), width, np.inf).argmin(axis=1)
    highest = start + _stretches(np.where(finite, x, -np.inf), width, -np.inf).argmax(axis=1)
    gap = start + _stretches(finite, width, True).argmin(axis=1)  # a stretch without: its start
    keep = np.zeros(x.size, dtype=bool)
    some = finite[lowest]  # not where all of a stretch is a gap
    keep[lowest[some]] = keep[highest[some]] = True
    keep[gap[~finite[gap]]] = True
    return np.flatnonzero(keep)


def _stretches(x: NDArray, width: int, fill: float) -> NDArray:
    """(n,) as (stretches, width), the last one filled up."""
    short = -x.size % width
    return np.concatenate((x, np.full(short, fill, dtype=x.dtype))).reshape(-1, width)
