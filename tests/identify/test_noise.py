"""Levels of noise come back from rows, whitening makes them white, and slow physics is not taken for noise."""

import math

import numpy as np
import pytest

from dsd_cli.identify.fit.band import (
    HALF,
    ForceNoise,
    band_of,
    end_of,
    fitted_noise,
    response,
    structured_share,
    white_to_the_end,
    whitening,
)
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.spectrum import SensorNoise

T, J = 0.001, 0.5
BAND = band_of(40.0, T)
KINDS = ("position", "velocity", "d_hat")
SAMPLES = 240_000
#: Sizes of the sensor's noise at which it is as loud in the band as the force's noise of density 1.
LOUD = {"position": 300.0, "velocity": 30.0, "d_hat": 1.0}


def _sensor(kind, louder=1.0):
    return SensorNoise(kind, 0.9, louder * LOUD[kind] ** 2)


def _rows(kind, flat, sensor, seed, samples=SAMPLES):
    """Rows of white force noise of density `flat` and sensor noise times J = sqrt(`sensor`)."""
    rng = np.random.default_rng(seed)
    x = math.sqrt(flat) * rng.normal(size=samples) + math.sqrt(sensor) * _sensor(kind).made(samples, rng)
    return BAND.rows(x, 0)


def _levels(kind, *stretches):
    """Fitted to the stretches of one log."""
    return fitted_noise([(stretches, BAND, _sensor(kind))])


def _correlation(x, lags=20):
    return np.array([x[:-k] @ x[k:] for k in range(1, lags + 1)]) / (x @ x)


def _white(rows, taps):
    return np.convolve(rows, taps, "valid")


# -- levels -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_both_levels_come_back_where_both_are_heard(kind):
    found = [_levels(kind, _rows(kind, 1.0, J**2, seed)) for seed in range(4)]
    assert np.mean([f.flat for f in found]) == pytest.approx(1.0, rel=0.1)
    assert np.mean([f.sensor for f in found]) == pytest.approx(J**2, rel=0.1)


@pytest.mark.parametrize("kind", KINDS)
def test_the_density_comes_back_whichever_of_the_two_is_loud(kind):
    """The sum of both is what is told; alike shapes (d_hat at low frequencies) may share it as they like."""
    angle = np.linspace(0.1, end_of(BAND), 30)
    for flat, sensor in ((1.0, 1e-6), (1e-6, 1.0), (1.0, 1.0)):
        found = _levels(kind, _rows(kind, flat, sensor, 5))
        wanted = (flat + sensor * _sensor(kind).density(angle / BAND.step)) / BAND.step
        loud = wanted > 0.02 * wanted.max()
        np.testing.assert_allclose(found.density(BAND, _sensor(kind), angle)[loud], wanted[loud], rtol=0.2)


def test_levels_grow_with_the_square_and_stretches_are_taken_one_by_one():
    rows = _rows("position", 1.0, J**2, 6)
    one, ten = _levels("position", rows), _levels("position", 10.0 * rows)
    assert ten.flat == pytest.approx(100.0 * one.flat, rel=1e-6)
    assert ten.sensor == pytest.approx(100.0 * one.sensor, rel=1e-6)
    half = len(rows) // 2
    apart = _levels("position", rows[:half], rows[half:] + 1e3)
    assert apart.flat == pytest.approx(one.flat, rel=0.1)


def test_levels_are_of_the_axis_whatever_the_band_of_a_log_or_how_little_one_shows():
    """White force noise of one density passes two bands; in a log that moves a tenth as much there is a hundredth."""
    rng, narrow, quiet = np.random.default_rng(9), band_of(10.0, T), SensorNoise("position", 0.9, 1e-9)
    x, y = rng.normal(size=(2, SAMPLES))
    both = fitted_noise([([BAND.rows(x, 0)], BAND, quiet), ([narrow.rows(y, 0)], narrow, quiet)])
    assert both.flat == pytest.approx(1.0, rel=0.05)
    one, other = BAND.rows(x, 0), BAND.rows(0.1 * y, 0)
    assert fitted_noise([([one], BAND, quiet), ([other], BAND, quiet)]).flat == pytest.approx(0.505, rel=0.05)


# -- whitening --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mix", [(1.0, 1e-9), (1.0, J**2), (1e-3, 1.0)], ids=["force", "both", "sensor"])
def test_noise_becomes_white_within_the_band(kind, mix):
    """Power of each eighth of the band, over what the low-pass takes, is 1: |W|^2 S = 1.

    Where S is below a fifth of its mean the filter, 25 rows long, does not follow it as exactly: see the next test.
    """
    levels = ForceNoise(*mix)
    taps = whitening(levels, BAND, _sensor(kind))
    white = _white(_rows(kind, *mix, 7), taps)
    size = 256
    window = np.hanning(size + 1)[:-1]
    pieces = [white[i : i + size] * window for i in range(0, len(white) - size, size // 2)]
    power = np.mean([np.abs(np.fft.rfft(p)) ** 2 for p in pieces], axis=0) / np.sum(window**2)
    angle = 2 * np.pi * np.arange(size // 2 + 1) / size
    inside = (angle > 0.1) & (angle < end_of(BAND))
    level = power[inside] / BAND.gain(angle[inside]) ** 2
    s = levels.density(BAND, _sensor(kind), angle[inside])
    trusted = s > 0.2 * s.mean()
    parts = np.array([part.mean() for part in np.array_split(level[trusted], 8)])
    np.testing.assert_allclose(parts, 1.0, rtol=0.35)
    assert np.median(parts) == pytest.approx(1.0, rel=0.12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mix", [(1.0, 1e-9), (1.0, J**2), (1e-3, 1.0)], ids=["force", "both", "sensor"])
def test_nowhere_in_the_band_is_a_row_trusted_three_times_too_much(kind, mix):
    levels, angle = ForceNoise(*mix), np.linspace(0.01, end_of(BAND), 200)
    left = response(whitening(levels, BAND, _sensor(kind)), angle) ** 2 * levels.density(BAND, _sensor(kind), angle)
    assert left.max() < 3.0
    assert 0.85 < np.median(left) < 1.15


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_rows_are_less_alike_than_before(kind):
    rows = _rows(kind, 1e-3, 1.0, 8)
    taps = whitening(ForceNoise(1e-3, 1.0), BAND, _sensor(kind))
    assert np.abs(_correlation(_white(rows, taps))).max() < 0.7 * np.abs(_correlation(rows)).max()


def test_whitening_has_no_phase_and_its_response_is_that_of_its_taps():
    taps = whitening(ForceNoise(1.0, 0.3), BAND, _sensor("position"))
    assert len(taps) == 2 * HALF + 1
    np.testing.assert_allclose(taps, taps[::-1], atol=1e-15)
    for angle, found in zip(np.linspace(0, 3, 7), response(taps, np.linspace(0, 3, 7)), strict=True):
        assert found == pytest.approx(sum(t * math.cos(angle * (i - HALF)) for i, t in enumerate(taps)), abs=1e-12)


def test_flat_noise_needs_no_filter():
    taps = whitening(ForceNoise(4.0 * BAND.step, 0.0), BAND, _sensor("position"))
    np.testing.assert_allclose(taps, 0.5 * np.eye(2 * HALF + 1)[HALF], atol=1e-9)


def test_no_row_is_trusted_without_bound_where_the_sensor_is_silent():
    """A second difference has no noise at zero frequency: the response there ends at the policy's share."""
    taps = whitening(ForceNoise(0.0, 1.0), BAND, _sensor("position"))
    angle = BAND.angles(256)
    s = _sensor("position").density(np.minimum(angle, end_of(BAND)) / BAND.step) / BAND.step
    assert response(taps, np.zeros(1))[0] <= 1.05 / math.sqrt(POLICY.flattest * s.mean())


def test_a_slow_sine_on_top_is_not_whitened_away():
    """No part of S falls with frequency, so a sine loses nothing against the noise, whatever levels it has led to."""
    for seed in range(4):
        rows = _rows("position", 1.0, J**2, seed)
        sine = 2.0 * rows.std() * np.sin(0.08 * np.arange(len(rows)))
        taps = whitening(_levels("position", rows + sine), BAND, _sensor("position"))
        assert _white(sine, taps).std() / _white(rows, taps).std() > 0.98 * sine.std() / rows.std()


# -- structure --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_noise_alone_has_no_structure_in_any_of_many_seeds(kind):
    shares = [structured_share([_rows(kind, 1.0, J**2, seed, 60_000)], BAND) for seed in range(30)]
    assert max(shares) < 0.15
    assert np.median(shares) < 0.02


def test_a_random_walk_is_nearly_all_structure():
    for seed in range(10):
        walk = np.cumsum(np.random.default_rng(seed).normal(size=120_000))
        assert structured_share([BAND.rows(walk, 0)], BAND) > 0.9


@pytest.mark.parametrize("power", [0.5, 1.0, 3.0])
def test_the_share_is_that_of_a_sine_of_known_power(power):
    """In the band: a sine of so many times the noise's power there. What stands out but little is not counted."""
    for seed in range(5):
        rows = _rows("position", 1.0, 1e-9, seed)
        in_band = BAND.hz * 2 * T  # power of white noise of density 1 up to the band's end
        sine = math.sqrt(2 * power * in_band) * np.sin(0.4 * np.arange(len(rows)))
        assert structured_share([rows + sine], BAND) == pytest.approx(power / (1 + power), abs=0.12)


def test_scale_does_not_matter_and_nothing_or_too_little_has_no_structure():
    x = _rows("velocity", 1.0, J**2, 4) + 3.0 * np.sin(0.3 * np.arange(len(_rows("velocity", 1.0, J**2, 4))))
    assert structured_share([1e-6 * x], BAND) == pytest.approx(structured_share([x], BAND))
    assert structured_share([np.zeros(5000)], BAND) == 0.0
    assert structured_share([np.cumsum(np.ones(60))], BAND) == 0.0


def test_a_jump_between_two_stretches_is_no_structure():
    rows = _rows("position", 1.0, 1e-9, 5)
    half = len(rows) // 2
    assert structured_share([rows[:half], rows[half:] + 50.0], BAND) < 0.1


# -- noise that u has alone -------------------------------------------------------------------------------------------


def test_what_is_white_in_the_band_is_of_u_where_u_has_it_above_the_band_too():
    rng = np.random.default_rng(31)
    noise, motion = rng.normal(size=SAMPLES), 30.0 * np.sin(2.0 * np.pi * 0.5 * T * np.arange(SAMPLES))
    slow = np.convolve(noise, np.full(100, 0.1), "same")  # to 10 Hz or so, as forces are
    white, coloured = BAND.rows(noise, 0), BAND.rows(slow, 0)
    assert white_to_the_end([white], BAND, [motion + noise])
    assert white_to_the_end([white[:4000], white[4000:]], BAND, [motion + noise])
    folded = noise - np.convolve(rng.normal(size=SAMPLES), [0.5, -0.5], "same")  # twice as loud at the end
    assert white_to_the_end([white], BAND, [motion + folded])
    assert not white_to_the_end([white], BAND, [motion + 0.3 * noise])  # it is not u that has it
    assert not white_to_the_end([0.4 * white], BAND, [noise])  # a law of a u that is white itself leaves what is white
    assert not white_to_the_end([0.4 * white], BAND, [0.02 * motion + noise])
    assert not white_to_the_end([coloured], BAND, [motion + noise])
    assert not white_to_the_end([np.diff(white)], BAND, [motion + noise])  # a sensor's rises
    assert not white_to_the_end([white[:200]], BAND, [motion + noise])  # too few rows for a spectrum
