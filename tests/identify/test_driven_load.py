"""What is missing beside a load that the model has: a plant of two masses by its matrix exponential."""

import numpy as np
import pytest
from scipy.linalg import expm

from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

T, ROWS, J, SHARE, HERTZ, DAMPING = 0.001, 8000, 25.0, 0.5, 20.0, 0.05
VISCOUS, LOAD, STEP = 25.0, 18.0, 1e-5


def two_masses() -> tuple[np.ndarray, np.ndarray]:
    """(Phi, Gamma) of qm, vm, ql, vl under a force on the motor that is held for T."""
    motor, load = (1.0 - SHARE) * J, SHARE * J
    square = (2.0 * np.pi * HERTZ) ** 2 * (1.0 - SHARE)  # of the load alone, the motor held
    spring, damper = load * square, 2.0 * DAMPING * load * np.sqrt(square)
    between = np.array([[spring, damper, -spring, -damper]])
    rate = np.zeros((5, 5))
    rate[0, 1] = rate[2, 3] = 1.0
    rate[1, :4], rate[3, :4] = -between / motor, between / load
    rate[1, 1] -= VISCOUS / motor
    rate[1, 4] = 1.0 / motor
    found = expm(rate * T)
    return found[:4, :4], found[:4, 4]


def moved() -> Log:
    """A position loop on the motor, which runs to and fro at 0.8 m/s with ramps of 8 m/s2."""
    phi, gamma = two_masses()
    t = np.arange(ROWS) * T
    wanted = np.clip(np.sin(np.pi * t) * 2.5, -0.8, 0.8) * np.minimum(t, 1.0)
    target = np.cumsum(wanted) * T
    state, before = np.zeros(4), 0.0
    u, q = np.zeros(ROWS), np.zeros(ROWS)
    for k in range(ROWS):
        q[k] = np.round(state[0] / STEP) * STEP
        u[k] = 11000.0 * (target[k] - q[k]) + 1100.0 * (wanted[k] - (q[k] - before) / T)
        before = q[k]
        state = phi @ state + gamma * (u[k] + LOAD)
    return Log({"u": u, "position": q}, T, "belt.csv")


@pytest.mark.parametrize("given", [J, 1.1 * J])
def test_what_a_load_of_the_model_has_of_a_missing_force_is_not_lost(given):
    """The load took half of both forces, and half of the error of the inertia."""
    coupling = {"frequency": HERTZ, "load_share": SHARE, "damping": DAMPING}
    model, observer = PlantModel(given, 0.0, {"flexible_coupling": coupling}), ObserverSettings(J, 0.01, 1)
    found = diagnose(
        [prepare(moved(), observer)], model, observer, Settings(("constant_load", "viscous_friction"))
    ).whole_values
    assert found["constant_load.force"].value == pytest.approx(LOAD, rel=0.05)
    assert found["viscous_friction.coefficient"].value == pytest.approx(VISCOUS, rel=0.05)
    assert found["inertia"].value == pytest.approx(J, rel=0.01)
