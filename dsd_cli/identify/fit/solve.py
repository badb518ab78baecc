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
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dsd_cli.identify.fit.bank import FIXED, INERTIA, SHARE, Bank, Design, Term, Terms
from dsd_cli.identify.fit.blocks import Blocks
from dsd_cli.identify.fit.constraints import Reduction, Rules
from dsd_cli.identify.fit.gram import Grams, grams, solve, total_gram, without_noise
from dsd_cli.identify.fit.known import Known
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY
from dsd_cli.signals.log import Array

#: Newton steps, at most and at least, towards held values that are no linear function of the coefficients.
_ROUNDS, _LEAST_ROUNDS = 16, 3
#: Share of the target's norm below which the projection of a residual on a column is rounding.
_ROUNDING = 1e-7
#: Share of the largest weight below which a coefficient counts as 0.
_PRESSED = 1e-9


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
    variance : of a row, against which spreads of priors were weighed; 0: they were not.
    whole_steps : whether the delay is held at whole steps.
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
    variance: float = 0.0
    whole_steps: bool = False

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


class Reductions(NamedTuple):
    """Rules for both forms; None where nothing is known."""

    inverse: Reduction | None
    forward: Reduction | None


class Solver:
    """Fits selections of effects out of a bank of columns.

    Parameters
    ----------
    inertia : J0 of the forward form.
    known : what is held, bounded, or known to a spread. variance : of a row, per nat, against which a spread counts;
        0 leaves spreads out.
    """

    def __init__(
        self, bank: Bank, blocks: Blocks, inertia: float = 1.0, known: Known | None = None, variance: float = 0.0
    ) -> None:
        self.bank, self.blocks, self.inertia = bank, blocks, inertia
        self.known, self.variance = known or Known(), variance

    def squares(self, terms: Terms, tap: int, keep: bool = True) -> float:
        """Sum of squared residuals of the forward form, fitted to all rows at this whole-step delay.

        `keep` the columns that had to be made, for they will be asked for again.
        """
        design = self.bank.design(terms, tap, keep)
        total = total_gram(design.rows)
        rules = self.reductions(terms, tap, design, total).forward
        gram = _with_priors(without_noise(total, _of_columns(design), len(design.rows[0])), rules)
        _, weights = _solved(gram[None], 1, _forward_signs(design), rules)
        return self._size(weights[0], gram) + self.pull(terms)

    def fit(self, terms: Terms, tap: int, whole_steps: bool = False) -> Fit:
        """Cross-validated, at one whole-step delay and, unless `whole_steps`, a share of a further step."""
        design = self.bank.design(terms, tap)
        found = grams(design.rows, self.blocks)
        rules, forwards = self.reductions(terms, tap, design, found.total, (SHARE,) if whole_steps else ())
        stack = np.concatenate([found.total[None], found.fitted])
        rows = np.array([len(design.rows[0]), *self.blocks.fitted_rows])
        events = [i + 1 for i in _events(terms, design.widths)]
        quiet = _with_priors(without_noise(stack, _of_columns(design), rows), forwards)
        _, forward = _solved(quiet, 1, _forward_signs(design), forwards)
        ratio = forward[:, events] / np.where(forward[:, :1] != 0.0, forward[:, :1], 1.0)
        forward[:, events] = ratio[:1] * forward[:, :1]
        inverse, _ = _solved(_with_priors(without_noise(stack, design.noise, rows), rules), 0, _signs(design), rules)
        inverse[:, [i - 1 for i in events]] = inverse[:1, [i - 1 for i in events]]
        weights = self.inertia * forward
        held = weights[1:][self.blocks.fold]
        judged = without_noise(found.held_out, _of_columns(design), self.blocks.block_rows)
        losses = np.einsum("bi,bij,bj->b", held, judged, held)
        return Fit(
            terms,
            tap,
            inverse[0],
            inverse[1:],
            weights[0],
            weights[1:],
            self._size(forward[0], quiet[0]) + self.pull(terms),
            losses,
            design.widths,
            found,
            0.0 if rules is None else rules.variance,
            whole_steps,
        )

    def taps(self, most: int) -> range:
        """Whole steps of delay that are allowed, up to `most`."""
        fixed = self.known.fixed.get(DELAY)
        low, high = (fixed, fixed) if fixed is not None else self.known.limits(DELAY)
        if math.isinf(low) and math.isinf(high):
            return range(most + 1)
        step = self.bank.tap_time
        first = min(max(int(max(low, 0.0) / step + 1e-9), 0), most)
        last = most if math.isinf(high) else min(max(int(high / step + 1e-9), first), most)
        return range(first, last + 1)

    def pull(self, terms: Terms) -> float:
        """What shapes away from their priors cost, as a sum of squares."""
        if not (self.known.priors and self.variance > 0.0):
            return 0.0
        return self.variance * sum(self.known.pull_of_shapes(t.id, t.shape) for t in terms)

    def reductions(self, terms: Terms, tap: int, design: Design, total: Array, zero: Sequence[int] = ()) -> Reductions:
        """What is known of the values of these effects, as rules on rows of that Gram matrix; `zero` : coefficients."""
        if not (self.known or zero):
            return Reductions(None, None)
        rules = Rules(self.known, 0.0, terms, design.widths, tap, self.bank.tap_time)
        gram = without_noise(total, design.noise, len(design.rows[0]))[None]
        theta, held, pressed = np.zeros(len(design.rows) - 1), rules.held(None), list(zero)
        found = rules.reduction(theta, held, pressed, linear_only=True)
        for turn in range(_ROUNDS):
            theta = _solved(_with_priors(gram, found), 0, _signs(design), found)[0][0]
            if turn == 0:
                rules = replace(rules, variance=self._variance(gram[0], theta, len(design.rows[0])))
            beyond = {**rules.held(theta), **held}
            below = [k for k, s in enumerate(design.signed) if s and theta[k] < 0.0 and k not in pressed]
            turned = turn > 0 and (rules.linear or turn >= _LEAST_ROUNDS)
            if turned and not below and beyond.keys() == held.keys() and rules.kept(theta, held):
                break
            held, pressed = beyond, pressed + below[:1]
            found = rules.reduction(theta, held, pressed)
        # a row that a rule eliminates escapes the sign constraints of the forward form: they are checked here
        quiet, forward = without_noise(total, _of_columns(design), len(design.rows[0])), found
        for _ in design.signed:
            below = [k for k in self._below(quiet, design, forward) if k not in pressed]
            if not below:
                break
            pressed = pressed + below[:1]
            forward = rules.reduction(theta, held, pressed)
        return Reductions(found, forward)

    @staticmethod
    def _below(gram: Array, design: Design, rules: Reduction) -> list[int]:
        """Coefficients with the wrong sign in the forward form, of rows that these rules eliminate."""
        weights = _solved(_with_priors(gram, rules)[None], 1, _forward_signs(design), rules)[1][0]
        weights = weights / weights[1 + INERTIA]  # all that takes of the drive has the sign of J a
        wrong = np.asarray(design.signed) & (weights[1:] < -_PRESSED * np.abs(weights[1:]).max())
        return [k for k in np.flatnonzero(wrong).tolist() if 1 + k not in rules.left]

    def _variance(self, gram: Array, theta: Array, rows: int) -> float:
        """Of a row, per nat; what these coefficients leave beyond noise counts as correlated over many rows."""
        left = float(np.concatenate([[1.0], -theta]) @ gram @ np.concatenate([[1.0], -theta])) / rows
        return self.variance + POLICY.correlated_rows * max(left - self.variance, 0.0) if self.variance > 0.0 else 0.0

    def _size(self, weights: Array, gram: Array) -> float:
        return self.inertia**2 * max(float(weights @ gram @ weights), 0.0)


def _with_priors(stack: Array, rules: Reduction | None) -> Array:
    """Gram matrices, shape (..., p+1, p+1), with the further equations."""
    if rules is None or not len(rules.priors):
        return stack
    return np.asarray(stack + rules.priors.T @ rules.priors)


def _signs(design: Design) -> list[int]:
    """Of the columns, in the inverse form."""
    return [int(s) for s in design.signed]


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
    return [i for term, at, width in pairs if term.effect.listed for i in range(at, at + width)]


def _solved(stack: Array, target: int, signs: Sequence[int], rules: Reduction | None = None) -> tuple[Array, Array]:
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
    """`_solved` without rules."""
    others = [i for i in range(stack.shape[1]) if i != target]
    free, total, returned = list(range(len(others))), stack[0], set[int]()
    size = np.sqrt(np.maximum(np.diag(total)[others], 1e-300))
    least = _ROUNDING * math.sqrt(max(total[target, target], 0.0))
    while True:
        index = np.array([target, *(others[k] for k in free)])
        theta = solve(total[None, index[:, None], index])[0]
        wrong = [(k, t) for k, t in zip(free, theta.tolist(), strict=True) if signs[k] * t < 0.0]
        if wrong:
            free.remove(min(wrong, key=lambda w: signs[w[0]] * w[1] * size[w[0]])[0])
            continue
        if len(free) == len(others):
            break
        # active set: a coefficient held at 0 is freed again, once, if its gradient has the right sign
        left = (total[others][:, index] @ np.concatenate([[1.0], -theta])) / size * signs
        back = [k for k in range(len(others)) if k not in free and k not in returned and left[k] > least]
        if not back:
            break
        free.append(max(back, key=lambda k: left[k]))
        returned.add(free[-1])
    found = np.zeros((len(stack), len(others)))
    found[:, free] = theta if len(stack) == 1 else solve(stack[:, index[:, None], index])
    weights = np.zeros((len(stack), len(others) + 1))
    weights[:, target], weights[:, others] = 1.0, -found
    return found, weights
