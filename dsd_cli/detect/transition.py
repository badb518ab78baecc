"""The transition matrix A of eq. 2: here a tuning parameter that makes labels reluctant to change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dsd_cli.errors import UsageError
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class Transition:
    """Uniform (both None), sticky (`stay`), or any non-negative `matrix`, shape (states, states), row = from.

    Rows need not sum to one (the paper uses A for tuning only), zero entries forbid a change.
    """

    stay: float | None = None
    matrix: Array | None = None

    @property
    def uniform(self) -> bool:
        """Every change is as likely as none: the likelihood alone decides."""
        return self.stay is None and self.matrix is None

    def log_matrix(self, states: int) -> Array:
        """log A, shape (states, states); -inf where a change is forbidden.

        Raises
        ------
        UsageError : a matrix of the wrong shape, negative or not finite, or a row without a positive entry.
        """
        if self.matrix is None:
            stay, move = self.log_stay_move(states)
            if stay == move:
                return np.broadcast_to(np.float64(stay), (states, states))  # 20,000 states would take 3.2 GB
            full = np.full((states, states), move)
            np.fill_diagonal(full, stay)
            return full
        a = np.asarray(self.matrix, dtype=np.float64)
        if a.shape != (states, states):
            found = " x ".join(map(str, a.shape))
            raise UsageError(
                f"the transition matrix is {found}, the grid has {states} states",
                f"give {states} rows of {states} numbers (row: from, column: to)",
            )
        if not np.isfinite(a).all() or (a < 0).any():
            raise UsageError("the transition matrix has a negative or non-finite entry", "entries must be 0 or more")
        if not (a > 0).any(axis=1).all():
            row = int(np.flatnonzero(~(a > 0).any(axis=1))[0])
            raise UsageError(f"row {row} of the transition matrix is all zero", "every state needs a successor")
        with np.errstate(divide="ignore"):
            return np.log(a)

    def log_stay_move(self, states: int) -> tuple[float, float]:
        """log of the diagonal and of an off-diagonal element (uniform or sticky A)."""
        stay = 1.0 / states if self.stay is None else self.stay
        move = 1.0 / states if self.stay is None else (1.0 - self.stay) / max(states - 1, 1)
        with np.errstate(divide="ignore"):
            return float(np.log(stay)), float(np.log(move))
