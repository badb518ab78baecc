"""Least squares out of Gram matrices with signs that coefficients must have, and rules that tie them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dsd_cli.identify.fit.constraints import Reduction
from dsd_cli.identify.fit.gram import solve
from dsd_cli.signals.log import Array

#: Share of the target's norm below which the projection of a residual on a column is rounding.
_ROUNDING = 1e-7


def solved(stack: Array, target: int, signs: Sequence[int], rules: Reduction | None = None) -> tuple[Array, Array]:
    """(coefficients of all rows but the target, shape (M, p), weights of all rows in the residual, shape (M, p+1)).

    Parameters
    ----------
    stack : Gram matrices, (M, p+1, p+1). The first decides which sign constraints are active (coefficient 0).
    signs : 1 not negative, -1 not positive, 0 free; of all rows but the target.
    rules : weights are `rules.expand` times those of the rows that are left. Where the target is not left (a held
        inertia leaves no acceleration), the drive stands in for it.
    """
    others = [i for i in range(stack.shape[1]) if i != target]
    if rules is None:
        return _signed(stack, target, signs)
    by_row = dict(zip(others, signs, strict=True))
    if target not in rules.left:  # then columns count with the sign that they have beside the drive
        by_row = {row: -sign for row, sign in by_row.items()}
    instead = target if target in rules.left else 0
    small = rules.expand.T @ stack @ rules.expand
    left = [row for row in rules.left if row != instead]
    _, weights = _signed(small, rules.left.index(instead), [by_row[row] for row in left])
    weights = weights @ rules.expand.T
    weights = weights / weights[:, [target]]
    return -weights[:, others], weights


def _signed(stack: Array, target: int, signs: Sequence[int]) -> tuple[Array, Array]:
    """`solved` without rules."""
    others = [i for i in range(stack.shape[1]) if i != target]
    free, total, returned = list(range(len(others))), stack[0], set[int]()
    size = np.sqrt(np.maximum(total.diagonal()[others], 1e-300))
    while True:
        index = [target, *(others[k] for k in free)]
        theta = solve(stack[:, np.array(index)[:, None], index])
        first = theta[0].tolist()
        wrong = [(k, t) for k, t in zip(free, first, strict=True) if signs[k] * t < 0.0]
        if wrong:
            free.remove(min(wrong, key=lambda w: signs[w[0]] * w[1] * size[w[0]])[0])
            continue
        if len(free) == len(others):
            break
        # active set: a coefficient held at 0 is freed again, once, if its gradient has the right sign
        least = _ROUNDING * math.sqrt(max(total[target, target], 0.0))
        left = (total[others][:, index] @ np.concatenate([[1.0], -theta[0]])) / size * signs
        back = [k for k in range(len(others)) if k not in free and k not in returned and left[k] > least]
        if not back:
            break
        free.append(max(back, key=lambda k: left[k]))
        returned.add(free[-1])
    found = np.zeros((len(stack), len(others)))
    found[:, free] = theta
    weights = np.zeros((len(stack), len(others) + 1))
    weights[:, target], weights[:, others] = 1.0, -found
    return found, weights
