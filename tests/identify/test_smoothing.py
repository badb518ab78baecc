"""Smoothing without phase: exact on cubics, noise taken out by the stated share, encoders recognised."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.smoothing import HALF_WIDTHS, noise_of, smooth
from dsd_cli.signals.encoder import encoder_step

T = 0.001
t = T * np.arange(4000)


def _jittered(seed, share=0.3):
    rng = np.random.default_rng(seed)
    return np.cumsum(T * (1.0 + share * rng.uniform(-1, 1, 4000)))


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4), st.booleans(), st.integers(0, 99))
def test_a_cubic_stays_and_its_slope_is_exact(powers, jitter, seed):
    stamps = _jittered(seed) if jitter else t
    x, slope = np.polyval(powers, stamps), np.polyval(np.polyder(powers), stamps)
    found = smooth(x, stamps)
    inner = slice(30, -30)
    size = max(np.abs(x).max(), 1e-3)
    np.testing.assert_allclose(found.value[inner], x[inner], atol=1e-8 * size)
    np.testing.assert_allclose(found.slope[inner], slope[inner], atol=2e-6 * size / T * 1e-3 + 1e-6 * size)


def test_an_exact_motion_is_left_as_it_is():
    x = np.sin(2 * np.pi * 3.0 * t) + 0.2 * np.abs(np.sin(2 * np.pi * 1.1 * t))
    found = smooth(x, t)
    assert np.abs(found.value - x).max() < 1e-4
    assert found.value_noise < 1e-5


def test_the_noise_that_is_left_is_the_one_that_is_stated():
    """On a signal that no window bends, all of the error is noise."""
    widths = []
    for seed in range(20):
        x = 0.4 * t + 0.01 * np.random.default_rng(seed).normal(size=len(t))
        found = smooth(x, t)
        inner = slice(50, -50)
        widths.append(found.half_width)
        assert np.std((found.value - 0.4 * t)[inner]) == pytest.approx(found.value_noise, rel=0.25)
        assert np.std(found.slope[inner] - 0.4) == pytest.approx(found.slope_noise, rel=0.25)
    assert np.median(widths) == HALF_WIDTHS[-1]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("level", [1e-3, 1e-2])
def test_noise_falls_as_stated_and_the_signal_stays(seed, level):
    rng = np.random.default_rng(seed)
    x = np.sin(2 * np.pi * 1.5 * t) + 0.3 * np.sin(2 * np.pi * 4.0 * t)
    slope = 2 * np.pi * (1.5 * np.cos(2 * np.pi * 1.5 * t) + 1.2 * np.cos(2 * np.pi * 4.0 * t))
    found = smooth(x + level * rng.normal(size=len(t)), t)
    inner = slice(50, -50)
    assert found.half_width >= 8
    error, slope_error = (found.value - x)[inner], (found.slope - slope)[inner]
    taken = np.sqrt(POLICY.smoothing_growth**2 - 1.0) * level  # of the signal, at most: what the noise may hide
    assert 0.7 * found.value_noise < error.std() < 1.1 * np.hypot(found.value_noise, taken)
    assert error.std() < 0.5 * level
    assert 0.7 * found.slope_noise < slope_error.std() < 3.0 * found.slope_noise
    lags = range(-2, 3)  # without phase: the error is least where nothing is moved
    moved = [np.std(np.roll(found.value, k)[inner] - x[inner]) for k in lags]
    assert int(np.argmin(moved)) == 2


def test_noise_of_a_channel_is_that_of_its_high_frequencies():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        x = 5.0 * np.sin(2 * np.pi * 2.0 * t) + 0.01 * rng.normal(size=len(t))
        assert noise_of(x) == pytest.approx(0.01, rel=0.12)
    assert noise_of(np.sin(2 * np.pi * 2.0 * t)) < 1e-8
    assert noise_of(np.zeros(3)) == 0.0


def test_outliers_do_not_raise_the_noise():
    rng = np.random.default_rng(0)
    x = np.sin(2 * np.pi * t) + 0.01 * rng.normal(size=len(t))
    x[rng.integers(0, len(t), 40)] += 5.0
    assert noise_of(x) == pytest.approx(0.01, rel=0.25)


@pytest.mark.parametrize("step", [2 * np.pi / 1000, 2 * np.pi / 2**14, 1e-4, 2e-6, 0.37])
@pytest.mark.parametrize("offset", [0.0, 0.31])
def test_the_step_of_an_encoder_is_found(step, offset):
    motion = 60.0 * step * np.sin(2 * np.pi * 1.3 * t) + 300.0 * step * np.sin(2 * np.pi * 0.2 * t)
    seen = step * (np.round(motion / step + offset) - offset)
    assert encoder_step(seen) == pytest.approx(step, rel=1e-6)
    assert noise_of(seen) == pytest.approx(step / np.sqrt(12.0), rel=1e-6)


def test_the_step_is_found_through_the_rounding_of_printed_numbers():
    step = 2 * np.pi / 20_000
    seen = np.round(step * np.round(0.5 * np.sin(2 * np.pi * t) / step), 7)
    assert encoder_step(seen) == pytest.approx(step, rel=1e-3)


def test_the_step_is_found_where_the_axis_rests_most_of_the_time():
    step = 0.001
    motion = np.where(t < 3.0, 0.0, 0.05 * (t - 3.0) ** 2)
    assert encoder_step(step * np.round(motion / step)) == pytest.approx(step, rel=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(1e-6, 10.0))
def test_continuous_signals_have_no_step(seed, scale):
    rng = np.random.default_rng(seed)
    smooth_one = scale * np.sin(2 * np.pi * rng.uniform(0.3, 9.0) * t + rng.uniform(0, 6))
    assert encoder_step(smooth_one) == 0.0
    assert encoder_step(smooth_one + 0.01 * scale * rng.normal(size=len(t))) == 0.0
    assert encoder_step(scale * np.cumsum(rng.normal(size=len(t)))) == 0.0


def test_a_constant_and_a_short_channel_have_no_step():
    assert encoder_step(np.full(500, 3.3)) == 0.0
    assert encoder_step(np.array([0.0, 1.0, 2.0])) == 0.0


def test_the_speed_of_an_encoder_is_that_of_the_axis():
    step = 2 * np.pi / 2**13
    q = 1.5 * np.sin(2 * np.pi * 0.9 * t)
    speed = 1.5 * 2 * np.pi * 0.9 * np.cos(2 * np.pi * 0.9 * t)
    seen = step * np.round(q / step)
    found = smooth(seen, t)
    raw = np.gradient(seen, t)
    inner = slice(50, -50)
    assert np.std((found.slope - speed)[inner]) < 0.15 * np.std((raw - speed)[inner])
    assert np.abs((found.value - q)[inner]).max() < 1.5 * step


@pytest.mark.parametrize("seed", range(4))
def test_the_slope_is_right_under_jittered_stamps(seed):
    stamps = _jittered(seed, 0.45)
    rng = np.random.default_rng(seed)
    q = np.sin(2 * np.pi * 1.1 * stamps) + 1e-4 * rng.normal(size=len(stamps))
    speed = 2 * np.pi * 1.1 * np.cos(2 * np.pi * 1.1 * stamps)
    found = smooth(q, stamps)
    error = (found.slope - speed)[50:-50]
    assert np.std(error) < 3.0 * found.slope_noise
    assert np.std(error) < 0.01 * np.std(speed)
    as_if_regular = smooth(q, T * np.arange(len(q))).slope[50:-50]
    assert np.std(as_if_regular - speed[50:-50]) > 5.0 * np.std(error)


def test_the_widest_window_fits_into_a_short_channel():
    x = np.random.default_rng(1).normal(size=60)
    found = smooth(x, T * np.arange(60))
    assert found.half_width in HALF_WIDTHS
    assert 2 * found.half_width + 1 <= 15
    assert np.isfinite(found.value).all()
    assert np.isfinite(found.slope).all()
