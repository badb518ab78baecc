"""What is computed between samples, up to an eighth of the sample rate: by sines, whose means are known exactly."""

import numpy as np
import pytest

from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import SHARP, prepare
from dsd_cli.identify.recordings.smoothing import MEAN_OF_SIX, smooth
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from dsd_cli.signals.passes import passed
from tests.oracle import resonator

T, FASTEST = 1e-3, 0.25 * np.pi
INNER = slice(5, -5)


@pytest.mark.parametrize("w", [0.2, 0.5, FASTEST])
def test_the_mean_of_a_fast_sine_is_off_by_less_than_a_thousandth(w: float) -> None:
    """Of a spring beside J a at a resonance 0.5 % was ten times as much of u."""
    k = np.arange(400.0)
    exact = (np.cos(w * k) - np.cos(w * (k + 1.0))) / w
    assert np.abs(passed(np.sin(w * k), MEAN_OF_SIX, 2) - exact)[INNER].max() < 1e-3


@pytest.mark.parametrize("w", [0.2, 0.5, FASTEST])
def test_the_speed_that_forces_go_by_is_that_of_a_fast_motion(w: float) -> None:
    """A difference of two samples is 10 % less at an eighth of their rate. Direction and rest keep it: it is 0 where
    nothing moves, two samples from any stop."""
    k = np.arange(400.0)
    found = smooth(np.sin(w * k), T * k)
    assert found.sharp is not None
    assert np.abs(found.sharp * T / w - np.cos(w * k))[INNER].max() < 2e-3
    (piece,) = prepare(
        Log({"t": T * k, "u": np.cos(k), "position": np.sin(w * k)}, T), ObserverSettings(1.0, 0.01)
    ).pieces
    np.testing.assert_array_equal(piece[SHARP], found.sharp)
    np.testing.assert_array_equal(piece["velocity"], found.slope)


def test_a_speed_that_is_smoothed_is_that_for_forces_too() -> None:
    k = np.arange(4000.0)
    assert smooth(np.sin(0.01 * k) + 1e-3 * np.random.default_rng(1).normal(size=k.size), T * k).sharp is None


@pytest.mark.parametrize("quadratic", [0.0, 0.02, 0.05])
def test_a_spring_that_stiffens_is_no_weight_that_another_spring_holds(quadratic: float) -> None:
    """Over a tenth of a rad A sin(q) with -(A - k) q is k q + A q^3/6, and its phase any small q^2: a weight of 24 and
    a spring of 25 were 98 % sure, for a spring of 1. With q^2 of 0 and 0.3 % of u it holds on 20 of 20 other seeds
    (20-39), with 0.8 %, near the 1 % that counts as any misfit, on 15."""
    swung = resonator.swung(7, held=False, axis=resonator.AXIS._replace(stiffness=1.0, quadratic=quadratic))
    recording = prepare(Log(swung, resonator.T, u_hold="sampled"), ObserverSettings(5e-6, 0.01))
    asked = Settings(("gravity", "stiffness", "cubic_stiffness", "constant_load", "viscous_friction"))
    found = diagnose([recording], PlantModel(5e-6, 0.0, {}), ObserverSettings(5e-6, 0.01), asked)
    assert {"stiffness", "cubic_stiffness", "viscous_friction"} <= {one.effect for one in found.missing}
    assert "gravity" not in {one.effect for one in found.missing}
    values = {name: found.estimates[name].value for name in ("stiffness.coefficient", "cubic_stiffness.coefficient")}
    assert list(values.values()) == pytest.approx([1.0, resonator.AXIS.cubic], rel=0.05)
