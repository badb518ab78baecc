"""Noise that lasts: by how much a window's residual varies more on longer time scales than white noise does.

Of white noise a sum over m samples has the variance m sigma^2. What a model lacks lasts for many samples: then the sum
varies more, and so does an estimate, which sums with slow weights. Two looks at it, the larger counts: sums over blocks
see what lasts for a good part of the window, the correlation c of neighbours what lasts for some samples. A first-order
process sums up as if only one in (1 + c) / (1 - c) samples were there (its integrated autocorrelation time).
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
#: Standard deviations (1 / sqrt(n)) of the correlation of neighbours that chance may make.
NEIGHBOURS = 2.0
#: In n samples it looks smaller than it is, by (1 + 3 c) / n (Marriott and Pope, Biometrika 41, 1954). No window tells
#: of more than a half of it that it lasts.
BIAS, LONGEST = 3.0, 0.5
#: Values of a fit, and the least share of the noise that they leave in its residual.
PARAMETERS, LEAST_LEFT = 2.0, 0.25


class Colour:
    """Fed with all samples, pass by pass; the same bits however they are cut."""

    def __init__(self, window: int, shape: tuple[int, int]) -> None:
        self._blocks, self._neighbours = BlockSums(window, shape), Neighbours(window, shape)

    def feed(self, y: Array, z: Array, missing: NDArray[np.bool_]) -> None:
        """The next samples: y of shape (n,), z of shape (n, delays, combinations); a missing one adds nothing."""
        rows = np.column_stack([y, z.reshape(len(y), -1)])
        rows[missing] = 0.0
        self._blocks.feed(rows)
        self._neighbours.feed(rows)

    def excess(self, peak: Peak, combination: NDArray[np.intp], variance: Array) -> Array:
        """Of the fits at the samples that were fed last: 1, or by how much more than `variance` the noise counts."""
        worst = self._blocks.excess(peak, combination, variance)
        return np.maximum(worst, self._neighbours.lasting(peak, combination) / variance)


class Neighbours:
    """Variance times correlation time of the residual, of the fit and the window at the end of every block."""

    def __init__(self, window: int, shape: tuple[int, int]) -> None:
        self._window, self._size, self._shape = window, max(window // BLOCKS, 1), shape
        self._raw = np.zeros((window, 1 + shape[0] * shape[1]))  # the window before the samples at hand, and those
        self._fed = 0  # samples at hand
        self._seen = 0  # samples before them
        self._last = 0.0

    def feed(self, rows: Array) -> None:
        """The next samples: y and z."""
        self._seen += self._fed
        self._raw = np.concatenate([self._raw[-self._window :], rows])
        self._fed = len(rows)

    def lasting(self, peak: Peak, combination: NDArray[np.intp]) -> Array:
        """Of the samples that were fed last, shape (n,): what the last block's end said; 0 where nothing lasts."""
        ends = np.flatnonzero((self._seen + np.arange(1, self._fed + 1)) % self._size == 0)
        at = ends[:, None] + 1 + np.arange(self._window)
        y, z = self._raw[:, 0], self._raw[:, 1:].reshape(-1, *self._shape)
        here = Peak(*(column[ends] for column in peak))
        residual = y[at] - here.alpha[:, None] * _between(z, at, here, combination[ends])
        square = (residual**2).sum(axis=1)
        together = (residual[:, 1:] * residual[:, :-1]).sum(axis=1)
        c = np.divide(together, square, out=np.zeros_like(square), where=square > 0.0)
        lasts = c > NEIGHBOURS / np.sqrt(self._window)
        c += (1.0 + BIAS * c) / self._window
        longest = LONGEST * self._window
        c = np.minimum(c, (longest - 1.0) / (longest + 1.0))
        lasting = (1.0 + c) / (1.0 - c)
        # the fit takes PARAMETERS of n / lasting independent values, and their share of the noise with them
        left = np.maximum(1.0 - PARAMETERS * lasting / self._window, LEAST_LEFT)
        found = np.where(lasts, square / self._window / left * lasting, 0.0)
        counted = np.zeros(self._fed, dtype=np.intp)
        counted[ends] = 1
        said = np.concatenate([[self._last], found])
        self._last = float(said[-1])
        return np.asarray(said[np.cumsum(counted)])


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

    def feed(self, rows: Array) -> None:
        """The next samples: y and z."""
        left, n = len(self._left), len(rows)
        rows = np.concatenate([self._left, rows])
        whole = len(rows) // self._size
        self._left = rows[whole * self._size :].copy()
        sums = np.add.reduce(rows[: whole * self._size].reshape(whole, self._size, rows.shape[1]), axis=1)
        self._blocks = np.concatenate([self._blocks[-self._count :], sums])
        self._ends = self._count + (left + 1 + np.arange(n)) // self._size  # block after the last whole one

    def excess(self, peak: Peak, combination: NDArray[np.intp], variance: Array) -> Array:
        """Of the fits at the samples that were fed last: 1, or by how much sums vary more than `variance` has it."""
        at = self._ends[:, None] - self._count + np.arange(self._count)
        y, z = self._blocks[:, 0], self._blocks[:, 1:].reshape(-1, *self._shape)
        residual = y[at] - peak.alpha[:, None] * _between(z, at, peak, combination)
        worst = np.ones(len(at))
        for scale in SCALES:
            n = self._count // scale
            sums = residual[:, -n * scale :].reshape(len(at), n, scale).sum(axis=2)
            ratio = (sums**2).mean(axis=1) / (scale * self._size * variance)
            worst = np.maximum(worst, np.where(ratio > 1.0 + CHANCE / np.sqrt(n), ratio, 1.0))
        return worst


def _between(z: Array, at: NDArray[np.intp], peak: Peak, combination: NDArray[np.intp]) -> Array:
    """z at the delay of every fit, of the rows `at`; both of shape (fits, rows)."""
    first = np.minimum(peak.lag.astype(np.intp), max(z.shape[1] - 2, 0))
    share, other = (peak.lag - first)[:, None], np.minimum(first + 1, z.shape[1] - 1)
    group = combination[:, None]
    return np.asarray((1.0 - share) * z[at, first[:, None], group] + share * z[at, other[:, None], group])
