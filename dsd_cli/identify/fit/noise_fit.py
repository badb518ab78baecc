"""The noise of the rows, measured beside a fit, and how far each row is to be trusted."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dsd_cli.identify.fit.bank import Bank, has_friction
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.freeform import freeform_fits, rich_residual
from dsd_cli.identify.fit.noise import ForceNoise, fitted_noise, passed_variance, whitening
from dsd_cli.identify.fit.row_weights import inflation, weighed
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array


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
    trusting = weighed(solver.fit(fit.terms, fit.tap), solver, plain).solver.bank
    row_weight = trusting.equations.row_weight
    if row_weight is None or float(np.mean(row_weight[equations.kept] == 1.0)) <= POLICY.sure_part:
        return solver, noise  # too few are sure to tell a whole set by: on the XL330 7 %
    return _beside(Bank(trusting.equations, plain, trusting.variance), residual, before)


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

    sure : as much of it as is taken out of the normal equations.
    """
    noises = [r.sensor.sure if sure else r.sensor.noise for r in equations.recordings]
    passed = [passed_variance(*one) for one in zip(equations.whitening, equations.bands, noises, strict=True)]
    if len(passed) == 1:
        return passed[0]
    return float(np.mean(np.array(passed)[equations.logs_of_rows[equations.kept]]))


def _beside(bank: Bank, residual: Array, before: Solver) -> tuple[Solver, Noise]:
    """(solver on the rows of a bank, the noise in those that count)."""
    equations = bank.equations
    white = equations.whitened(residual)[equations.kept]
    counted = float(len(white)) if equations.row_weight is None else equations.counted
    noise = Noise(float(white @ white) / counted, inflation(white), residual)
    return before.on(bank, noise.variance * noise.inflation), noise
