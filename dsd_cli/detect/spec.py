"""What a kernel computes: its states, clock and thresholds; the same for the compiled kernel and its NumPy twin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dsd_cli.detect.coloured import Whitening, spectrum, whitening
from dsd_cli.detect.grid import Grid
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.plant.filtering import SETTLED, delay_taps
from dsd_cli.signals.log import Array

#: No label is formed from fewer samples than this, whatever the delays.
LEAST_WARMUP = 16

# what a row of log-likelihoods rests on (`Kernel.run` with `matrix`)
WARMUP, PARTIAL, FULL = 0, 1, 2


def nats_of_fit(window: Any) -> Any:
    """How far below the constant of eq. 15 a state still explains its window; see `KernelSpec.log_likelihood_floor`."""
    return 2.0 * window + 2.0


@dataclass(frozen=True)
class KernelSpec:
    """All that a kernel needs to know.

    Attributes
    ----------
    alphas : Jn / J per inertia, shape (H,).
    aperture : intervals that one value of d_hat averages: 1, or 2 for an observer on position.
    timed : the clock is irregular, every sample comes with its stamp.
    """

    grid: Grid
    settings: DetectorSettings
    alphas: Array
    sample_time: float
    time_constant: float
    sign: float = 1.0
    aperture: int = 1
    timed: bool = False

    @property
    def warmup_rows(self) -> int:
        """Samples before the delay lines are full of measured u, and Q has forgotten what it began with."""
        longest = 0 if self.timed else int(np.ceil(self.warmup_time / self.sample_time - 1e-9))
        return max(LEAST_WARMUP, longest + self.aperture)

    @property
    def warmup_time(self) -> float:
        """max L and the time in which Q settles, s."""
        return max(self.grid.delays) + (SETTLED * self.time_constant if self.settings.observer_filter else 0.0)

    @property
    def pole(self) -> float:
        """p = exp(-T / tau) of Q; 0 without Q."""
        if not self.settings.observer_filter or self.time_constant == 0.0:
            return 0.0
        return float(np.exp(-self.sample_time / self.time_constant))

    @property
    def whitening(self) -> Whitening | None:
        """What makes the noise of the sensor white; None where that is not given."""
        noise = self.settings.sensor_noise
        if not noise:
            return None
        nominal_inertia = float(self.alphas[0]) * self.grid.inertias[0]
        return whitening(self.settings.rho, *spectrum(noise, nominal_inertia, self.sample_time), self.pole)

    def taps(self) -> list[tuple[int, float]]:
        """Per delay: whole samples and the fraction of one."""
        return [delay_taps(delay, self.sample_time) for delay in self.grid.delays]

    @property
    def log_likelihood_constant(self) -> float:
        """log of the factor 1 / (sqrt(2 pi) rho) of eq. 15."""
        return float(-0.5 * np.log(2.0 * np.pi) - np.log(self.settings.rho))

    @property
    def log_likelihood_floor(self) -> float:
        """Below it a state does not explain the data and no label is confident: a window's residual of about 2 rho.

        Of the right state, sum r^2 / rho^2 is chi-squared with M degrees of freedom; 4 M + 4 is far in its tail.
        """
        return self.log_likelihood_constant - nats_of_fit(self.settings.window)
