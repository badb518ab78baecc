"""How much one more effect would explain beside a fit, quickly: by what its columns have that the fit's have not."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from dsd_cli.effects import Role
from dsd_cli.identify.fit.bank import INERTIA, Term, Terms, has_friction, inputs_of, not_negative
from dsd_cli.identify.fit.blocks import total_gram
from dsd_cli.identify.fit.laws_of_u import is_law_of_u
from dsd_cli.identify.fit.solve import Solver
from dsd_cli.signals.log import Array
from dsd_cli.signals.once import once

#: Columns that keep less than this share of their power beside the fit's own add nothing. Ridge of those of size 1.
_LEAST_OWN, _RIDGE = 1e-6, 1e-9


class Scan:
    """The form that is evidence with the columns of some effects at a delay taken out; others are tried beside them.

    An effect on the command changes the drive itself; it is tried at several delays.
    """

    def __init__(self, solver: Solver, terms: Terms, tap: int, taps_for: Callable[[Term, int], Sequence[int]]) -> None:
        self.solver, self.terms, self.tap, self._taps_for = solver, terms, tap, taps_for
        self._inputs, self._held = inputs_of(terms), has_friction(terms)
        self._squares = solver.squares(terms, tap) if solver.known else math.nan
        if solver.known:
            self._left, self._all = _under_rules(solver, terms, tap)
            return
        drive, acceleration, *others = solver.bank.rows(terms, tap)
        target, other = (-drive, acceleration) if solver.inverse else (solver.inertia * acceleration, drive)
        fixed = _basis(others)
        self._effects = _basis(others[1:]) if others[1:] else np.zeros((0, len(drive)))
        self._unexplained = _without(target, self._effects)
        own = _without(other, fixed)
        size = float(np.linalg.norm(own))
        self._all = np.vstack([fixed, own / size]) if size > 0.0 else fixed
        self._left = _without(target, self._all)
        self._squares = float(self._left @ self._left)

    @once
    def gain(self, term: Term, keep: bool = False) -> tuple[float, int]:
        """(by how much the sum of squares falls with that effect beside the others, best delay).

        `keep` columns that had to be made, for they will be asked for again.
        """
        role = term.effect.role
        first = role is Role.FRICTION and not self._held  # with friction, slow stretches count as rest
        # what is known may change more than the columns of the effects that are there
        ruled = self.solver.known and (role in (Role.INPUT, Role.STRUCTURE) or self.solver.known.concerns(term.id))
        taps = dict.fromkeys((self.tap,) if first else (self.tap, *self._taps_for(term, self.tap)))
        if first or ruled or (self.solver.inverse and is_law_of_u(term.effect)):
            return max((self._squares - self.solver.squares((*self.terms, term), n, keep), n) for n in taps)
        if role is not Role.INPUT:
            return self._gain_of_columns(self.solver.bank.columns(term, self.tap, keep, self._held), term), self.tap
        return max((self._gain_of_drive(term, n, keep), n) for n in taps)

    def _gain_of_drive(self, term: Term, tap: int, keep: bool) -> float:
        """The change over a further step of delay goes with the changed drive, and its share is not negative."""
        inputs, bank = (*self._inputs, term), self.solver.bank
        own, further = (bank.drive(inputs, n, keep, self._held) for n in (tap, tap + 1))
        gram, moment, _ = _beside(np.stack([own, own - further]), self._effects, self._unexplained)
        explained = 0.0
        if moment[0] > 0.0 and gram[0, 0] > 0.0:
            explained = float(moment[0]) ** 2 / float(gram[0, 0])
            weights = np.linalg.lstsq(gram, moment, rcond=1e-12)[0]
            if weights[0] > 0.0 > weights[1]:
                explained = max(explained, float(weights @ moment))
        return self._squares - (float(self._unexplained @ self._unexplained) - explained)

    def _gain_of_columns(self, columns: Sequence[Array], term: Term) -> float:
        of_rows = len(columns[0])  # prior equations come behind them, in which a new effect has no part
        rows = columns[0][None] if len(columns) == 1 else np.stack(columns)
        gram, moment, powers = _beside(rows, self._all[:, :of_rows], self._left[:of_rows])
        if not np.all(gram.diagonal() > _LEAST_OWN * powers.diagonal()):
            return 0.0
        if len(columns) == 1:  # nearly all are: without NumPy's calls for one number
            needless = moment[0] > 0.0 and not_negative(term, 1)
            return 0.0 if needless else float(moment[0] ** 2 / gram[0, 0]) / (1.0 + _RIDGE)
        scale = np.sqrt(np.diag(gram))
        theta = np.linalg.solve(gram / np.outer(scale, scale) + _RIDGE * np.eye(len(gram)), moment / scale) / scale
        return float(theta @ moment)


def _under_rules(solver: Solver, terms: Terms, tap: int) -> tuple[Array, Array]:
    """(what the form that is evidence leaves, basis of what may change it), shapes (n,), (k, n): rows, then priors.

    Priors weigh as beside a set that leaves noise: what the effect that is looked for would take is in the residual,
    and priors of that weight bend its shape.
    """
    design = solver.bank.design(terms, tap)
    found = solver.reductions(terms, tap, design, total_gram(design.rows))
    rules = found.inverse if solver.inverse else found.forward
    assert rules is not None
    weight = math.sqrt(solver.variance / rules.variance) if rules.variance > 0.0 else 1.0
    rows = rules.expand.T @ np.concatenate([np.stack(design.rows), weight * rules.priors.T], axis=1)
    acceleration = 1 + INERTIA
    if solver.inverse:
        at, target = 0, -rows[0]
    elif acceleration in rules.left:
        at = rules.left.index(acceleration)
        target = solver.inertia * rows[at]
    else:  # J is held: J0 (a - u/J), with what else is held in u
        at = 0
        target = -solver.inertia / -float(rules.expand[acceleration, 0]) * rows[at]
    others = np.delete(rows, at, axis=0)
    basis = _basis(list(others)) if len(others) else np.zeros((0, rows.shape[1]))
    return _without(target, basis), basis


def _basis(rows: Sequence[Array]) -> Array:
    """Orthonormal rows that span these, shape (k, N)."""
    basis, _ = np.linalg.qr(np.stack(rows).T)
    return np.ascontiguousarray(basis.T)


def _beside(rows: Array, basis: Array, left: Array) -> tuple[Array, Array, Array]:
    """Inner products of what rows, shape (k, N), have beside a basis, with what it leaves, and of the rows."""
    share, powers = rows @ basis.T, rows @ rows.T
    return powers - share @ share.T, rows @ left, powers


def _without(x: Array, basis: Array) -> Array:
    return np.asarray(x - (basis @ x) @ basis)
