"""Which channel makes another move: it is what acceleration, friction and place of that motion add up to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dsd_cli.signals.log import Array

#: Blocks of rows that are averaged into one, at most so many of them; two such sizes are tried.
BLOCKS = (4000, 600)
#: Samples by which the cause may come before the motion.
EARLIER = (0, 1, 2, 4, 8, 16)
#: Parts of the log of which every other one is foretold from the rest.
PARTS = 10
#: Rows of a regression for each of its columns, at least.
ROWS_PER_COLUMN = 8
#: A later lag, or another cause, is the better one from this much more of the variance on.
BETTER = 0.005
#: A channel of which one column of the motion alone leaves less than this is that column in another unit.
SAME = 0.015
_CONSTANT = 3  # among the columns of the motion


class Cause(NamedTuple):
    """`share` of the channel's variance that the motion explains in rows held out; `alone`: by one column alone."""

    share: float
    alone: float
    lag: int


def motion_columns(dt: float, x: Array, kind: str, size: int) -> Array:
    """Acceleration, velocity, direction, one (and place and its square, of weights and springs) of the means of blocks.

    Of shape (blocks, k).

    Parameters
    ----------
    x : position or velocity, shape (n,); kind : which. size : samples in a block.
    """
    rows = x.size // size
    mean = x[: rows * size].reshape(rows, size).mean(axis=1)
    step = dt * size
    if kind == "velocity":
        v, a = mean[1:-1], (mean[2:] - mean[:-2]) / (2.0 * step)
        place: list[Array] = []
    else:
        v, a = (mean[2:] - mean[:-2]) / (2.0 * step), (mean[2:] - 2.0 * mean[1:-1] + mean[:-2]) / step**2
        place = [mean[1:-1], (mean[1:-1] - mean.mean()) ** 2]
    rest = 0.02 * float(np.sqrt(np.mean(v**2))) + 1e-300
    return np.column_stack([a, v, v / np.hypot(v, rest), np.ones(v.size), *place])


def cause_of(dt: float, x: Array, kind: str, u: Array) -> Cause:
    """How well `u`, as it was some samples before, is a sum of what the motion `x` has; both finite, shape (n,)."""
    best = Cause(0.0, 0.0, 0)
    for blocks in BLOCKS:
        size = max(x.size // blocks, 1)
        columns = motion_columns(dt, x, kind, size)
        if columns.shape[0] < ROWS_PER_COLUMN * columns.shape[1]:
            continue
        for lag in EARLIER:
            late = np.concatenate([np.full(lag, u[0]), u[: u.size - lag]])
            rows = u.size // size
            y = late[: rows * size].reshape(rows, size).mean(axis=1)[1:-1]
            share = _held_out(columns, y)
            if share > best.share + BETTER:
                alone = max(_held_out(columns[:, [k, _CONSTANT]], y) for k in range(columns.shape[1]) if k != _CONSTANT)
                best = Cause(share, alone, lag)
    return best


def _held_out(columns: Array, y: Array) -> float:
    """Share of the variance of y that the columns explain where they were not fitted, two ways; below 0 is 0."""
    # of what a spoiled file holds (1e307) a power is no number any more
    scale, size = np.abs(columns).max(axis=0), float(np.abs(y).max())
    if not (np.isfinite(scale).all() and 0.0 < size < np.inf):
        return 0.0
    columns, y = columns[:, scale > 0.0] / scale[scale > 0.0], y / size
    part = (np.arange(y.size) * PARTS // max(y.size, 1)) % 2
    left = total = 0.0
    for fitted in (0, 1):
        on = part == fitted
        if np.count_nonzero(on) < 2 * columns.shape[1] or np.count_nonzero(~on) < 2:
            return 0.0
        theta = np.linalg.lstsq(columns[on], y[on], rcond=1e-8)[0]
        left += float(np.sum((y[~on] - columns[~on] @ theta) ** 2))
        total += float(np.sum((y[~on] - y.mean()) ** 2))
    return max(0.0, 1.0 - left / total) if total > 0.0 else 0.0
