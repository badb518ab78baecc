"""The whole-step delay at which a balance of forces leaves least."""

from __future__ import annotations

from dsd_cli.identify.fit.bank import Terms
from dsd_cli.identify.fit.solve import Solver

#: Delays that are tried first, and coarse steps to either side of a delay that is about right.
_COARSE, _AROUND = 40, 2


def best_delay(solver: Solver, terms: Terms, most_tap: int, near: int | None = None) -> int:
    """The whole-step delay with the least squares, found from coarse to fine.

    Parameters
    ----------
    near : the best delay of nearly the same rows; all are tried only where the best one is not around it.
    """
    allowed = solver.taps(most_tap)
    first, last = allowed[0], allowed[-1]
    known = {first: solver.squares(terms, first)}  # keeps the columns that do not depend on the delay

    def squares(tap: int) -> float:
        if tap not in known:
            known[tap] = solver.squares(terms, tap, keep=False)
        return known[tap]

    step = max(1, (len(allowed) - 1) // _COARSE)
    tried = allowed[::step]
    if near is not None:
        near = min(max(near, first), last)
        low, high = max(near - _AROUND * step, first), min(near + _AROUND * step, last)
        around = range(low, high + 1, step)
        tried = around if around[0] < min(around, key=squares) < around[-1] else tried
    while True:
        best = min(tried, key=squares)
        if step == 1:
            return best
        tried = range(max(best - step, first), min(best + step, last) + 1, max(step // 4, 1))
        step = max(step // 4, 1)
