"""Pieces of a log, and how they are made of rows that have holes and duplicates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.signals.log import Array


class Piece(NamedTuple):
    """Consecutive input rows, and the samples made of them.

    Attributes
    ----------
    start, rows : the input rows covered, [start, start + rows); pieces cover every row once, in order.
    keep : None: sample i is row start + i. Else shape (samples,): the row (counted from `start`) a sample was measured
        in, -1 for a sample that bridges a hole; rows that are not named were dropped.
    t : s, shape (samples,).
    row_t : s, shape (rows,); as found in the log, so possibly not finite in a dropped row.
    values : name -> contiguous float64, shape (samples,), finite.
    restart : the samples do not continue those before: reset what remembers.
    stamps : None in a regular log; else `t`, to be used as it is.
    """

    start: int
    rows: int
    keep: NDArray[np.int64] | None
    t: Array
    row_t: Array
    values: dict[str, Array]
    restart: bool
    stamps: Array | None


def too_close(stamps: Array, last: float | None, limit: float) -> NDArray[np.bool_]:
    """Stamps at most `limit` after the last one that is kept (`last`: the one before these)."""
    drop = np.zeros(stamps.size, dtype=bool)
    chain = stamps if last is None else np.concatenate(([last], stamps))
    shift = chain.size - stamps.size
    with np.errstate(over="ignore"):
        steps = np.diff(chain)
    walked = 0
    for at in (np.flatnonzero((steps >= 0) & (steps <= limit)) + 1).tolist():
        if at < walked:
            continue
        anchor = chain[at - 1]
        while at < chain.size and 0 <= chain[at] - anchor <= limit:
            drop[at - shift] = True
            at += 1
        walked = at + 1  # row `at` is kept, and steps after it are counted from it
    return drop


def rows_of(values: dict[str, Array], rows: NDArray[np.int64]) -> dict[str, Array]:
    return {name: column[rows] for name, column in values.items()}


def bridge(
    t: Array,
    values: dict[str, Array],
    rows: NDArray[np.int64],
    inserted: NDArray[np.int64],
    previous: tuple[float, dict[str, float]] | None,
) -> tuple[NDArray[np.int64], Array, dict[str, Array]]:
    """The rows as samples, with `inserted[i]` samples on a straight line before row i.

    Returns the row of each sample (-1: inserted), their times and their values.
    """
    if not inserted.any():
        return rows, t[rows], rows_of(values, rows)
    place = np.arange(rows.size) + np.cumsum(inserted)
    total = int(place[-1]) + 1
    keep = np.full(total, -1, dtype=np.int64)
    keep[place] = rows
    after = np.repeat(np.arange(rows.size), inserted)
    holes = np.flatnonzero(keep < 0)
    weight = (holes - (place[after] - inserted[after]) + 1) / (inserted[after] + 1)

    def line(column: Array, before: float) -> Array:
        samples = np.empty(total)
        ends = column[rows]
        samples[place] = ends
        starts = np.concatenate(([before], ends[:-1]))
        samples[holes] = (1 - weight) * starts[after] + weight * ends[after]
        return samples

    # without a previous sample nothing is inserted before the first row, so what stands in for it is not used
    time, last = previous if previous is not None else (0.0, dict.fromkeys(values, 0.0))
    return keep, line(t, time), {name: line(column, last[name]) for name, column in values.items()}
