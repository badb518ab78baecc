"""Rows in which friction's direction is sure decide the values; the others count as far as they agree, weighed by what
they leave, as generalised least squares does with rows of two variances."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsd_cli.effects import Role
from dsd_cli.identify.fit.bank import SHARE, Bank, Terms, has_friction
from dsd_cli.identify.fit.covariance import Information, converged, information
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.fit.stretches import slow_spells
from dsd_cli.identify.fit.values import MOST_SHARE
from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array
from dsd_cli.signals.once import once
from dsd_cli.signals.passes import mixed
from dsd_cli.signals.runs import runs

#: Rounds in which the weights are found, and the delay.
_ROUNDS, _DELAYS = 3, 4
#: Least share of a step of delay beyond the whole steps, and the change of that share that ends the rounds.
_CLEAR, _SETTLED = 0.25, 0.01


@dataclass(frozen=True)
class Weighed:
    """A fit with every row weighed by how sure it is.

    residual : whitened, of the inverse form, shape (N,). rows : how many whole rows count, by their weights.
    leaning : too few are sure to identify the values, so that all count: what is left leans to one side in all.
    """

    solver: Solver
    fit: Fit
    residual: Array
    rows: float
    leaning: bool = False

    @property
    def variance(self) -> float:
        """Of a whitened row."""
        return self.variance_of(self.residual) / max(1.0 - len(self.fit.total) / self.rows, 0.1)

    def variance_of(self, white: Array) -> float:
        """Mean square of whitened rows, shape (N,), over those that count."""
        return float(white @ white) / self.rows


def weighed(fit: Fit, solver: Solver, plain: Bank) -> Weighed:
    """The fit of the same effects, with rows where the direction is not sure weighed down; rows of one stop, start or
    turn lean together, and count as one of that size.

    plain : the bank of the same rows in the unit of u.
    """
    white = solver.bank
    fit, solver = _exact(fit, solver)
    equations = solver.bank.equations
    if equations.row_weight is not None:
        return Weighed(solver, fit, residual_of_u(fit, solver.bank), equations.counted)
    counted = equations.kept if has_friction(fit.terms) else np.ones(len(plain.acceleration), dtype=bool)
    sure = counted & sure_rows(fit.terms, equations, POLICY.unsure_share)
    sure &= uncertain(equations) <= _harmless(fit, solver.bank, sure)
    unsure = counted & ~sure
    least = POLICY.rows_per_value * (len(fit.total) + sum(t.effect.searched for t in fit.terms))
    if sure.sum() < least or not unsure.any():
        return Weighed(solver, fit, residual_of_u(fit, solver.bank), float(counted.sum()), bool(unsure.any()))
    run = np.cumsum(np.concatenate([np.diff(x, prepend=~x[:1]) for x in equations.by_stretch(unsure)]))
    together = np.bincount(run)[run]  # rows that the stop, or the move, has that each row is in
    for _ in range(_ROUNDS):
        left = residual_of_u(fit, solver.bank) ** 2
        quiet, loud = float(np.mean(left[sure])), float(np.mean(left[unsure]))
        weight = np.sqrt(quiet / (quiet + together * max(loud - quiet, 0.0) + 1e-300))
        row_weight = np.where(sure, 1.0, np.where(unsure, weight, 0.0))
        size = float(row_weight @ row_weight)
        bank = white.weighing(row_weight, white.variance * size / len(row_weight))
        nats = min(quiet, solver.variance)
        trusting = solver.on(bank, nats)
        fit, trusting = _exact(trusting.fit(fit.terms, fit.tap, fit.whole_steps), trusting)
        bank = trusting.bank
    return Weighed(trusting, fit, residual_of_u(fit, bank), size)


def at_least_squares(found: Weighed, as_found: bool = False) -> tuple[Weighed, Information]:
    """With the shapes where these rows have them, or `as_found`, and what they say there."""
    if as_found:
        return found, information(found.fit, found.solver)
    fit, known = converged(found.fit, found.solver)
    residual = found.residual if fit is found.fit else residual_of_u(fit, found.solver.bank)
    return replace(found, fit=fit, residual=residual), known


def inflation(white: Array, most: int = POLICY.correlated_rows) -> float:
    """Integrated autocorrelation time: 1 + 2 sum of the autocorrelation over `most` lags at most, rows."""
    correlation = autocorrelation(white, most)
    return float(max(1.0, 1.0 + 2.0 * np.sum(correlation[1:])))


def shared_inflation(noise: Array, column: Array) -> float:
    """Variance of the coefficient of a column in this noise, over that in white noise of its size."""
    found = [autocorrelation(x, POLICY.correlated_rows) for x in (noise, column)]
    taper = 1.0 - np.arange(len(found[0])) / max(len(found[0]), 1)
    return float(1.0 + 2.0 * np.sum((taper * found[0] * found[1])[1:]))


def unpredicted_share(x: Array) -> float:
    """Share of the variance that no linear function of the last `POLICY.gap_rows` rows predicts."""
    return linear_prediction(autocorrelation(x, POLICY.gap_rows + 1))[1]


def linear_prediction(correlation: Array) -> tuple[Array, float]:
    """Of rows with that autocorrelation at the lags 0 to p, 1 at 0: the coefficients on the last p rows, the latest
    first, shape (p,), and the share of the variance that they leave (Yule and Walker's equations, solved by Durbin)."""
    share, past = 1.0, np.zeros(0)
    for k in range(1, len(correlation)):
        partial = (correlation[k] - past @ correlation[k - 1 : 0 : -1]) / share
        past = np.append(past - partial * past[::-1], partial)
        share *= 1.0 - partial**2
    return past, float(share)


def autocorrelation(x: Array, most: int) -> Array:
    """At lags from 0 on, `most` and a quarter of the rows at most."""
    n = len(x)
    products = np.array([np.dot(x[: n - k], x[k:]) for k in range(min(most, n // 4))])
    return products / max(float(products[0]), 1e-300) if len(products) else products


def _exact(fit: Fit, solver: Solver) -> tuple[Fit, Solver]:
    """The same with the drive at the fitted delay itself: a mix of two whole steps is low-passed.

    The share beyond the whole steps stays clear of 0 and of where it ends: there it would hold the other values.
    """
    bank = solver.bank
    for _ in range(0 if fit.whole_steps else _DELAYS):
        delay = fit.tap + min(float(fit.total[SHARE]), MOST_SHARE)  # u is no straight line over more
        tap = max(math.floor(delay - _CLEAR), 0)
        most = max(bank.equations.startup // bank.delay_step - 2, 0)  # every row has its drive, and that of the next
        tap = tap if tap in solver.taps(most) else fit.tap
        around = min(max(delay - tap, 0.0), MOST_SHARE)
        solver = solver.on(bank.between(around), solver.variance)
        fit = solver.fit(fit.terms, tap)
        if abs(float(fit.total[SHARE]) - around) < _SETTLED and around > 0.0:
            break
    return fit, solver


def _harmless(fit: Fit, bank: Bank, sure: NDArray[np.bool_]) -> float:
    """Share of a row that may be unsure, for friction to lean by no more than a small part of the row's noise."""
    if not sure.any():
        return 0.0
    rows, friction = bank.rows(fit.terms, fit.tap), np.zeros(len(bank.acceleration))
    for term in fit.terms:
        if term.effect.role is Role.FRICTION:
            at = fit.columns_of(term)
            friction += mixed(rows[1 + at.start : 1 + at.stop], fit.total[at])
    size, noise = (float(np.mean(x[sure] ** 2)) for x in (friction, residual_of_u(fit, bank)))
    return POLICY.harmless_lean * math.sqrt(noise / max(size, 1e-300))


def sure_rows(terms: Terms, equations: Equations, most: float) -> NDArray[np.bool_]:
    """Rows at most so `uncertain`, shape (N,): friction's direction is sure there; all where there is no friction."""
    if not has_friction(terms):
        return np.ones(sum(equations.lengths), dtype=bool)
    return np.asarray(uncertain(equations) <= most)


def many_sure(equations: Equations, nearly: bool = False) -> NDArray[np.bool_] | None:
    """Rows that count in which the direction is sure, shape (N,); None where they are a small part of those.

    nearly : then rows, too, in which the axis may rest or turn for a small part of their weight. What is left there is
        too much if anything: they can show that a model leaves no more than noise, no more.
    """
    kept, share = equations.kept, uncertain(equations)
    found = (kept & (share <= most) for most in (POLICY.unsure_share, POLICY.unsure_push)[: 1 + nearly])
    return next((rows for rows in found if rows.sum() > POLICY.sure_part * kept.sum()), None)


def surely_less(was: Array, now: Array) -> bool:
    """Whether what is left of the same rows, shape (N,) each, is less now by as much as a certain value takes off."""
    fall = float(was @ was - now @ now) / max(float(np.mean(now**2)) * inflation(now), 1e-300)
    return fall > POLICY.value_deviations**2


@once
def uncertain(equations: Equations, creeping: bool = True, resting: bool = True) -> Array:
    """Share of each whitened row's weight on samples in which the axis may rest (`resting`) or turn, shape (N,).

    The halo of the smoothing that made the speed is in doubt, too, where it is no wider than a row. So is friction, if
    `creeping` is, where the axis creeps for a row or longer, of whatever sensor: before it breaks away, friction is
    what holds it, anything between its levels to either side. A turn only passes through such speeds.
    """
    doubts = []
    for s, band in zip(equations.stretches, equations.bands_of_stretches, strict=True):
        doubt, a_row = ~s.surely_sliding, 2 * band.step + 1
        if creeping:
            doubt |= slow_spells(s.log["velocity"], POLICY.presliding_share, a_row)
        doubt &= resting | (s.free > 0.0)
        halo = np.isfinite(s.log["turning"])
        if min((end - start for start, end in runs(halo)), default=0) <= a_row:
            doubt |= halo
        doubts.append(doubt)
    return _weight_on(equations, doubts)


def still_rows(equations: Equations) -> NDArray[np.bool_]:
    """Rows, shape (N,), all through which the axis rests."""
    return np.asarray(_weight_on(equations, [s.free > 0.0 for s in equations.stretches]) <= POLICY.unsure_share)


def _weight_on(equations: Equations, samples: Sequence[NDArray[np.bool_]]) -> Array:
    """Share of each whitened row's weight on some samples of every stretch, shape (N,)."""
    shares = []
    for x, owner, begin in zip(samples, equations.owners, equations.begins, strict=True):
        band, white = equations.bands[owner], np.abs(equations.whitening[owner])
        taps, reach = np.abs(band.taps), len(white) // 2
        rows = replace(band, taps=taps / taps.sum()).rows(x.astype(np.float64), begin)
        shares.append(np.convolve(np.pad(rows, reach, mode="edge"), white / white.sum(), mode="valid"))
    return np.concatenate(shares)


def residual_of_u(fit: Fit, bank: Bank) -> Array:
    """What a fit of u by the motion leaves of each row, shape (N,)."""
    rows = bank.rows(fit.terms, fit.tap)
    return np.asarray(rows[0] - mixed(rows[1:], fit.total))
