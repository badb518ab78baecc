"""Least squares out of Gram matrices: one selection of effects, all folds at once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from dsd_cli.effects import Role
from dsd_cli.identify.fit.bank import Bank, Term, Terms, inputs_of
from dsd_cli.identify.fit.blocks import Blocks
from dsd_cli.identify.fit.gram import Grams, grams, solve, squares, total_gram
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class Fit:
    """Coefficients of a selection of effects.

    Attributes
    ----------
    tap : whole samples of delay; the first two coefficients are those of this tap and of the next.
    total : coefficients fitted to all rows, shape (p,).
    folds : with one fold held out each, shape (K, p).
    squares : sum of squared residuals of the fit to all rows.
    losses : the same on each block by the fit that did not see it, shape (B,).
    widths : coefficients of each effect (an effect on the command has none).
    grams : inner products of y and the columns.
    """

    terms: Terms
    tap: int
    total: Array
    folds: Array
    squares: float
    losses: Array
    widths: tuple[int, ...]
    grams: Grams

    @property
    def loss(self) -> float:
        """Held-out sum of squares."""
        return float(self.losses.sum())

    @property
    def delay(self) -> float:
        """Samples."""
        return delay_of(self.total, self.tap)

    def coefficients(self, term: Term, fold: int | None = None) -> Array:
        """Of one effect, in the order of its columns."""
        theta = self.total if fold is None else self.folds[fold]
        position = self.terms.index(term)
        at = 2 + sum(self.widths[:position])
        return theta[at : at + self.widths[position]]


def delay_of(theta: Array, tap: int) -> float:
    """Delay in samples of the two drive coefficients."""
    gain = theta[0] + theta[1]
    return tap + float(theta[1] / gain) if gain > 0.0 else float(tap)


def _not_negative(term: Term, columns: int) -> bool:
    """Whether the one coefficient has 0 as its lower bound."""
    linear = [p for p in term.effect.parameters if p.linear and not p.listed]
    return columns == 1 and len(linear) == 1 and linear[0].lower >= 0.0


class Solver:
    """Fits selections of effects out of a bank of columns."""

    def __init__(self, bank: Bank, blocks: Blocks) -> None:
        self.bank, self.blocks = bank, blocks

    def best(self, terms: Terms, taps: Iterable[int]) -> Fit:
        """The fit at the best of these whole-sample delays, cross-validated."""
        tap = min(dict.fromkeys(taps), key=lambda n: self.squares(terms, n))
        return self.fit(terms, tap)

    def squares(self, terms: Terms, tap: int, keep: bool = True) -> float:
        """Sum of squared residuals, fitted to all rows at this whole-sample delay.

        `keep` the columns that had to be made, for they will be asked for again.
        """
        rows, signed, _ = self._rows(terms, tap, keep)
        total = total_gram(rows)
        free = _free(total, signed)
        part = total[np.ix_(free, free)]
        return squares(part, solve(part[None])[0])

    def fit(self, terms: Terms, tap: int) -> Fit:
        """Cross-validated, at one whole-sample delay."""
        rows, signed, widths = self._rows(terms, tap)
        found = grams(rows, self.blocks)
        free = _free(found.total, signed)
        matrices = np.concatenate([found.total[None], found.fitted])[:, free][:, :, free]
        theta = np.zeros((len(matrices), len(rows) - 1))
        theta[:, [i - 1 for i in free[1:]]] = solve(matrices)
        for at in _events(terms, widths):
            theta[:, at] = theta[0, at]
        residual = np.concatenate([np.ones((len(theta) - 1, 1)), -theta[1:]], axis=1)[self.blocks.fold]
        losses = np.einsum("bi,bij,bj->b", residual, found.held_out, residual)
        return Fit(
            terms, tap, theta[0], theta[1:], squares(found.total, theta[0]), np.maximum(losses, 0.0), widths, found
        )

    def _rows(self, terms: Terms, tap: int, keep: bool = True) -> tuple[list[Array], list[bool], tuple[int, ...]]:
        """(y and columns, whether the coefficient must not be negative, columns of each term)."""
        inputs = inputs_of(terms)
        rows = [self.bank.y, *(self.bank.drive(inputs, n, keep) for n in (tap, tap + 1))]
        signed, widths = [False, True, True], []
        for term in terms:
            columns = [] if term.effect.role is Role.INPUT else self.bank.columns(term, tap, keep)
            rows += columns
            signed += [_not_negative(term, len(columns))] * len(columns)
            widths.append(len(columns))
        return rows, signed, tuple(widths)


def _events(terms: Terms, widths: tuple[int, ...]) -> list[int]:
    """Coefficients of single events: a fold that did not see one cannot know it, so all folds get that of all rows."""
    starts = np.cumsum([2, *widths])
    pairs = zip(terms, starts, widths, strict=False)
    return [i for term, at, width in pairs if "edges" in term.shape for i in range(at, at + width)]


def _free(total: Array, signed: list[bool]) -> list[int]:
    """Rows (y first) whose coefficients are not pressed onto 0 by their sign."""
    free = list(range(len(signed)))
    while True:
        part = total[np.ix_(free, free)]
        theta = np.concatenate([[0.0], solve(part[None])[0]])
        wrong = [k for k, i in enumerate(free) if signed[i] and theta[k] < 0.0]
        if not wrong:
            return free
        free.pop(min(wrong, key=lambda k: theta[k] * np.sqrt(part[k, k])))
