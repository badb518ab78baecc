"""Least squares out of Gram matrices: one selection of effects, all folds at once, the balance solved both ways round.

    u = J a + sum c_k x_k                 inverse: for values
    J0 a = g (u - sum c_k x_k)            forward: for evidence

In the inverse form what no model follows is in u, and J hardly moves with it. In the forward form the sensor's noise
is on the left, so that no effect can win by making u small, or by following the noise of a.

x_k are the columns with the sign of what they take of the drive; J0 is a fixed inertia that keeps the unit of u.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsd_cli.identify.fit.bank import FIXED, INERTIA, Bank, Design, Term, Terms
from dsd_cli.identify.fit.blocks import Blocks
from dsd_cli.identify.fit.gram import Grams, grams, solve, total_gram, without_noise
from dsd_cli.signals.log import Array

#: Of the target, that a residual must hold of a column to be more than rounding.
_ROUNDING = 1e-7


@dataclass(frozen=True)
class Fit:
    """Coefficients of a selection of effects.

    Attributes
    ----------
    tap : whole steps of delay. The first coefficient is the motor's inertia, the second the share of a further step.
    total : coefficients fitted to all rows, inverse form, shape (p,).
    folds : with one fold held out each, shape (K, p).
    forward, forward_folds : weights of the rows (drive, acceleration, columns) whose sum is the residual of the forward
        form, shapes (p+1,), (K, p+1).
    squares : sum of squared residuals of the forward fit to all rows.
    losses : the same on each block by the fit that did not see it, shape (B,).
    widths : coefficients of each effect (an effect on the command has none).
    grams : inner products of drive and columns.
    """

    terms: Terms
    tap: int
    total: Array
    folds: Array
    forward: Array
    forward_folds: Array
    squares: float
    losses: Array
    widths: tuple[int, ...]
    grams: Grams

    @property
    def loss(self) -> float:
        """Held-out sum of squares."""
        return float(self.losses.sum())

    def coefficients(self, term: Term, fold: int | None = None) -> Array:
        """Of one effect, in the order of its columns."""
        theta = self.total if fold is None else self.folds[fold]
        return theta[self.columns_of(term)]

    def columns_of(self, term: Term) -> slice:
        """Where the coefficients of an effect stand."""
        position = self.terms.index(term)
        at = FIXED + sum(self.widths[:position])
        return slice(at, at + self.widths[position])


class Solver:
    """Fits selections of effects out of a bank of columns.

    Parameters
    ----------
    inertia : J0 of the forward form.
    """

    def __init__(self, bank: Bank, blocks: Blocks, inertia: float = 1.0) -> None:
        self.bank, self.blocks, self.inertia = bank, blocks, inertia

    def squares(self, terms: Terms, tap: int, keep: bool = True) -> float:
        """Sum of squared residuals of the forward form, fitted to all rows at this whole-step delay.

        `keep` the columns that had to be made, for they will be asked for again.
        """
        design = self.bank.design(terms, tap, keep)
        gram = without_noise(total_gram(design.rows), _of_columns(design), len(design.rows[0]))
        _, weights = _solved(gram[None], 1, _forward_signs(design))
        return self._size(weights[0], gram)

    def fit(self, terms: Terms, tap: int) -> Fit:
        """Cross-validated, at one whole-step delay."""
        design = self.bank.design(terms, tap)
        found = grams(design.rows, self.blocks)
        stack = np.concatenate([found.total[None], found.fitted])
        rows = np.array([len(design.rows[0]), *self.blocks.fitted_rows()])
        events = [i + 1 for i in _events(terms, design.widths)]
        _, forward = _solved(without_noise(stack, _of_columns(design), rows), 1, _forward_signs(design))
        ratio = forward[:, events] / np.where(forward[:, :1] != 0.0, forward[:, :1], 1.0)
        forward[:, events] = ratio[:1] * forward[:, :1]
        inverse, _ = _solved(without_noise(stack, design.noise, rows), 0, [int(s) for s in design.signed])
        inverse[:, [i - 1 for i in events]] = inverse[:1, [i - 1 for i in events]]
        weights = self.inertia * forward
        held = weights[1:][self.blocks.fold]
        judged = without_noise(found.held_out, _of_columns(design), self.blocks.block_rows())
        losses = np.einsum("bi,bij,bj->b", held, judged, held)
        return Fit(
            terms,
            tap,
            inverse[0],
            inverse[1:],
            weights[0],
            weights[1:],
            self._size(forward[0], without_noise(found.total, _of_columns(design), rows[0])),
            losses,
            design.widths,
            found,
        )

    def _size(self, weights: Array, gram: Array) -> float:
        return self.inertia**2 * max(float(weights @ gram @ weights), 0.0)


def _forward_signs(design: Design) -> list[int]:
    """Of the drive and the columns but the acceleration: u drives, and what takes of it takes of a."""
    return [1, *(-int(s) for s in design.signed[1:])]


def _of_columns(design: Design) -> Array:
    """The noise in the columns of loads and what it has in common with the acceleration, which keeps its own."""
    noise = design.noise.copy()
    noise[INERTIA, INERTIA] = 0.0
    return noise


def _events(terms: Terms, widths: tuple[int, ...]) -> list[int]:
    """Coefficients of single events: a fold that did not see one cannot know it, so all folds get that of all rows."""
    starts = np.cumsum([FIXED, *widths])
    pairs = zip(terms, starts, widths, strict=False)
    return [i for term, at, width in pairs if "edges" in term.shape for i in range(at, at + width)]


def _solved(stack: Array, target: int, signs: Sequence[int]) -> tuple[Array, Array]:
    """(coefficients of all rows but the target, shape (M, p), weights of all rows in the residual, shape (M, p+1)).

    Parameters
    ----------
    stack : Gram matrices, (M, p+1, p+1). The first says which coefficients are pressed onto 0 by their sign.
    signs : 1 not negative, -1 not positive, 0 free; of all rows but the target.
    """
    others = [i for i in range(stack.shape[1]) if i != target]
    free, total, returned = list(range(len(others))), stack[0], set[int]()
    size = np.sqrt(np.maximum(np.diag(total)[others], 1e-300))
    least = _ROUNDING * math.sqrt(max(total[target, target], 0.0))
    while True:
        index = [target, *(others[k] for k in free)]
        theta = solve(total[np.ix_(index, index)][None])[0]
        wrong = [(k, t) for k, t in zip(free, theta, strict=True) if signs[k] * t < 0.0]
        if wrong:
            free.remove(min(wrong, key=lambda w: signs[w[0]] * w[1] * size[w[0]])[0])
            continue
        # one that was pressed onto 0 beside others comes back, once, if without them it has the right sign
        left = (total[np.ix_(others, index)] @ np.concatenate([[1.0], -theta])) / size * signs
        back = [k for k in range(len(others)) if k not in free and k not in returned and left[k] > least]
        if not back:
            break
        free.append(max(back, key=lambda k: left[k]))
        returned.add(free[-1])
    found = np.zeros((len(stack), len(others)))
    found[:, free] = theta if len(stack) == 1 else solve(stack[:, index][:, :, index])
    weights = np.zeros((len(stack), len(others) + 1))
    weights[:, target], weights[:, others] = 1.0, -found
    return found, weights
