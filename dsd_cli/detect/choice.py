"""Which state eq. 9 and eq. 19 choose, and what they do on a tie."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.log import Array


def choose(cost: Array | list[float], best: float, last: int, axes: Array, hold: float) -> int:
    """The state of the smallest cost (-log p), or the last label.

    The last label stays unless another leads by more than `hold` nats. Of all states within `hold` (or a tie) of the
    best, the one that changes fewest axes is taken, then the best of these: a constant u distinguishes inertias, not
    delays, so the delay stays. On a tie again the last label stays.

    Parameters
    ----------
    cost : shape (states,); of few states a list is faster.
    best : its minimum.
    axes : index of every state's value on every axis, shape (axes, states).
    """
    tie = 1e-9 * (1.0 + abs(best))
    near = max(hold, tie)
    if not cost[last] - best > near:
        return last
    if isinstance(cost, list):
        candidates = [state for state, one in enumerate(cost) if one - best <= near]
        if len(candidates) > 1:
            cost = np.array(cost)
    else:
        candidates = np.flatnonzero(cost - best <= near).tolist()
    if len(candidates) <= 1:
        return candidates[0] if candidates else last
    same = (axes[:, candidates] == axes[:, [last]]).sum(axis=0)
    nearest = np.array(candidates)[same == same.max()]
    first = nearest[cost[nearest].argmin()]
    return int(first) if (cost[nearest] - cost[first] <= tie).sum() == 1 else last
