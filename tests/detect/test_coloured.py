"""Noise that the observer has differentiated: made white; labels are right where a white rho leaves none sure."""

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

from bench.beyond._runs import State, T, excitation, measured
from bench.beyond.coarse import KNOWN, SMOOTH, cases, score
from dsd_cli.detect import DetectorSettings, Engine, Grid
from dsd_cli.detect.coloured import SensorNoise, spectrum, whitening
from dsd_cli.detect.engine import Measurement

CASES = [
    (0.3, 1.0, 0.0, 0.9),
    (0.3, 0.0, 4.0, 0.9),
    (0.01, 2.0, 300.0, 0.95),
    (0.3, 0.1, 0.1, 0.0),
    (0.02, 0.0, 1e4, 0.95),
]


@pytest.mark.parametrize(("rho", "b", "c", "pole"), CASES)
def test_the_filter_times_the_spectrum_is_white(rho: float, b: float, c: float, pole: float) -> None:
    omega = np.linspace(0.01, np.pi, 500)
    d = 2.0 - 2.0 * np.cos(omega)
    q = (1.0 - pole) / np.abs(1.0 - pole * np.exp(-1j * omega))
    density = rho**2 + q**2 * (b * d + c * d**2)
    found = whitening(rho, b, c, pole)
    _, response = freqz(found.numerator, found.denominator, omega)
    np.testing.assert_allclose(np.abs(response) ** 2 * density, rho**2, rtol=1e-5)
    assert np.abs(np.roots(found.denominator)).max() < 1.0
    assert found.numerator[0] > 0.0


def test_the_noise_of_a_position_comes_out_white() -> None:
    """An observer of a few lines on a noisy position: what W leaves of it is white with standard deviation rho."""
    n, tau, sigma, rho, jn = 200_000, 0.01, 1e-6, 0.02, 1.0
    pole = np.exp(-T / tau)
    rng = np.random.default_rng(0)
    raw = jn * np.diff(sigma * rng.normal(size=n + 2), 2) / T**2
    noise = lfilter([1.0 - pole], [1.0, -pole], raw) + rho * rng.normal(size=n)
    b, c = spectrum(SensorNoise(position=sigma), jn, T)
    found = whitening(rho, b, c, pole)
    white = lfilter(found.numerator, found.denominator, noise)[10_000:]
    assert white.std() == pytest.approx(rho, rel=0.01)
    for lag in (1, 2, 5, 20):
        assert abs(np.corrcoef(white[lag:], white[:-lag])[0, 1]) < 0.01


def test_no_sensor_noise_is_the_same_bits() -> None:
    """A log of white noise: nothing is filtered, the compiled kernel runs as ever."""
    u = excitation(2000, 1)
    d_hat = measured(u, [State(0.004, 1.0)]) + 0.1 * np.random.default_rng(1).normal(size=2000)
    grid, measurement = Grid((0.0, 0.004), (0.5, 1.0, 2.0)), Measurement(T, 1.0, 0.01)
    plain, zero = (
        Engine(grid, DetectorSettings(rho=0.1, **tuning), measurement).run(u, d_hat)
        for tuning in ({}, {"sensor_noise": SensorNoise(0.0, 0.0)})
    )
    for name in ("state", "log_likelihood", "probability", "confident"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(zero, name))


@pytest.mark.parametrize("method", ["dsd", "profile", "imm"])
def test_any_cut_gives_the_same_bits(method: str) -> None:
    u = excitation(900, 2)
    d_hat = measured(u, [State(0.004, 1.0)])
    settings = DetectorSettings(method=method, window=50, rho=0.05, sensor_noise=SensorNoise(0.0005, 1e-7))
    grid, measurement = Grid((0.0, 0.004), (0.5, 1.0, 2.0)), Measurement(T, 1.0, 0.01)
    whole = Engine(grid, settings, measurement).run(u, d_hat)
    engine = Engine(grid, settings, measurement)
    parts = [engine.run(u[a:b], d_hat[a:b]) for a, b in ((0, 7), (7, 300), (300, 301), (301, 900))]
    for name in ("state", "log_likelihood", "confident"):
        np.testing.assert_array_equal(np.concatenate([getattr(part, name) for part in parts]), getattr(whole, name))


@pytest.mark.parametrize("rho", [0.1, 0.5])
def test_of_a_4096_count_encoder_a_white_rho_leaves_nothing_confident(rho: float) -> None:
    assert score(cases(SMOOTH)[:5:2], f"detector.rho={rho}").confident < 0.001


def test_of_a_4096_count_encoder_the_known_spectrum_leaves_right_and_confident_labels() -> None:
    """Nine plants, candidates 40 % and 2 ms apart; 8 s, since the model has to be trusted first."""
    found = score(cases((*SMOOTH, "simulate.duration=8")), "detector.rho=0.02", KNOWN)
    assert found.right > 0.99
    assert found.confident > 0.8
    assert found.right_confident > 0.999
