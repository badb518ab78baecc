"""Rows in which friction's direction is sure decide the values; the others count as far as they agree.

Where an axis stops, starts or turns, a sensor tells the direction late or not at all, and dry friction may hold for a
moment that nobody sees. What is left of the balance there is no noise: it leans to one side and, low-passed, reaches
into the neighbouring rows. Rows of that kind are weighed by what they leave, as generalised least squares does with
rows of two variances.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.fit.bank import SHARE, Bank, holds
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array

#: Mean of sgn v from which on the direction is sure; rounds in which the weights are found.
_SURE, _ROUNDS = 0.999, 3


@dataclass(frozen=True)
class Weighed:
    """A fit with every row weighed by how sure it is.

    residual : whitened, of the inverse form, shape (N,). counted : rows with a weight of their own, shape (N,).
    """

    solver: Solver
    fit: Fit
    residual: Array
    counted: NDArray[np.bool_]


def weighed(fit: Fit, solver: Solver, plain: Bank) -> Weighed:
    """The fit of the same effects at the same delay step, with rows where the direction is not sure weighed down.

    Parameters
    ----------
    plain : the bank of the same rows in the unit of u.
    """
    counted = np.ones(len(plain.acceleration), dtype=bool)
    if not holds(fit.terms):
        return Weighed(solver, fit, _residual(fit, solver.bank), counted)
    equations = solver.bank.equations
    counted = equations.kept
    unsure = counted & (uncertain(equations) > POLICY.unsure_share)
    sure = counted & ~unsure
    if sure.sum() < POLICY.few_rows or not unsure.any():
        return Weighed(solver, fit, _residual(fit, solver.bank), counted)
    tap = centred(fit)
    for _ in range(_ROUNDS):
        left = _residual(fit, plain)
        quiet, loud = (float(np.mean(equations.whitened(left * rows)[rows] ** 2)) for rows in (sure, unsure))
        weight = np.sqrt(quiet / (quiet + unsure.sum() * max(loud - quiet, 0.0) + 1e-300))
        trust = np.where(sure, 1.0, np.where(unsure, weight, 0.0))
        bank = Bank(replace(equations, trust=trust), plain, solver.bank.variance * float(np.mean(trust**2)))
        trusting = Solver(bank, solver.blocks, solver.inertia, solver.known, solver.variance)
        fit = trusting.fit(fit.terms, tap)
    return Weighed(trusting, fit, _residual(fit, bank), counted)


def centred(fit: Fit) -> int:
    """The whole-step delay below which, and beyond which, the fitted one may still lie."""
    return max(round(fit.tap + float(fit.total[SHARE])) - 1, 0)


def uncertain(equations: Equations) -> Array:
    """Share of each row's weight on samples in which the axis may rest or turn, shape (N,)."""
    band = replace(equations.band, taps=np.abs(equations.band.taps) / np.abs(equations.band.taps).sum())
    doubts = [
        (s.free == 0.0) | (np.abs(s.sign) < _SURE) | np.isfinite(s.log["turning"]) for s in equations.stretches
    ]
    return np.concatenate([band.rows(doubt.astype(np.float64), equations.startup) for doubt in doubts])


def _residual(fit: Fit, bank: Bank) -> Array:
    rows = bank.design(fit.terms, fit.tap).rows
    return np.asarray(rows[0] - fit.total @ np.stack(rows[1:]))
