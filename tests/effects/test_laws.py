"""Each law without memory against a formula written out here, with nothing taken from the effect."""

import math

import numpy as np
import pytest

from dsd_cli.effects import Channels, get_effect
from dsd_cli.effects.base import sinc

RNG = np.random.default_rng(3)
T = 1e-3
ROWS = Channels(np.arange(1, 200) * T, *RNG.standard_normal((3, 199)), T)
T_, U, V, Q = (ROWS.t, ROWS.u, ROWS.velocity, ROWS.position)

FORCES = {
    "viscous_friction": ({"coefficient": 0.3}, -0.3 * V),
    "viscous_asymmetry": ({"coefficient": 0.3}, -0.3 * np.where(V > 0, V, -V)),
    "quadratic_drag": ({"coefficient": 0.3}, np.where(V > 0, -0.3 * V**2, 0.3 * V**2)),
    "constant_load": ({"force": -0.3}, np.full(199, -0.3)),
    "gravity": ({"amplitude": 0.3, "phase": 0.4}, -0.3 * np.sin(Q + 0.4)),
    "stiffness": ({"coefficient": 0.3}, -0.3 * Q),
    "cubic_stiffness": ({"coefficient": 0.3}, -0.3 * Q**3),
    "cogging": ({"amplitude": 0.3, "periods": 5.0, "phase": -0.4}, 0.3 * np.sin(5.0 * Q - 0.4)),
    "periodic_disturbance": (
        {"amplitude": 0.3, "frequency": 7.0, "phase": 2.0}, 0.3 * np.sin(2 * math.pi * 7.0 * T_ + 2.0),
    ),
    "coulomb_friction": ({"level": 0.3}, np.full(199, 0.3)),
    "stribeck_friction": ({"excess": 0.3, "velocity": 0.2}, 0.3 * np.exp(-((V / 0.2) ** 2))),
    "load_friction": ({"coefficient": 0.3}, 0.3 * np.abs(U)),
    "gain_droop": ({"droop": 0.3}, np.sign(U) * np.where(np.abs(U) < 1 / 0.6, -0.3 * U**2, 1 / 1.2 - np.abs(U))),
}  # fmt: skip


@pytest.mark.parametrize("name", FORCES)
def test_force_at_an_instant(name):
    values, expected = FORCES[name]
    force, _ = get_effect(name).force(ROWS._replace(interval=0.0), values)
    np.testing.assert_allclose(force, expected, atol=1e-14)


@pytest.mark.parametrize("name", ["cogging", "periodic_disturbance", "external_force"])
def test_mean_over_the_interval_is_that_of_a_fine_grid(name):
    values = {
        "cogging": {"amplitude": 0.3, "periods": 500.0, "phase": 0.2},
        "periodic_disturbance": {"amplitude": 0.3, "frequency": 300.0, "phase": 0.2},
        "external_force": {"events": [{"start": 0.0102, "end": 0.0203, "force": 2.0}]},
    }[name]
    effect, parts = get_effect(name), 2000
    means, _ = effect.force(ROWS, values)
    for k in (3, 9, 10, 19, 20, 60):
        within = (np.arange(parts) + 0.5) / parts * T - 0.5 * T
        fine = Channels(T_[k] + within, U[k], V[k] + 0 * within, Q[k] + V[k] * within, 0.0)
        assert means[k] == pytest.approx(effect.force(fine, values)[0].mean(), abs=2e-3)


@pytest.mark.parametrize(
    ("name", "values", "given", "expected"),
    [
        ("dead_zone", {"width": 0.2}, [-1.0, -0.2, -0.1, 0.0, 0.15, 0.5], [-0.8, 0.0, 0.0, 0.0, 0.0, 0.3]),
        ("saturation", {"limit": 0.4}, [-1.0, -0.4, -0.1, 0.0, 0.15, 0.5], [-0.4, -0.4, -0.1, 0.0, 0.15, 0.4]),
    ],
)
def test_limits_of_the_command(name, values, given, expected):
    missing = np.full(6, np.nan)
    effect = get_effect(name)
    (column,), _ = effect.run(Channels(missing, np.array(given), missing, missing, T), effect.to_columns(values)[1])
    np.testing.assert_allclose(column, expected)


def test_a_bell_that_is_nowhere_in_the_log_is_no_force_at_all():
    """Its column of 1e-150 asked for a size that overflowed, and the command ended."""
    speeds = ROWS._replace(velocity=np.linspace(50.0, 200.0, 199))
    (column,) = get_effect("stribeck_friction").columns(speeds, {"velocity": 7.0})
    assert not column.any()
    (column,) = get_effect("stribeck_friction").columns(speeds, {"velocity": 30.0})
    np.testing.assert_allclose(column, np.exp(-((speeds.velocity / 30.0) ** 2)), atol=1e-15)


def test_a_sine_of_one_sample_is_that_of_many() -> None:
    """A simulation that diverges asks for one of infinity."""
    x = np.array([-2.5, -0.3, 0.0, 1e-9, 0.7])
    assert [float(sinc(float(a))) for a in x] == pytest.approx(sinc(x).tolist(), abs=1e-12)
    with np.errstate(invalid="ignore"):
        assert not np.isfinite(sinc(math.inf))
