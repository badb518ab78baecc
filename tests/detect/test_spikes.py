"""The smallest spike of u that decides, beside responses of every state to one value of u, stepped in a plain loop."""

import math

import numpy as np
import pytest

from dsd_cli.detect import DetectorSettings, Engine, Grid
from dsd_cli.detect.engine import Measurement
from dsd_cli.detect.spikes import energies_of_one, smallest_that_decides

SAMPLES, T = 4000, 0.001


def response(delay: float, inertia: float, tau: float, logged: bool) -> np.ndarray:
    """What u = 1 in the first sample leaves of d_hat if it never reached the plant of that state."""
    u = np.zeros(SAMPLES)
    u[0] = 1.0
    late = round(delay / T)
    pole = math.exp(-T / tau)
    own, shown = np.zeros(SAMPLES), np.zeros(SAMPLES)
    for k in range(1, SAMPLES):
        own[k] = pole * own[k - 1] + (1.0 - pole) * (u[k - 1 - late] if k > late else 0.0)
        shown[k] = pole * shown[k - 1] + (1.0 - pole) * u[k - 1]
    return own / inertia - (shown if logged else 0.0)  # Jn = 1


@pytest.mark.parametrize("logged", [True, False])
@pytest.mark.parametrize("tau", [0.002, 0.01])
def test_it_gives_the_least_response_a_lead_of_confidence_over_the_largest(logged: bool, tau: float) -> None:
    grid = Grid(delays=(0.0, 0.004, 0.3), inertias=(0.5, 1.0, 2.0))
    settings = DetectorSettings(window=1000, rho=0.3, confidence=3.0)
    spec = Engine(grid, settings, Measurement(sample_time=T, nominal_inertia=1.0, time_constant=tau)).spec
    energies = [
        float(np.sum(response(delay, inertia, tau, logged) ** 2)) for delay in grid.delays for inertia in grid.inertias
    ]
    assert energies_of_one(spec, logged) == pytest.approx(energies, rel=1e-6, abs=1e-12)
    size = smallest_that_decides(spec, energies_of_one(spec, logged))
    lead = size**2 * (max(energies) - min(energies)) / (2.0 * settings.rho**2)
    assert lead == pytest.approx(settings.confidence, rel=1e-6)
