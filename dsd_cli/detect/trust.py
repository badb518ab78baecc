"""Has a model earned it that its forces are taken as right?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsd_cli.effects.memory import one_pole

#: Blocks per window.
BLOCKS = 16
#: Blocks whose label was confident: so many are needed before a model is trusted, so many are looked back on.
EARNED, REMEMBERED = 4 * BLOCKS, 16 * BLOCKS
#: Share of them that may leave more than the noise: white noise of rho does so in 8 to 10 of 100 blocks, by chance, and
#: in less than a fifth of those that are looked back on in 99 of 100 cases.
MOST_BAD = 0.2


class Trust:
    """Whether the labels of a recording have left no more than the noise so far."""

    def __init__(self) -> None:
        self._bad, self._weight, self._count = 0.0, 0.0, 0

    def follow(self, bad: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Before and after each of the next blocks, shape (n + 1,); `bad` : it left more than the noise."""
        keep = np.full(bad.size, 1.0 - 1.0 / REMEMBERED)
        shares = np.concatenate([[self._bad], one_pole(keep, (1.0 - keep) * bad, self._bad)])
        weights = np.concatenate([[self._weight], one_pole(keep, 1.0 - keep, self._weight)])
        counts = self._count + np.arange(bad.size + 1)
        self._bad, self._weight, self._count = float(shares[-1]), float(weights[-1]), int(counts[-1])
        return np.asarray((counts >= EARNED) & (shares <= MOST_BAD * weights))
