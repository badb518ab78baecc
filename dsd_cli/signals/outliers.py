"""How large a channel usually gets, by its own past, and the values that are none of the channel's.

Causal, row by row: the result depends on the rows, never on how they were cut into chunks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.signals.log import Array

#: A level is what so many rows out of so many in a row reach: a machine does that, a corrupt cell does not.
TIMES, WITHIN = 8, 64
#: Rows looked at together: few at first, then what stays in the cache.
BLOCK, LARGEST_BLOCK = 512, 1 << 14
#: The first rows, before they can have shown a level, may be so many times larger.
AT_THE_START = 1e4


class Standout(NamedTuple):
    """A row whose |x| is `size`: far above the level, or one that raises it to `level`."""

    row: int
    size: float
    level: float


class Level:
    """The largest power of two that |x| reached in 8 of 64 successive rows, anywhere so far; 0 before.

    A power of two shows well enough what stands out, and seldom changes: most chunks cost a look at their largest.
    """

    def __init__(self) -> None:
        self.value = 0.0
        self.rows = 0
        self._high = np.empty(0, dtype=np.int64), np.empty(0)  # row and size, of those at least twice the level

    def follow(self, x: Array, times: float) -> list[Standout]:
        """The rows of a chunk of shape (n,) that are at least `times` the level or raise it, in order.

        Rows are numbered from the first of all chunks; those that are not finite are none. `times` is 2 or more.
        """
        start, self.rows = self.rows, self.rows + x.size
        if x.size == 0 or max(-float(x.min()), float(x.max())) < 2.0 * self.value:  # not so where there is a NaN
            return []
        found: list[Standout] = []
        begin, level, block = 0, self.value, BLOCK
        while begin < x.size:  # the level, which at least doubles when it changes, seldom does after the first rows
            stop = min(begin + block, x.size)
            sizes = np.abs(x[begin:stop])
            # 5e-324 is the smallest number above 0, which is no level
            high = np.flatnonzero((sizes >= max(2.0 * level, 5e-324)) & (sizes < math.inf))
            rows, sizes = start + begin + high, sizes[high]
            end, after = self._until_change(rows, sizes, start + stop)
            far = (sizes >= times * level) & (rows < end)
            found += [Standout(*one, level) for one in zip(rows[far].tolist(), sizes[far].tolist(), strict=True)]
            if after > level:
                found.append(Standout(end, float(abs(x[end - start])), after))
                end += 1
            else:
                block = LARGEST_BLOCK
            begin, level = end - start, after
        return found

    def _until_change(self, rows: NDArray[np.int64], sizes: Array, stop: int) -> tuple[int, float]:
        """The first row where the level changes, or `stop`, and the level from there on; of the next high rows."""
        rows, sizes = np.concatenate([self._high[0], rows]), np.concatenate([self._high[1], sizes])
        close = np.flatnonzero(rows[TIMES - 1 :] - rows[: 1 - TIMES] < WITHIN)
        if close.size == 0:
            near = rows > stop - WITHIN
            self._high = rows[near], sizes[near]
            return stop, self.value
        last = int(close[0]) + TIMES
        near = rows[:last] > rows[last - 1] - WITHIN
        rows, sizes = rows[:last][near], sizes[:last][near]
        reached = float(np.sort(sizes)[-TIMES])
        self.value = math.ldexp(1.0, math.frexp(reached)[1] - 1)
        keep = sizes >= 2.0 * self.value
        self._high = rows[keep], sizes[keep]
        return int(rows[-1]), self.value


@dataclass(frozen=True)
class Limits:
    """What is no value of a channel.

    Attributes
    ----------
    ranges : channel -> (smallest, largest) value that there can be.
    factor : a value more than so many times the level of its channel (and than so many) is an outlier.
    """

    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    factor: float = math.inf


class Outliers:
    """Finds the rows beyond the limits, channel by channel."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._levels: dict[str, Level] = {}

    def beyond(self, name: str, column: Array) -> NDArray[np.bool_] | None:
        """Which of the next rows of this channel, shape (n,), are beyond; None: none is."""
        outside = None
        if name in self._limits.ranges:
            low, high = self._limits.ranges[name]
            outside = (column < low) | (column > high)
            column = np.where(outside, np.nan, column)
        factor, level = self._limits.factor, self._levels.setdefault(name, Level())
        start = level.rows
        far = [
            row - start
            for row, size, reached in level.follow(column, factor)
            if size / factor > max(reached, AT_THE_START if row < TIMES else 1.0)
        ]
        if far:
            outside = np.zeros(column.size, dtype=bool) if outside is None else outside
            outside[far] = True
        return outside if outside is not None and outside.any() else None


#: A value stands alone beyond so many times what all but a hundredth reach, if those beside it stay within that.
ALONE, USUAL = 10.0, 99.0


def standing_alone(x: Array) -> NDArray[np.int64]:
    """Samples that stand alone, far beyond the usual values of a channel of shape (n,)."""
    size = np.abs(x)
    usual = float(np.percentile(size, USUAL))
    beside = np.maximum(np.append(size[1:], 0.0), np.insert(size[:-1], 0, 0.0))
    return np.flatnonzero((size > ALONE * usual) & (beside <= usual) & (usual > 0.0))
