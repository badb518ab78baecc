"""Noise of an encoder's counts is where rounding puts it: beats at round speeds, nothing at rest, white if smeared."""

import math

import numpy as np
import pytest

from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.recordings.sensor import rounding, with_counts
from dsd_cli.identify.recordings.smoothing import regularised
from dsd_cli.identify.recordings.spectrum import bend
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.encoder import exact_step
from dsd_cli.signals.log import Log

T, STEP, SAMPLES = 0.001, 5e-5, 65_536


def _power(x, low, high):
    """Mean power of x between shares of half the sample rate."""
    density = np.abs(np.fft.rfft(x * np.hanning(len(x)))) ** 2 / np.sum(np.hanning(len(x)) ** 2)
    share = np.linspace(0.0, 1.0, len(density))
    return float(np.sum(density[(share >= low) & (share < high)])) * 2.0 / len(x)


def _predicted(counts, low, high, smear=0.0):
    found = rounding([np.cumsum(counts)], smear)
    share = found.angle / np.pi
    return float(np.sum(found.power[(share > low) & (share <= high)])) / len(share) / 12.0


@pytest.mark.parametrize("speed", [12.006, 0.31, 3.4983, 7.3337])
@pytest.mark.parametrize(("low", "high"), [(0.0, 0.03), (0.0, 0.2), (0.2, 0.6), (0.6, 1.0)])
def test_beats_of_a_constant_speed_are_where_rounding_puts_them(speed, low, high):
    """Harmonic k of the saw-tooth, of power 1 / (2 pi^2 k^2), folds to |k n - round(k n)|."""
    k = np.arange(1, 200_000)
    at = 2.0 * np.abs(k * speed - np.round(k * speed))
    true = float(np.sum(((at > low) & (at <= high)) / (2.0 * np.pi**2 * k**2)))
    assert _predicted(np.full(SAMPLES, speed), low, high) == pytest.approx(true, rel=0.1, abs=1e-4)


def test_a_speed_that_sweeps_makes_white_noise_and_a_rest_makes_none():
    sweep = np.linspace(1.0, 40.0, SAMPLES)
    parts = [_predicted(sweep, low, low + 0.1) for low in np.arange(10) / 10.0]
    assert parts == pytest.approx(np.full(10, 0.1 / 12.0), rel=0.1)
    assert np.max(rounding([np.zeros(3000)]).power) < 1e-12


@pytest.mark.parametrize("smear", [0.1, 0.25])
def test_noise_of_the_sensor_smears_the_teeth(smear):
    """Harmonic k has exp(-(2 pi k s)^2) of its power left."""
    k = np.arange(1, 100)
    at = 2.0 * np.abs(k * 12.006 - np.round(k * 12.006))
    left = np.exp(-((2.0 * np.pi * k * smear) ** 2)) / (2.0 * np.pi**2 * k**2)
    lines, lost = float(np.sum(left[at < 0.03])), (1.0 / 12.0 - float(np.sum(left))) * 0.03
    own = 0.03 * smear**2
    assert _predicted(np.full(SAMPLES, 12.006), 0.0, 0.03, smear) == pytest.approx(lines + lost + own, rel=0.1)


def _log(speed, seconds=8.0, step=STEP, noise=0.0, seed=0):
    """To and fro at that speed with smooth turns, m/s, logged in steps of `step`."""
    t = np.arange(0.0, seconds, T)
    way = np.cumsum(speed * np.tanh(8.0 * np.sin(2.0 * np.pi * 0.25 * t))) * T
    read = way + noise * np.random.default_rng(seed).normal(size=len(t))
    return Log(
        {"t": t, "u": np.gradient(np.gradient(way, T), T), "position": step * np.round(read / step)}, T, "log"
    ), way


@pytest.mark.parametrize("speed", [0.6, 0.3, 0.123])
def test_the_noise_in_a_low_band_is_that_of_the_log(speed):
    log, way = _log(speed)
    sensor = prepare(log, ObserverSettings(nominal_inertia=1.0, time_constant=0.01)).sensor.counts
    error = np.diff(log["position"] - way, 2) / T**2
    low, high = 0.004, 0.06
    angle = np.linspace(low, high, 300) * np.pi
    expected = float(np.mean(sensor.density(angle))) * (high - low)
    assert math.sqrt(expected) == pytest.approx(math.sqrt(_power(error, low, high)), rel=0.25)


def test_white_noise_beside_fine_counts_is_read_above_the_motion():
    log, _ = _log(0.02, step=1e-6, noise=2e-5)
    noise = prepare(log, ObserverSettings(nominal_inertia=1.0, time_constant=0.01)).sensor.counts
    assert noise.density(np.array([0.1])) == pytest.approx((2e-5 / T**2) ** 2 * bend(np.array([0.1])) ** 2, rel=0.2)
    made = noise.made(4000, np.random.default_rng(1))  # of the second difference of white noise
    assert np.std(made) == pytest.approx(math.sqrt(6.0) * 2e-5 / T**2, rel=0.1)


def test_the_step_is_known_to_the_digits_that_the_whole_way_shows():
    way = np.round(np.cumsum(np.tanh(np.sin(np.linspace(0.0, 30.0, 9000)))) * 3.0) * (2.0 * math.pi / 8192.0)
    printed = np.round(way, 6)
    assert exact_step([printed[:5000], printed[5000:]]) == pytest.approx(2.0 * math.pi / 8192.0, rel=1e-7)
    assert exact_step([printed + 1e-4 * np.sin(np.arange(9000))]) == 0.0


def test_a_position_between_its_stamps_has_no_counts_any_more():
    log, _ = _log(0.6)
    t = log["t"] + 3e-4 * np.random.default_rng(3).uniform(size=len(log))
    piece = regularised(Log({**log.channels, "t": t}, T, "log"))
    plain = prepare(log, ObserverSettings(nominal_inertia=1.0, time_constant=0.01)).sensor
    assert with_counts(plain, [piece]) is plain


@pytest.mark.parametrize("speed", [0.6005, 0.3004, 0.601])
def test_the_floor_knows_the_beats_of_nearly_round_speeds(speed):
    """It is more than white noise of that step leaves, and no more than the rounding does. It is less, for a
    motion that is read off counts follows slow beats in part."""
    log, way = _log(speed)
    observer = ObserverSettings(nominal_inertia=1.0, time_constant=0.01)
    problem = pose([prepare(log, observer)], PlantModel(1.0, 0.0, {}), Settings())
    white = STEP * np.random.default_rng(5).uniform(-0.5, 0.5, len(way))
    left = [problem.errors.equations.band.rows(np.diff(x, 2) / T**2, 0) for x in (white, log["position"] - way)]
    by_white, by_counts = (math.sqrt(float(np.mean(rows**2))) for rows in left)
    assert by_white < problem.floor < by_counts
