"""Blocks of rows that are held out in turn, with a gap between what is fitted and what is judged.

A log is cut into contiguous blocks; block b belongs to fold b mod K, so that every fold sees every part of the
experiment. What is held out is a whole block; what is fitted leaves out the `gap` rows beside a held-out block, because
filters, delays and windows tie neighbouring rows together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsd_cli.errors import TooShort
from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class Blocks:
    """Segments of consecutive rows, three to a block: head, core, tail (head and tail are `gap` rows long; in a block
    shorter than two gaps the core is what is within the gap of either neighbour).

    Attributes
    ----------
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

    @cached_property
    def segments(self) -> tuple[slice, ...]:
        """Rows of each segment."""
        return tuple(slice(a, b) for a, b in pairwise([*self.starts.tolist(), self.rows]))

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


def lay_blocks(lengths: Sequence[int], gap: int, name: str, shortest: int = 0) -> Blocks:
    """Blocks over stretches of that many rows each.

    Parameters
    ----------
    gap : rows between what is fitted and what is judged.

    Raises
    ------
    TooShort : too short for two folds.
    """
    total = sum(lengths)
    usual = POLICY.block_gaps * gap
    if total < 2 * max(usual, shortest, 1):
        raise TooShort(
            f"{name}: too short: {total} independent equations, held-out blocks need {2 * max(usual, shortest, 1)}",
            "a longer log, or a finer sensor",
        )
    # as many as folds at least: of two halves one speeds up and the other slows down
    long = max(min(usual, total // POLICY.folds), total // POLICY.most_blocks, shortest, 1)
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
