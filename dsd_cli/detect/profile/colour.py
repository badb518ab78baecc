"""Noise that lasts: by how much a window's residual varies more on longer time scales than white noise does.

Of white noise a sum over m samples has the variance m sigma^2. What a model lacks lasts for many samples: then the sum
varies more, and so does an estimate, which sums with slow weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.profile.likelihood import Peak
from dsd_cli.detect.trust import BLOCKS
from dsd_cli.signals.log import Array

#: Blocks whose sums are looked at together.
SCALES = (1, 2, 4)
#: Standard deviations of a mean square (of n sums: sqrt(2 / n)) that chance may add, in units of sqrt(1 / n).
CHANCE = 3.0


class BlockSums:
    """Sums of y and z over blocks, a sixteenth of the window each, carried from pass to pass.

    Parameters
    ----------
    window : samples; of fewer than `BLOCKS` every sample is a block.
    shape : of z of one sample: delays and combinations of effect values.
    """

    def __init__(self, window: int, shape: tuple[int, int]) -> None:
        self._size, self._count, self._shape = max(window // BLOCKS, 1), min(window, BLOCKS), shape
        width = 1 + shape[0] * shape[1]
        self._left = np.zeros((0, width))  # rows of a block that is not whole yet
        self._blocks = np.zeros((self._count, width))
        self._ends: NDArray[np.intp] = np.zeros(0, dtype=np.intp)

    def feed(self, y: Array, z: Array, missing: NDArray[np.bool_]) -> None:
        """The next samples: y of shape (n,), z of shape (n, delays, combinations); a missing one adds nothing."""
        rows = np.column_stack([y, z.reshape(len(y), -1)])
        rows[missing] = 0.0
        left = len(self._left)
        rows = np.concatenate([self._left, rows])
        whole = len(rows) // self._size
        self._left = rows[whole * self._size :].copy()
        sums = np.add.reduce(rows[: whole * self._size].reshape(whole, self._size, rows.shape[1]), axis=1)
        self._blocks = np.concatenate([self._blocks[-self._count :], sums])
        self._ends = self._count + (left + 1 + np.arange(len(y))) // self._size  # block after the last whole one

    def excess(self, peak: Peak, combination: NDArray[np.intp], variance: Array) -> Array:
        """Of the fits at the samples that were fed last: 1, or by how much sums vary more than `variance` has it."""
        at = self._ends[:, None] - self._count + np.arange(self._count)
        y, z = self._blocks[:, 0], self._blocks[:, 1:].reshape(-1, *self._shape)
        first = np.minimum(peak.lag.astype(np.intp), max(self._shape[0] - 2, 0))
        share, other = (peak.lag - first)[:, None], np.minimum(first + 1, self._shape[0] - 1)
        group = combination[:, None]
        between = (1.0 - share) * z[at, first[:, None], group] + share * z[at, other[:, None], group]
        residual = y[at] - peak.alpha[:, None] * between
        worst = np.ones(len(at))
        for scale in SCALES:
            n = self._count // scale
            sums = residual[:, -n * scale :].reshape(len(at), n, scale).sum(axis=2)
            ratio = (sums**2).mean(axis=1) / (scale * self._size * variance)
            worst = np.maximum(worst, np.where(ratio > 1.0 + CHANCE / np.sqrt(n), ratio, 1.0))
        return worst
