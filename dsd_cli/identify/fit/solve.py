"""Least squares out of Gram matrices: one selection of effects, all folds at once, the balance solved both ways round.

    u = J a + sum c_k x_k                 inverse: for values
    J0 a = g (u - sum c_k x_k)            forward: for evidence

x_k are the columns with the sign of what they take of the drive; J0 is a fixed inertia that keeps the unit of u.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from dsd_cli.identify.fit.bank import FIXED, INERTIA, SHARE, Bank, Design, Term, Terms, has_friction, inputs_of
from dsd_cli.identify.fit.blocks import Blocks, Grams, grams, total_gram, without_noise
from dsd_cli.identify.fit.constraints import Reduction, Rules, solved
from dsd_cli.identify.fit.laws_of_u import at_laws, grown, laws_of_u
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY
from dsd_cli.signals.log import Array
from dsd_cli.signals.once import once

#: Newton steps, at most and at least, towards held values that are no linear function of the coefficients.
_ROUNDS, _LEAST_ROUNDS = 16, 3
#: Share of the largest weight below which a coefficient counts as 0.
_PRESSED = 1e-9


@dataclass(frozen=True)
class Fit:
    """Coefficients of a selection of effects; one fit is like another of the same effects, delay and form.

    tap : whole steps of delay. The first coefficient is the motor's inertia, the second the share of a further step.
    total : coefficients fitted to all rows, inverse form, shape (p,).
    folds : with one fold held out each, shape (K, p).
    forward, forward_folds : weights of the rows (drive, acceleration, columns) whose sum is the residual of the form
        that is evidence, shapes (p+1,), (K, p+1). inverse : whether that is the inverse one.
    squares : sum of squared residuals of that fit to all rows.
    losses : the same on each block by the fit that did not see it, shape (B,).
    widths : coefficients of each effect (an effect on the command has none).
    grams : inner products of drive and columns.
    variance : of a row, against which spreads of priors were weighed; 0: they were not.
    whole_steps : whether the delay is held at whole steps.
    """

    terms: Terms
    tap: int
    total: Array = field(compare=False)
    folds: Array = field(compare=False)
    forward: Array = field(compare=False)
    forward_folds: Array = field(compare=False)
    squares: float = field(compare=False)
    losses: Array = field(compare=False)
    widths: tuple[int, ...] = field(compare=False)
    grams: Grams = field(compare=False)
    variance: float = field(default=0.0, compare=False)
    whole_steps: bool = False
    inverse: bool = False

    @property
    def loss(self) -> float:
        """Held-out sum of squares."""
        return float(self.losses.sum())

    def coefficients(self, term: Term) -> Array:
        """Of one effect, in the order of its columns."""
        return self.total[self.columns_of(term)]

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

    inertia : J0 of the forward form. known : what is held, bounded, or known to a spread. variance : of a row, per nat,
    against which a spread counts; 0 leaves spreads out. inverse : whether the inverse form is evidence.
    """

    def __init__(
        self,
        bank: Bank,
        blocks: Blocks,
        inertia: float = 1.0,
        known: PriorKnowledge | None = None,
        variance: float = 0.0,
        *,
        inverse: bool = False,
    ) -> None:
        self.bank, self.blocks, self.inertia, self.known = bank, blocks, inertia, known or PriorKnowledge()
        self.variance, self.inverse, self._squares = variance, inverse, dict[int, dict[Terms, float]]()
        self._grown = partial(grown, bank) if inverse else lambda *_: np.ones(1)

    def on(self, bank: Bank, variance: float = 0.0, blocks: Blocks | None = None) -> Solver:
        """The same on other rows."""
        return Solver(bank, blocks or self.blocks, self.inertia, self.known, variance, inverse=self.inverse)

    def knowing(self, known: PriorKnowledge) -> Solver:
        """The same, with that known in place of what was."""
        return Solver(self.bank, self.blocks, self.inertia, known, self.variance, inverse=self.inverse)

    def squares(self, terms: Terms, tap: int, keep: bool = True) -> float:
        """Sum of squared residuals of the form that is evidence, fitted to all rows at this whole-step delay.

        `keep` the columns that had to be made, for they will be asked for again.
        """
        design = self.bank.design(terms, tap, keep)
        return self._left(terms, tap, design, total_gram(design.rows)) + self.pull(terms)

    def squares_of(self, sets: Sequence[Terms], tap: int) -> dict[Terms, float]:
        """`squares` of many sets: inner products of the columns that they share are summed once, and none twice."""
        alike, found = dict[Any, list[Terms]](), self._squares.setdefault(tap, {})
        for terms in [one for one in sets if one not in found]:
            alike.setdefault((inputs_of(terms), has_friction(terms)), []).append(terms)
        for group in alike.values():
            every = tuple(dict.fromkeys(term for terms in group for term in terms))
            design = self.bank.design(every, tap)
            total = total_gram(design.rows)
            for terms in group:
                rows, part = _part(design, every, terms)
                found[terms] = self._left(terms, tap, part, total[np.ix_(rows, rows)]) + self.pull(terms)
        return {terms: found[terms] for terms in sets}

    @once
    def fit(self, terms: Terms, tap: int, whole_steps: bool = False) -> Fit:
        """Cross-validated, at one whole-step delay and, unless `whole_steps`, a share of a further step."""
        design = self.bank.design(terms, tap)
        found = grams(design.rows, self.blocks)
        rules = self.reductions(terms, tap, design, found.total, (SHARE,) if whole_steps else ())
        stack = np.concatenate([found.total[None], found.fitted])
        rows = np.array([len(design.rows[0]), *self.blocks.fitted_rows])
        events = [i + 1 for i in _events(terms, design.widths)]
        weights, judged = self._judging(design, stack, rules, rows)
        ratio = weights[:, events] / np.where(weights[:, :1] != 0.0, weights[:, :1], 1.0)
        weights[:, events] = ratio[:1] * weights[:, :1]
        quiet = _with_priors(without_noise(stack, design.noise, rows), rules.inverse)
        inverse, _ = solved(quiet, 0, _signs(design), rules.inverse)
        inverse[:, [i - 1 for i in events]] = inverse[:1, [i - 1 for i in events]]
        held = weights[1:][self.blocks.fold]
        aside = without_noise(found.held_out, _of_columns(design), self.blocks.block_rows)
        return Fit(
            terms,
            tap,
            inverse[0],
            inverse[1:],
            weights[0],
            weights[1:],
            self._size(weights[0], judged[0]) * self._grown(design, terms, tap, weights[:1])[0] + self.pull(terms),
            np.einsum("bi,bij,bj->b", held, aside, held)
            * self._grown(design, terms, tap, held, self.blocks.starts[::3]),
            design.widths,
            found,
            0.0 if rules.inverse is None else rules.inverse.variance,
            whole_steps,
            self.inverse,
        )

    def _judging(
        self, design: Design, stack: Array, rules: Reductions, rows: Array | None = None
    ) -> tuple[Array, Array]:
        """(weights of the rows in the residual that is evidence, shape (M, p+1); matrices that judge it)."""
        count = np.array([len(design.rows[0])]) if rows is None else rows
        if not self.inverse:
            judged = _with_priors(without_noise(stack, _of_columns(design), count), rules.forward)
            return self.inertia * solved(judged, 1, _forward_signs(design), rules.forward)[1], judged
        quiet = _with_priors(without_noise(stack, design.noise, count), rules.inverse)
        return -solved(quiet, 0, _signs(design), rules.inverse)[1], _with_priors(stack, rules.inverse)

    def _left(self, terms: Terms, tap: int, design: Design, total: Array) -> float:
        """Sum of squares of the form that is evidence."""
        weights, judged = self._judging(design, total[None], self.reductions(terms, tap, design, total))
        return self._size(weights[0], judged[0]) * float(self._grown(design, terms, tap, weights)[0])

    def taps(self, most: int) -> range:
        """Whole steps of delay that are allowed, up to `most`."""
        low, high = self.known.ends(DELAY)
        if math.isinf(low) and math.isinf(high):
            return range(most + 1)
        step = self.bank.tap_time
        first = min(max(int(max(low, 0.0) / step + 1e-9), 0), most)
        last = most if math.isinf(high) else min(max(int(high / step + 1e-9), first), most)
        return range(first, last + 1)

    def pull(self, terms: Terms) -> float:
        """What shapes away from their priors cost, as a sum of squares."""
        return self.variance * sum(self.known.pull_of_shapes(t.id, t.shape) for t in terms)

    def reductions(self, terms: Terms, tap: int, design: Design, total: Array, zero: Sequence[int] = ()) -> Reductions:
        """What is known of the values of these effects, as rules on rows of that Gram matrix; `zero` : coefficients."""
        gram = without_noise(total, design.noise, len(design.rows[0]))[None]
        by, none = (terms, design.widths, tap, self.bank.tap_time), np.zeros(len(design.signed))

        def free(known: PriorKnowledge) -> Array:  # without signs and bounds: linear in what is held
            rules = Rules(known, 0.0, *by).reduction(none, known.fixed, zero, linear_only=True)
            return solved(gram, 0, len(none) * [0], rules)[0][0]

        laws = laws_of_u(terms) if self.inverse else ()
        known = at_laws(self.bank, design, laws, tap, free, self.known, self.variance) if laws else self.known
        if not (known or zero):
            return Reductions(None, None)
        rules = Rules(known, 0.0, *by)
        theta, held, pressed = none, rules.held(None), list(zero)
        found = rules.reduction(theta, held, pressed, linear_only=True)
        for turn in range(_ROUNDS):
            theta = solved(_with_priors(gram, found), 0, _signs(design), found)[0][0]
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
        weights = solved(_with_priors(gram, rules)[None], 1, _forward_signs(design), rules)[1][0]
        weights = weights / weights[1 + INERTIA]  # all that takes of the drive has the sign of J a
        wrong = np.asarray(design.signed) & (weights[1:] < -_PRESSED * np.abs(weights[1:]).max())
        return [k for k in np.flatnonzero(wrong).tolist() if 1 + k not in rules.left]

    def _variance(self, gram: Array, theta: Array, rows: int) -> float:
        """Of a row, per nat; what these coefficients leave beyond noise counts as correlated over many rows."""
        left = float(np.concatenate([[1.0], -theta]) @ gram @ np.concatenate([[1.0], -theta])) / rows
        return self.variance + POLICY.correlated_rows * max(left - self.variance, 0.0) if self.variance > 0.0 else 0.0

    @staticmethod
    def _size(weights: Array, gram: Array) -> float:
        return max(float(weights @ gram @ weights), 0.0)


def _part(design: Design, every: Terms, terms: Terms) -> tuple[list[int], Design]:
    """(rows, design) of some of the effects of a design."""
    starts = dict(zip(every, np.cumsum([1 + FIXED, *design.widths]).tolist(), strict=False))
    width = dict(zip(every, design.widths, strict=True))
    rows = [*range(1 + FIXED), *(starts[t] + i for t in terms for i in range(width[t]))]
    at = [i - 1 for i in rows[1:]]
    of_rows, noise = [design.rows[i] for i in rows], design.noise[np.ix_(at, at)]
    return rows, Design(of_rows, [design.signed[i] for i in at], tuple(width[t] for t in terms), noise)


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
