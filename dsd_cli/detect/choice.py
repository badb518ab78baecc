"""Which state eq. 9 and eq. 19 choose, and what they do on a tie."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.log import Array


def choose(cost: Array, best: float, last: int, axes: Array, hold: float) -> int:
    """The state of the smallest cost (-log p), or the last label.

    The last label stays unless another leads by more than `hold` nats. Where several states tie for the best, the one
    that changes fewest axes is taken (u constant: the delays tie, and only the inertia is known); on a tie again none.

    Parameters
    ----------
    cost : shape (states,).
    best : its minimum.
    axes : index of every state's value on every axis, shape (axes, states).
    """
    tie = 1e-9 * (1.0 + abs(best))
    if not cost[last] - best > max(hold, tie):
        return last
    tied = np.flatnonzero(cost - best <= tie)
    if tied.size == 0:
        return last
    same = (axes[:, tied] == axes[:, [last]]).sum(axis=0)
    nearest = tied[same == same.max()]
    return int(nearest[0]) if nearest.size == 1 else last
