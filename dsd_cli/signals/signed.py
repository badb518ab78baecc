"""Least squares out of Gram matrices: compiled where there is a sign to keep and the build had a compiler."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dsd_cli.signals.compiled import compiled_module
from dsd_cli.signals.log import Array

#: Added to columns scaled to unit length. Share of the target's norm below which the projection of a residual on a
#: column is rounding.
_RIDGE, _ROUNDING = 1e-9, 1e-7

#: The compiled module, or None where the build had no compiler.
COMPILED = compiled_module("dsd_cli.signals._signed")


def normal_equations(matrices: Array, ridge: float | Array = _RIDGE) -> tuple[Array, Array, Array]:
    """(matrix (M, p, p), right side (M, p), scale (p,)) of a stack of Gram matrices of (y, columns).

    `ridge` is added to the columns scaled to unit length (by their mean over the stack, so that a column that one
    fold never saw is ruled by it); a number or a matrix of shape (p, p).
    """
    a, b = matrices[:, 1:, 1:], matrices[:, 1:, 0]
    size_of = np.abs(a.diagonal(axis1=1, axis2=2).sum(axis=0))  # below 0 where the noise that was taken off was all
    scale = np.sqrt(np.maximum(size_of / len(a), 1e-300))
    added = ridge * np.eye(len(scale)) if isinstance(ridge, float) else ridge
    return a / (scale[:, None] * scale) + added, b / scale, scale


def signed(stack: Array, target: int, signs: Sequence[int], compiled: Any = COMPILED) -> Array:
    """Coefficients of all rows but the target, shape (M, p), which explain it.

    stack : Gram matrices, (M, p+1, p+1). The first decides which sign constraints are active (coefficient 0).
    signs : 1 not negative, -1 not positive, 0 free; of all rows but the target.

    Raises
    ------
    LinAlgError : a matrix is singular.
    """
    if compiled is None:
        return _signed(stack, target, signs)
    found = np.zeros((len(stack), len(signs)))
    whole, kept = np.ascontiguousarray(stack, dtype=np.float64), np.array(signs, dtype=np.float64)
    if not compiled.solved(whole, target, kept, _RIDGE, _ROUNDING, found):
        raise np.linalg.LinAlgError("Singular matrix")
    return found


def _signed(stack: Array, target: int, signs: Sequence[int]) -> Array:
    others = [i for i in range(stack.shape[1]) if i != target]
    free, total, returned = list(range(len(others))), stack[0], set[int]()
    size = np.sqrt(np.maximum(total.diagonal()[others], 1e-300))
    order = np.array([target, *others])
    normal, right, scale = normal_equations(stack[:, order[:, None], order] if target else stack)

    def fits(count: int) -> Array:
        at = np.array(free, dtype=np.intp)
        return np.asarray(np.linalg.solve(normal[:count, at[:, None], at], right[:count, at, None])[..., 0] / scale[at])

    while True:
        theta = fits(1)
        wrong = [(k, t) for k, t in zip(free, theta[0].tolist(), strict=True) if signs[k] * t < 0.0]
        if wrong:
            free.remove(min(wrong, key=lambda w: signs[w[0]] * w[1] * size[w[0]])[0])
            continue
        if len(free) == len(others):
            break
        # active set: a coefficient held at 0 is freed again, once, if its gradient has the right sign
        least = _ROUNDING * math.sqrt(max(total[target, target], 0.0))
        index = [target, *(others[k] for k in free)]
        left = (total[others][:, index] @ np.concatenate([[1.0], -theta[0]])) / size * signs
        back = [k for k in range(len(others)) if k not in free and k not in returned and left[k] > least]
        if not back:
            break
        free.append(max(back, key=lambda k: left[k]))
        returned.add(free[-1])
    found = np.zeros((len(stack), len(others)))
    found[:, free] = fits(len(stack)) if len(stack) > 1 else theta
    return found
