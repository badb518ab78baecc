"""Priors, held values and signs that coefficients must have, as linear constraints on a fit.

A residual is w . rows with w = w_0 (1, -theta), so that A theta = b reads b w_0 + A w = 0 in the inverse form and in
the forward one alike. A prior value +- s is one more equation (sigma/s)(b - A theta), sigma the noise of a row.
Values that are no linear function of coefficients (an amplitude, a stiffness) are linearised around the last solution.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dsd_cli.effects import Role
from dsd_cli.identify.fit.bank import FIXED, INERTIA, SHARE, Term, Terms
from dsd_cli.identify.fit.priors import PriorKnowledge, is_shape
from dsd_cli.identify.results import DELAY
from dsd_cli.identify.results import INERTIA as INERTIA_NAME
from dsd_cli.signals.log import Array
from dsd_cli.signals.signed import signed

#: Relative step of numerical slopes, and relative tolerance of a value that is held.
_STEP, _NEAR = 1e-6, 1e-9
#: Slopes below this share of the largest count as 0.
_NO_SLOPE = 1e-12


class Reduction(NamedTuple):
    """Rules as they act on the rows (drive, acceleration, delay, columns).

    expand : weights of all rows are `expand` times those of the rows that are left, shape (p+1, q).
    left : which rows those are. priors : further equations, shape (m, p+1). variance : of a row, against which they
        were weighed.
    """

    expand: Array
    left: tuple[int, ...]
    priors: Array
    variance: float = 0.0


@dataclass(frozen=True)
class Rules:
    """What is known about one selection of effects at one delay.

    variance : of a row, per nat: what an equation with that spread weighs. 0: priors are left out.
    """

    known: PriorKnowledge
    variance: float
    terms: Terms
    widths: tuple[int, ...]
    tap: int
    tap_time: float

    @cached_property
    def names(self) -> list[str]:
        """Values that depend on coefficients, and of which something is known."""
        here = {t.id: t for t in self.terms}
        found = [name for name in (INERTIA_NAME, DELAY) if name in self.known.names]
        for name in self.known.names:
            effect, _, parameter = name.partition(".")
            if parameter and effect in here and here[effect].effect.role is not Role.INPUT:
                term = here[effect]
                if effect not in self.whole and not is_shape(term.effect, parameter, term.shape):
                    found.append(name)
        return found

    @cached_property
    def whole(self) -> dict[str, tuple[float, ...]]:
        """Effect -> its coefficients (per J for a load), where all that its columns carry is held."""
        found = {}
        for term in self.terms:
            held = self.known.events.get(term.id) or self._held_values(term)
            if held is not None:
                found[term.id] = term.effect.to_columns(held, 1.0)[0]
        return found

    def _held_values(self, term: Term) -> dict[str, float] | None:
        if term.effect.role is Role.INPUT or term.effect.listed:
            return None
        own = (p.name for p in term.effect.parameters if not (p.optional and p.numeric))
        names = {name: f"{term.id}.{name}" for name in own}
        free = [p for p, n in names.items() if n not in self.known.fixed]
        if any(not is_shape(term.effect, p, term.shape) for p in free) or len(free) == len(names):
            return None
        return {p: self.known.fixed[n] if n in self.known.fixed else term.shape[p] for p, n in names.items()}

    def value(self, name: str, theta: Array) -> float:
        """A value out of coefficients."""
        inertia = float(theta[INERTIA]) + sum(
            float(theta[self._columns(t)][0]) for t in self.terms if t.effect.role is Role.STRUCTURE
        )
        if name == INERTIA_NAME:
            return inertia
        if name == DELAY:
            return (self.tap + float(theta[SHARE])) * self.tap_time
        effect, _, parameter = name.partition(".")
        term = next(t for t in self.terms if t.id == effect)
        unit = inertia if term.effect.role is Role.STRUCTURE else 1.0
        own = tuple(float(c) / (unit or 1e-300) for c in theta[self._columns(term)])
        return float(term.effect.from_columns(own, term.shape, inertia).get(parameter, 0.0))  # an optional one

    def _columns(self, term: Term) -> slice:
        position = self.terms.index(term)
        at = FIXED + sum(self.widths[:position])
        return slice(at, at + self.widths[position])

    def held(self, theta: Array | None) -> dict[str, float]:
        """What is fixed, and where values beyond their bounds are put."""
        found = {name: self.known.fixed[name] for name in self.names if name in self.known.fixed}
        for name in self.names if theta is not None else ():
            low, high = self.known.limits(name)
            value = self.value(name, theta) if theta is not None else math.nan
            if value < low or value > high:
                found[name] = low if value < low else high
        return found

    def reduction(
        self, theta: Array, held: Mapping[str, float], pressed: Iterable[int] = (), linear_only: bool = False
    ) -> Reduction:
        """The rules around these coefficients; `pressed` : coefficients that are 0, for their sign would be wrong."""
        size = len(theta) + 1
        equalities = [*self._of_whole(size), *(np.eye(size)[1 + k] for k in pressed)]
        priors = []
        for name in self.names:
            prior = self.known.priors.get(name)
            if linear_only and not self._is_linear(name):
                continue
            if name in held:
                equalities.append(self._row(name, held[name], theta))
            elif prior is not None and self.variance > 0.0:
                priors.append(math.sqrt(self.variance) / prior[1] * self._row(name, prior[0], theta))
        return _reduced(equalities, priors, size)._replace(variance=self.variance)

    def _is_linear(self, name: str) -> bool:
        if name in (INERTIA_NAME, DELAY):
            return True
        effect = next(t.effect for t in self.terms if t.id == name.partition(".")[0])
        return effect.split is None and effect.role is not Role.STRUCTURE

    @property
    def linear(self) -> bool:
        """Whether one round is enough."""
        return all(map(self._is_linear, self.names))

    def _row(self, name: str, wanted: float, theta: Array) -> Array:
        """(b, A) of A theta = b, tangent to value(theta) = wanted."""
        slopes = np.zeros(len(theta))
        size = max(float(np.abs(theta).max(initial=0.0)), 1e-12)
        for i in range(len(theta)):
            step = np.zeros(len(theta))
            step[i] = _STEP * max(abs(theta[i]), _STEP * size)
            slopes[i] = (self.value(name, theta + step) - self.value(name, theta - step)) / (2.0 * step[i])
        slopes[np.abs(slopes) < _NO_SLOPE * np.abs(slopes).max(initial=0.0)] = 0.0
        off = wanted - self.value(name, theta)
        if self._turns(name):
            off = math.remainder(off, 2.0 * math.pi)
        return np.concatenate([[off + slopes @ theta], slopes])

    def _turns(self, name: str) -> bool:
        effect, _, parameter = name.partition(".")
        found = [p.unit for t in self.terms if t.id == effect for p in t.effect.parameters if p.name == parameter]
        return found == ["rad"]

    def _of_whole(self, size: int) -> list[Array]:
        """theta_k = c_k, or c_k (theta_0 + loads) for a load."""
        rows = []
        loads = [1 + self._columns(t).start for t in self.terms if t.effect.role is Role.STRUCTURE]
        for term in self.terms:
            for k, c in zip(range(size), self.whole.get(term.id, ()), strict=False):
                row = np.zeros(size)
                if term.effect.role is Role.STRUCTURE:
                    row[[1 + INERTIA, *loads]] -= c
                else:
                    row[0] = c
                row[1 + self._columns(term).start + k] += 1.0
                rows.append(row)
        return rows

    def kept(self, theta: Array, held: Mapping[str, float]) -> bool:
        """Whether the coefficients have what is held."""
        off = (abs(self.value(name, theta) - value) for name, value in held.items())
        size = (max(abs(value), 1e-12) for value in held.values())
        return all(o <= _NEAR * s for o, s in zip(off, size, strict=True))


def _reduced(equalities: Sequence[Array], priors: Sequence[Array], size: int) -> Reduction:
    """Solve each rule b w_0 + A w = 0 for one of its rows, the drive excepted."""
    matrix = np.array(equalities).reshape(-1, size)
    sizes = np.abs(matrix).max(axis=1, initial=0.0)
    pivots: dict[int, int] = {}
    for i in range(len(matrix)):
        usable = np.abs(matrix[i, 1:]) * np.isin(np.arange(1, size), list(pivots), invert=True)
        if not usable.max(initial=0.0) > _NEAR * sizes[i]:
            continue  # depends linearly on earlier rules, or contradicts them
        if usable[1:].max(initial=0.0) > _NEAR * sizes[i]:
            usable[INERTIA] = 0.0  # the forward form stands on the acceleration: it goes last
        pivot = 1 + int(np.argmax(usable))
        matrix[i] /= matrix[i, pivot]
        for j in range(len(matrix)):
            if j != i:
                matrix[j] -= matrix[j, pivot] * matrix[i]
        pivots[pivot] = i
    left = tuple(k for k in range(size) if k not in pivots)
    expand = np.zeros((size, len(left)))
    expand[list(left), range(len(left))] = 1.0
    for pivot, i in pivots.items():
        expand[pivot] = -matrix[i, list(left)]
    return Reduction(expand, left, np.array(priors).reshape(-1, size))


def solved(stack: Array, target: int, signs: Sequence[int], rules: Reduction | None = None) -> tuple[Array, Array]:
    """(coefficients of all rows but the target, shape (M, p), weights of all rows in the residual, shape (M, p+1)).

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
    found = signed(stack, target, signs)
    weights = np.ones((len(stack), len(signs) + 1))
    weights[:, :target], weights[:, target + 1 :] = -found[:, :target], -found[:, target:]
    return found, weights
