"""What one plant, believed in, leaves unexplained of d_hat over the detector's window (eq. 13-15, one state)."""

from __future__ import annotations

import itertools
import math

import numpy as np

from dsd_cli.detect.engine import Engine
from dsd_cli.plant.filtering import delay_taps
from dsd_cli.plant.predictor import Believed


class Hindsight:
    """One `step` per sample: the sum of squares that the believed plant leaves over the window, as the engine sums.

    Parameters
    ----------
    engine : whose window, observer and longest delay these are.
    """

    def __init__(self, engine: Engine) -> None:
        spec = engine.spec
        self.window = spec.settings.window
        self._constant, self._rho = spec.log_likelihood_constant, spec.settings.rho
        self._measurement, self._pole = engine.measurement, spec.pole
        self._filtered = spec.settings.observer_filter
        longest = delay_taps(max(engine.grid.delays), engine.measurement.sample_time)[0] + 4
        self._sent = np.zeros(longest)
        self._squares = np.zeros(self.window)
        self._k = 0
        self._w = self._z = 0.0
        self._gain = 0.0
        self._model: Believed | None = None
        self._whole, self._fraction = 0, 0.0

    def believe(self, model: Believed) -> None:
        """From now on; the window is that of the new model once it has passed."""
        self._model = model
        self._gain = self._measurement.nominal_inertia / model.inertia
        self._whole, self._fraction = delay_taps(model.delay, self._measurement.sample_time)
        self._squares[:] = 0.0

    def squares_of(self, log_likelihood: float) -> float:
        """The sum of squares behind a log likelihood of the engine (eq. 15 backwards)."""
        return (self._constant - log_likelihood) * 2.0 * self._rho**2

    def step(self, u: float, d_hat: float) -> float:
        """Sum of squares over the window that ends here; 0 while nothing is believed."""
        lag = 1 if self._filtered else 0
        self._sent[self._k % self._sent.size] = u
        p = self._pole
        self._w = (1.0 - p) * self._mean(lag, 0.0) + p * self._w
        if self._model is not None:
            self._z = (1.0 - p) * self._mean(lag + self._whole, self._fraction) + p * self._z
            left = self._measurement.sign * d_hat + self._w - self._gain * self._z
            self._squares[self._k % self.window] = left * left if math.isfinite(left) else 0.0
        self._k += 1
        return float(self._squares.sum())

    def _mean(self, back: int, fraction: float) -> float:
        """Mean of the command `back` + `fraction` samples ago, over the intervals that one value of d_hat averages."""
        u = [float(self._sent[(self._k - back - i) % self._sent.size]) for i in range(self._measurement.aperture + 1)]
        means = [(1.0 - fraction) * now + fraction * before for now, before in itertools.pairwise(u)]
        return sum(means) / len(means)
