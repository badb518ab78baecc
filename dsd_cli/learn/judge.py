"""Laws beside the model's own values, judged on held-out blocks; the folds are dealt by where a law acts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.identify.fit.blocks import Blocks, grams, losses, total_gram, without_noise
from dsd_cli.identify.fit.row_weights import inflation
from dsd_cli.learn.families import Columns
from dsd_cli.learn.rows import Balance
from dsd_cli.signals.log import Array

#: Strengths of the penalty on bends, of the mean information on a coefficient.
STRENGTHS = (1e-6, 1e-4, 1e-2, 1.0)
#: Share of an own effect's column that a law leaves, below which the law has it as well: its value is held then.
_COVERED = 2e-3
_RIDGE = 1e-10


@dataclass(frozen=True)
class LawFit:
    """A law, or several, fitted beside the model.

    laws : what it has. losses : held-out whitened squares per block, shape (B,).
    total, folds : coefficients of all columns after the target, shapes (p,) and (K, p).
    strength : of the penalty.
    held : what is fitted along and held, for the laws have it: 0 is J (the gain of u), then the model's own effects.
    blocks : with its folds.
    """

    laws: tuple[Columns, ...]
    losses: Array
    total: Array
    folds: Array
    strength: float
    held: tuple[int, ...]
    blocks: Blocks

    @property
    def loss(self) -> float:
        """Held-out whitened squares."""
        return float(self.losses.sum())

    @property
    def forward(self) -> bool:
        """Whether the acceleration is the target."""
        return any(law.family.of_u for law in self.laws)


@dataclass(frozen=True)
class Problem:
    """Whitened rows of one selection of laws: the target first, the columns of the laws last."""

    rows: list[Array]
    fixed: int
    penalty: Array
    noise: Array
    held: tuple[int, ...]


class Judge:
    """Fits laws on a balance; columns are whitened once."""

    def __init__(self, balance: Balance) -> None:
        self.balance = balance
        self._white: dict[int, Array] = {}
        self._kept: list[object] = []

    def white(self, rows: Array) -> Array:
        """Cached by the array itself, which is kept."""
        if id(rows) not in self._white:
            self._white[id(rows)] = self.balance.white(rows)
            self._kept.append(rows)
        return self._white[id(rows)]

    def fit(self, laws: Sequence[Columns]) -> LawFit:
        """Cross-validated, at the strength of the penalty with the least held-out loss."""
        laws = tuple(laws)
        problem = self.posed(laws)
        return _fitted(laws, problem, self._dealt(laws, problem))

    def without(self, fit: LawFit) -> Array:
        """Held-out losses without the last law of a fit, where that is one of the motion: in the same folds, and with
        what is held beside it; shape (B,)."""
        less = fit.laws[:-1]
        if fit.forward:
            return self.fit(less).losses
        problem = self.posed(fit.laws)
        count = len(problem.rows) - len(fit.laws[-1].rows)
        size = count - 1 - problem.fixed
        shorter = replace(
            problem,
            rows=problem.rows[:count],
            penalty=problem.penalty[:size, :size],
            noise=problem.noise[: count - 1, : count - 1],
        )
        return _fitted(less, shorter, fit.blocks).losses

    def covariance(self, fit: LawFit) -> Array:
        """Of the coefficients of the laws, per variance of a row, shape (c, c)."""
        problem = self.posed(fit.laws)
        total = without_noise(total_gram(problem.rows)[None], problem.noise, len(problem.rows[0]))
        normal, scale = _normal(total[:, 1:, 1:], problem, fit.strength)
        own = scale[problem.fixed :]  # an effect of the model that never acted has none
        return np.asarray(np.linalg.inv(normal[0])[problem.fixed :, problem.fixed :] / (own[:, None] * own))

    def posed(self, laws: tuple[Columns, ...]) -> Problem:
        """Target and columns in the form that suits the laws."""
        b, forward = self.balance, any(law.family.of_u for law in laws)
        columns = [x for law in laws for x in law.rows]
        held = self._covered(laws, forward)
        rest = (
            self.white(self._target(forward, held)) if not (held or forward) else b.white(self._target(forward, held))
        )
        rows = [self.white(x) for x in self._beside(forward, held)]
        fixed = len(rows)
        rows += [self.white(x) for x in columns]
        noise = np.zeros((len(rows), len(rows)))
        if not forward and 0 not in held:
            noise[0, 0] = b.noise * float(np.mean(b.weight**2))
        size = len(columns)
        penalty, at = np.zeros((size, size)), 0
        for law in laws:
            end = at + len(law.rows)
            penalty[at:end, at:end] = law.penalty
            at = end
        return Problem([rest, *rows], fixed, penalty, noise, held)

    def _beside(self, forward: bool, held: tuple[int, ...]) -> list[Array]:
        """Columns of what is fitted along, but for those that are held."""
        b = self.balance
        first = [b.u if forward else b.acceleration] * (0 not in held)
        return [*first, *b.later, *(x for i, x in enumerate(b.own) if i + 1 not in held)]

    def _target(self, forward: bool, held: tuple[int, ...]) -> Array:
        """What is fitted, less what is held, rows in the unit of u."""
        b = self.balance
        if not held:
            return b.inertia * b.acceleration if forward else b.u
        if not forward:
            return b.u - b.taken(held)
        whole = b.inertia * b.acceleration - b.u * (0 in held)
        return whole + b.taken(tuple(i for i in held if i))

    def _covered(self, laws: tuple[Columns, ...], forward: bool) -> tuple[int, ...]:
        """Columns fitted along that the laws have as well: 0 is J, or the gain of u, then the model's own effects."""
        if not laws:
            return ()
        x = np.stack([self.white(c) for law in laws for c in law.rows])
        strengths, basis = np.linalg.eigh(x @ x.T)
        kept = strengths > 1e-9 * strengths[-1]
        rows = (basis[:, kept].T @ x) / np.sqrt(strengths[kept])[:, None]
        found = []
        for i, own in enumerate([self.balance.u if forward else self.balance.acceleration, *self.balance.own]):
            column = self.white(own)
            size = float(column @ column)
            if size > 0.0 and size - float(np.sum((rows @ column) ** 2)) < _COVERED * size:
                found.append(i)
        return tuple(found)

    def _dealt(self, laws: tuple[Columns, ...], problem: Problem) -> Blocks:
        """The blocks, dealt to the folds by how strongly the last law acts in them: each fold has as much of it."""
        blocks = self.balance.blocks
        if not laws:
            return blocks
        total = total_gram(problem.rows)[None]
        theta = _solved(without_noise(total, problem.noise, len(problem.rows[0])), problem, 1e-4)
        law = theta[0, -len(laws[-1].rows) :] @ np.stack(problem.rows[-len(laws[-1].rows) :])
        power = np.bincount(blocks.block_of_rows(), law**2, blocks.count)
        order = np.argsort(-power)
        fold = np.empty(blocks.count, dtype=int)
        there = np.arange(blocks.count) % (2 * blocks.folds)
        fold[order] = np.where(there < blocks.folds, there, 2 * blocks.folds - 1 - there)
        return replace(blocks, fold=fold)

    def residual(self, fit: LawFit, held_out: bool = True) -> Array:
        """Of all rows, unit of u, each by the fit that did not see its block, or by the fit to all; shape (N,)."""
        target = self._target(fit.forward, fit.held)
        laws = [x for law in fit.laws for x in law.rows]
        rows = np.stack([target, *self._beside(fit.forward, fit.held), *laws])
        weights = np.concatenate([np.ones((len(fit.folds) + 1, 1)), -np.vstack([fit.total, fit.folds])], axis=1)
        weights = weights * (-1.0 if fit.forward else 1.0)
        if not held_out:
            return np.asarray(weights[0] @ rows)
        fold = fit.blocks.fold[fit.blocks.block_of_rows()]
        return np.asarray(np.einsum("ni,in->n", weights[1:][fold], rows))

    def delay(self, fit: LawFit) -> float:
        """Steps by which u is late beside a fit."""
        if not self.balance.later:
            return self.balance.delay
        first = int(0 not in fit.held)
        share = float(fit.total[first])
        if fit.forward:  # g (u - share x change)
            share = -share / (float(fit.total[0]) if first else 1.0)
        return self.balance.delay + share

    def nats(self, fit: LawFit) -> float:
        """Squares of whitened rows per nat beside a fit."""
        white = self.balance.white(self.residual(fit, held_out=False))[self.balance.equations.kept]
        counted = float(self.balance.weight @ self.balance.weight)
        return 2.0 * float(white @ white) / max(counted, 1.0) * inflation(white)


def _fitted(laws: tuple[Columns, ...], problem: Problem, blocks: Blocks) -> LawFit:
    """At the strength of the penalty with the least held-out loss."""
    found = grams(problem.rows, blocks)
    rows = np.array([len(problem.rows[0]), *blocks.fitted_rows])
    stack = without_noise(np.concatenate([found.total[None], found.fitted]), problem.noise, rows)
    fits = []
    for strength in STRENGTHS if laws else (0.0,):
        theta = _solved(stack, problem, strength)
        left = losses(theta[1:], found, blocks)
        fits.append(LawFit(laws, left, theta[0], theta[1:], strength, problem.held, blocks))
    return min(fits, key=lambda fit: fit.loss)


def _solved(stack: Array, problem: Problem, strength: float) -> Array:
    """Coefficients of all columns, shape (M, p)."""
    normal, scale = _normal(stack[:, 1:, 1:], problem, strength)
    return np.linalg.solve(normal, (stack[:, 1:, 0] / scale)[..., None])[..., 0] / scale


def _normal(a: Array, problem: Problem, strength: float) -> tuple[Array, Array]:
    """(matrices of scaled columns with the penalty, shape (M, p, p); the scales, (p,))."""
    size = np.sqrt(np.maximum(a[0].diagonal(), 1e-300))
    fixed, usual = problem.fixed, max(float(np.mean(size**2)), 1e-300)
    ridge = np.diag(np.concatenate([np.full(fixed, _RIDGE), np.zeros(a.shape[1] - fixed)]) * size**2)
    if len(problem.penalty):
        information = max(float(np.mean(a[0].diagonal()[fixed:])), _RIDGE * usual)  # a law may act in no row
        bends = float(np.trace(problem.penalty)) / len(problem.penalty)
        if bends > 0.0:  # a formula has none
            ridge[fixed:, fixed:] += strength * information / bends * problem.penalty
        ridge[fixed:, fixed:] += 1e-7 * information * np.eye(len(problem.penalty))
    scale = np.where(np.arange(len(size)) < fixed, size, math.sqrt(usual))
    return (a + ridge) / (scale[:, None] * scale), scale


def standard_error(a: Array, b: Array) -> float:
    """Of the difference of two held-out losses, given by block."""
    apart = a - b
    return float(np.std(apart, ddof=1) * math.sqrt(len(apart))) if len(apart) > 1 else math.inf
