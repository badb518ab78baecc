"""The whole-step delay at which a balance of forces leaves least."""

from __future__ import annotations

import math

from dsd_cli.identify.fit.bank import Terms
from dsd_cli.identify.fit.solve import Solver
from dsd_cli.identify.policy import POLICY

#: Delays that are tried first, and coarse steps to either side of a delay that is about right.
_COARSE, _AROUND = 40, 2


def best_delay(solver: Solver, terms: Terms, most_tap: int, near: int | None = None, *, believed: float = 0.0) -> int:
    """The likeliest whole-step delay, found from coarse to fine.

    The likelihood is that of what is left, of unknown variance, N/2 ln SSE. In a motion of few frequencies u of half a
    period ago is as good as u now, with the other sign: each `POLICY.least_delay_range` between a delay and the
    believed one costs a nat.

    Parameters
    ----------
    near : the best delay of nearly the same rows; all are tried only where the best one is not around it.
    believed : s.
    """
    allowed = solver.taps(most_tap)
    first, last = allowed[0], allowed[-1]

    def price(tap: int, keep: bool = False) -> float:
        left = max(solver.squares(terms, tap, keep=keep), 1e-300)
        distance = abs(tap * solver.bank.tap_time - believed)
        return 0.5 * solver.bank.equations.counted * math.log(left) + distance / POLICY.least_delay_range

    known = {first: price(first, keep=True)}  # keeps the columns that do not depend on the delay

    def nats(tap: int) -> float:
        if tap not in known:
            known[tap] = price(tap)
        return known[tap]

    step = max(1, (len(allowed) - 1) // _COARSE)
    tried = allowed[::step]
    if near is not None:
        near = min(max(near, first), last)
        low, high = max(near - _AROUND * step, first), min(near + _AROUND * step, last)
        around = range(low, high + 1, step)
        tried = around if around[0] < min(around, key=nats) < around[-1] else tried
    while True:
        best = min(tried, key=nats)
        if step == 1:
            return best
        tried = range(max(best - step, first), min(best + step, last) + 1, max(step // 4, 1))
        step = max(step // 4, 1)
