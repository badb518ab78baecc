"""How large the residual r of the balance is, in the unit of u, within the band, on all rows and on held-out ones; the
noise of the rows, measured beside a fit, and how far each row is to be trusted."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.fit.band import ForceNoise, fitted_noise, passed_variance, white_to_the_end, whitening
from dsd_cli.identify.fit.bank import INERTIA, SHARE, Bank, Term, has_friction
from dsd_cli.identify.fit.blocks import Blocks
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.freeform import freeform_fits, rich_residual
from dsd_cli.identify.fit.laws_of_u import shrinks
from dsd_cli.identify.fit.row_weights import inflation, still_rows, weighed
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.fit.values import Scale, coefficients_of, terms_of, whole_inertia
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import Score
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array
from dsd_cli.signals.once import once
from dsd_cli.signals.passes import mixed


class Errors:
    """Residuals of fits and models; rows in which friction may hold do not count.

    bank : rows in the unit of u. blocks : those on which the fits were held out. holdout : equations of recordings
        that no fit saw, in the same band.
    """

    def __init__(self, bank: Bank, blocks: Blocks, holdout: Equations | None = None) -> None:
        self.bank, self.equations, self.blocks = bank, bank.equations, blocks
        self._aside = Bank(holdout) if holdout is not None else None
        self._keep = self.equations.kept

    @cached_property
    def force(self) -> float:
        """rms of u within the band, unit of u."""
        return _rms(self.bank.command((), 0)[self._keep])

    def moving(self, inertia: float) -> float:
        """rms of u and J a together, unit of u: forces of that size move the axis."""
        return math.hypot(self.force, inertia * self.accelerates)

    @cached_property
    def accelerates(self) -> float:
        """rms of a within the band."""
        return _rms(self.bank.acceleration[self._keep])

    def cancelled(self, fit: Fit, term: Term) -> bool:
        """Whether others of a fit must hold this one: its force, if it is one, is more than u and J a together, rms."""
        rows, at = self.bank.rows(fit.terms, fit.tap), fit.columns_of(term)
        if at.start == at.stop:
            return False
        force = mixed(rows[1 + at.start : 1 + at.stop], fit.total[at])
        return _rms(force[self._keep]) > self.force + whole_inertia(fit) * self.accelerates

    def shaken(self, fit: Fit) -> bool:
        """Whether lines in time move the axis and u is hardly any of J a: a motion that is the sum of a few sines, as
        many a reference is, they explain without any u, and with an inertia as large as they like."""
        lines = any(t.effect.repeats is not None and not t.effect.needs for t in fit.terms)
        return lines and self.force < POLICY.fair_part * self.moving(whole_inertia(fit))

    def residual(self, fit: Fit, held_out: bool = True) -> Array:
        """Of the forward form, each row by the fit that did not see its block, or by the fit to all.

        Shape (N,), 0 in rows that do not count.
        """
        rows, starts, weights = self.bank.rows(fit.terms, fit.tap), np.zeros(1, dtype=np.int_), fit.forward[None]
        if held_out:
            starts, weights = self.blocks.starts[::3], fit.forward_folds[self.blocks.fold]
        left = mixed(rows, weights, starts) * self._keep
        return left / shrinks(self.bank, fit.terms, fit.widths, fit.tap, weights, starts) if fit.inverse else left

    @once
    def white(self, fit: Fit) -> bool:
        """Whether what is left is white in the band, and nearly as strong in u above it."""
        left, bands = self.equations.by_recording(self.residual(fit, held_out=False)), self.equations.bands
        u = ([s.log["u"] for s in self.equations.stretches if s.owner == i] for i in range(len(bands)))
        return all(map(white_to_the_end, left, bands, u))

    @once
    def rmse(self, fit: Fit) -> float:
        """Held-out root mean square of the forward form, unit of u; to compare fits with."""
        return _rms(self.residual(fit)[self._keep])

    @once
    def at_rest(self, fit: Fit) -> float:
        """Root mean square of the same where the axis rests, which nothing but friction or a memory holds there unless
        all forces balance; 0 with either, or without rests."""
        if has_friction(fit.terms) or any(t.effect.memory for t in fit.terms) or not (still := self._still).any():
            return 0.0
        return _rms(mixed(self.bank.rows(fit.terms, fit.tap), fit.forward)[still])

    @cached_property
    def _still(self) -> NDArray[np.bool_]:
        return still_rows(self.equations)

    def of_model(self, model: PlantModel) -> Score:
        """Of a model whose values no fit of these recordings chose."""
        errors, u = left_by(self.bank, model)
        held = errors if self._aside is None else left_by(self._aside, model)[0]
        return _score(errors, _rms(held), u)

    def rows_of_model(self, model: PlantModel) -> Array:
        """r of the rows that count, unit of u, shape (number of `equations.kept`,)."""
        return left_by(self.bank, model)[0]

    def of_fit(self, fit: Fit, scale: Scale) -> Score:
        """Of a fit to everything, with the held-out error of the fits that held a fold out each."""
        model, weightless = scale.model(fit), scale.weightless(fit)
        model = replace(model, inertia=scale.inertia) if weightless else model  # else u is explained by u
        errors, u = left_by(self.bank, model)
        if self._aside is not None:
            return _score(errors, _rms(left_by(self._aside, model)[0]), u)
        rows, theta = self.bank.rows(fit.terms, fit.tap), fit.folds[self.blocks.fold]
        if weightless:
            theta[:, INERTIA] = scale.inertia
        held = rows[0] - mixed(rows[1:], theta, self.blocks.starts[::3])
        return _score(errors, _rms(held[self._keep]), u)


def left_by(bank: Bank, model: PlantModel) -> tuple[Array, Array]:
    """What a model leaves of the balance in the rows that count, r, and u of them; unit of u."""
    terms = terms_of(model)
    tap, theta = coefficients_of(model, terms, bank.tap_time)
    if any("u" in t.effect.needs for t in terms):  # a law of u looks at u as late as the drive is, not at whole steps
        bank = bank.between(float(theta[SHARE]))
    rows, keep = bank.rows(terms, tap), bank.equations.kept
    left = rows[0] - mixed(rows[1:], theta)
    return left[keep], bank.command((), tap, has_friction(terms))[keep]


def _score(errors: Array, held: float, u: Array) -> Score:
    rmse, spread, size = _rms(errors), _rms(u - u.mean()), _rms(u)
    fit = 100.0 * (1.0 - rmse / spread) if spread > 0.0 else math.nan
    return Score(rmse, held, fit, 100.0 * rmse / max(size, 1e-300))


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2))) if x.size else math.nan


@dataclass(frozen=True)
class Noise:
    """variance of a whitened row; inflation: integrated autocorrelation time, rows; rows: of it in the unit of u."""

    variance: float
    inflation: float
    rows: Array | None = field(default=None, compare=False, repr=False)

    @property
    def nats(self) -> float:
        """Squares of whitened rows per nat."""
        return 2.0 * self.variance * self.inflation


def measured(plain: Bank, before: Solver, fit: Fit) -> tuple[Solver, Noise]:
    """(solver on rows whitened by the noise that no function of single channels explains beside a fit, that noise).

    Where the fit has friction, rows in which the direction is not sure are weighed down: what they leave is no evidence
    for anything else, and it leans on the other values.

    plain : bank of the rows in the unit of u. before : the solver that made the fit.
    """
    equations = plain.equations
    fits = freeform_fits(plain, equations, before.blocks, fit, before.inertia)
    residual = rich_residual(fits)
    plain.hats.update(fits.made)  # the noise is measured anew beside the set that is found
    white = equations.with_whitening(*whitening_of(equations, residual))
    bank = Bank(white, plain, sensor_variance(white))
    solver, noise = _beside(bank, residual, before)
    if not has_friction(fit.terms):
        return solver, noise
    found = weighed(solver.fit(fit.terms, fit.tap), solver, plain)
    trusting, row_weight = found.solver.bank, found.solver.bank.equations.row_weight
    if row_weight is None or float(np.mean(row_weight[equations.kept] == 1.0)) <= POLICY.sure_part:
        return solver, noise  # too few are sure to tell a whole set by: on the XL330 7 %
    return _beside(Bank(trusting.equations, plain, trusting.variance), residual, before, found.variance)


def whitening_of(equations: Equations, residual: Array) -> list[Array]:
    """Of each recording the taps that make white what a fit leaves there, shape (N,), unit of u."""
    levels = levels_of(equations, residual)
    pairs = zip(equations.bands, equations.recordings, strict=True)
    return [whitening(levels, band, recording.sensor.noise) for band, recording in pairs]


def levels_of(equations: Equations, residual: Array) -> ForceNoise:
    """Of what a fit leaves of rows, shape (N,), unit of u."""
    sensors = [recording.sensor.noise for recording in equations.recordings]
    return fitted_noise(list(zip(equations.by_recording(residual), equations.bands, sensors, strict=True)))


def sensor_variance(equations: Equations, sure: bool = True) -> float:
    """Variance that the sensors' noise leaves in a row of the acceleration: the mean over rows that count.

    sure : as much of it as is taken out of the normal equations; else all, also what counts add by their beats.
    """
    passed = []
    for taps, band, recording in zip(equations.whitening, equations.bands, equations.recordings, strict=True):
        sensor = recording.sensor
        noises = [sensor.sure] if sure else [noise for noise in (sensor.noise, sensor.counts) if noise is not None]
        passed.append(max(passed_variance(taps, band, noise) for noise in noises))
    if len(passed) == 1:
        return passed[0]
    return float(np.mean(np.array(passed)[equations.logs_of_rows[equations.kept]]))


def _beside(bank: Bank, residual: Array, before: Solver, most: float = math.inf) -> tuple[Solver, Noise]:
    """(solver on the rows of a bank, the noise in those that count). most : that a fit leaves; the noise is no more."""
    equations = bank.equations
    white = equations.whitened(residual)[equations.kept]
    counted = float(len(white)) if equations.row_weight is None else equations.counted
    noise = Noise(min(float(white @ white) / counted, most), inflation(white), residual)
    return before.on(bank, noise.variance * noise.inflation), noise
