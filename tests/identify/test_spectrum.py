"""Power over frequency: of white noise its variance, and of a sensor's noise what differencing makes of white noise."""

import numpy as np
import pytest
from scipy import signal

from dsd_cli.identify.recordings.spectrum import (
    NOTHING_LOST,
    SEGMENT,
    SensorNoise,
    bend,
    density,
    last_angle,
    lost_motion,
    sensor_noise,
)

ANGLES = np.linspace(0.01, np.pi, 400)
#: How each sensor's white noise of 1 enters an acceleration: the filter's taps, from the definition of the difference.
TAPS = {"position": [1.0, -2.0, 1.0], "velocity": [1.0, -1.0], "d_hat": [1.0 / 0.2, -0.8 / 0.2]}
POLE = 0.8


def _gain(taps, angles):
    """|sum h_k e^(-j w k)|^2 by the sum itself."""
    k = np.arange(len(taps))
    return np.abs(np.exp(-1j * np.outer(angles, k)) @ np.array(taps)) ** 2


def test_white_noise_has_the_density_of_its_variance():
    found = density([1.7 * np.random.default_rng(1).normal(size=200_000)])
    assert found.power.mean() == pytest.approx(1.7**2, rel=0.01)
    assert np.abs(found.power / 1.7**2 - 1.0).max() < 0.6  # each of them, by chance
    low, high = found.power[: len(found.power) // 4], found.power[-len(found.power) // 4 :]
    assert low.mean() == pytest.approx(high.mean(), rel=0.05)


def test_a_mean_has_no_power_and_a_sine_has_it_at_its_angle():
    k = np.arange(40_000)
    found = density([5.0 + 2.0 * np.sin(0.7 * k)])
    top = found.angle[np.argmax(found.power)]
    assert abs(top - 0.7) < 2.0 * np.pi / SEGMENT
    assert found.power.sum() / len(found.power) == pytest.approx(2.0**2 / 2.0, rel=0.02)  # all of the variance
    assert found.power[found.angle > 1.0].max() < 1e-9 * found.power.max()


def test_stretches_are_averaged_without_a_jump_between_them():
    rng = np.random.default_rng(2)
    parts = [rng.normal(size=20_000), 1e6 + rng.normal(size=20_000)]
    assert density(parts).power.mean() == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize("count", [10, 50, 700, 5000])
def test_short_signals_are_cut_into_shorter_segments(count):
    found = density([np.random.default_rng(3).normal(size=count)])
    assert len(found.angle) == len(found.power) <= SEGMENT // 2
    assert 2 * len(found.angle) <= max(2 * count // 7, 8)
    assert np.all((found.angle > 0.0) & (found.angle <= np.pi + 1e-12))
    assert np.all(np.isfinite(found.power))


def test_between_its_angles_a_density_is_interpolated():
    found = density([np.random.default_rng(4).normal(size=3000)])
    middle = 0.5 * (found.angle[3] + found.angle[4])
    assert found.at(np.array([middle]))[0] == pytest.approx(0.5 * (found.power[3] + found.power[4]))


def test_bend_is_the_power_gain_of_a_difference():
    np.testing.assert_allclose(bend(ANGLES), _gain([1.0, -1.0], ANGLES), atol=1e-12)


@pytest.mark.parametrize("kind", TAPS)
def test_noise_of_a_sensor_has_the_spectrum_of_its_differences(kind):
    noise = SensorNoise(kind, POLE, 0.3)
    np.testing.assert_allclose(noise.density(ANGLES), 0.3 * _gain(TAPS[kind], ANGLES), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("kind", TAPS)
def test_noise_that_is_made_has_that_spectrum(kind):
    noise = SensorNoise(kind, POLE, 0.3)
    made = noise.made(400_000, np.random.default_rng(5))
    assert made.shape == (400_000,)
    found = density([made])
    upper = found.angle > 0.3
    ratio = found.power[upper] / (0.3 * _gain(TAPS[kind], found.angle[upper]))
    assert ratio.mean() == pytest.approx(1.0, rel=0.02)
    assert np.var(made) == pytest.approx(0.3 * np.sum(np.square(TAPS[kind])), rel=0.03)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", TAPS)
def test_the_level_is_found_through_a_motion_that_is_far_louder(kind, seed):
    rng = np.random.default_rng(seed)
    k = np.arange(20_000)
    motion = sum(100.0 * np.sin(w * k + rng.uniform(0, 6)) for w in (0.01, 0.05, 0.2))
    white = 0.4 * rng.normal(size=len(k) + 2)
    noise = np.convolve(white, TAPS[kind], mode="valid")[: len(k)]
    found = sensor_noise(kind, [motion[: len(noise)] + noise], POLE)
    assert found.kind == kind
    assert found.scale == pytest.approx(0.4**2, rel=0.1)


def test_one_loud_line_at_high_frequency_does_not_raise_the_level():
    """A resonance is no noise: the median over the upper half does not see it."""
    rng, k = np.random.default_rng(7), np.arange(20_000)
    x = np.diff(rng.normal(size=20_001)) + 30.0 * np.sin(2.2 * k)
    assert sensor_noise("velocity", [x]).scale == pytest.approx(1.0, rel=0.1)


def jumping(seed, rows=20_000, step=0.004):
    """(speed, position) of an axis whose acceleration jumps every 0.3 s or so, exact: one count of time is `step`."""
    rng = np.random.default_rng(seed)
    jumps = np.where(rng.random(rows) < step / 0.3, rng.normal(size=rows), 0.0)
    held = signal.lfilter([1.0], [1.0, -np.exp(-step / 0.5)], jumps)
    speed = np.cumsum(held - held.mean()) * step
    return speed, np.cumsum(speed - speed.mean()) * step


def filtered(x, share, order=4):
    """Both ways, as `scipy.signal.filtfilt` does it; the cut is a share of half the sample rate."""
    return signal.sosfiltfilt(signal.butter(order, share, output="sos"), x)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-3])
def test_motion_and_noise_reach_up_to_the_top(seed, noise):
    _, position = jumping(seed)
    white = noise * np.random.default_rng(seed).normal(size=len(position))
    assert last_angle(density([np.diff(position + white, 2)])) > 0.5 * np.pi


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("share", [0.05, 0.15, 0.4])
def test_what_passed_a_low_pass_ends_about_its_cut(order, share):
    """There at most is the noise that none of it shows: the power of the motion, over that at the band's end."""
    _, position = jumping(4)
    position = position + 1e-6 * np.random.default_rng(5).normal(size=len(position))
    acceleration = np.diff(filtered(position, share, order), 2)[200:-200]
    found = density([acceleration])
    end = last_angle(found)
    assert 0.45 * share < end / np.pi < 1.1 * share
    told = sensor_noise("position", [acceleration]).density(found.angle)
    near = (found.angle > 0.7 * end) & (found.angle < end)
    assert 30.0 < np.median(found.power[near] / told[near]) < 300.0


def lost_of(acceleration, step, ends=0.0):
    """Of a log whose u ends at that angle."""
    return lost_motion([acceleration], step, sensor_noise("position", [acceleration], ends=ends).end)


@pytest.mark.parametrize("share", [0.05, 0.15, 0.4])
def test_the_motion_that_a_low_pass_took_is_known_by_its_size(share):
    speed, position = jumping(6)
    lost = lost_of(np.diff(filtered(position, share), 2)[200:-200] / 0.004**2, 0.004)
    true = np.std((speed - filtered(speed, share))[200:-200])
    assert 0.4 < lost.speed / true < 3.0
    assert 0.4 < lost.reach * share < 1.2  # a quarter of the cut's period, 0.5 / share samples, or some more
    assert lost_of(np.diff(position, 2) / 0.004**2, 0.004) == NOTHING_LOST


@pytest.mark.parametrize("speed", ["sines", "a step", "constant"])
@pytest.mark.parametrize("noisy", [False, True])
def test_a_log_of_exact_values_passed_no_low_pass(speed, noisy):
    """A simulated log has no noise, and a motion of some lines nothing above them: that took nothing from it."""
    t = 0.002 * np.arange(10_000)
    angle = np.outer(t, 2.0 * np.pi * np.array([0.5, 1.1, 1.7]))
    velocity = {"sines": np.cos(angle).sum(1), "a step": np.tanh(5.0 * (t - 10.0)), "constant": np.ones_like(t)}[speed]
    u = 0.1 * velocity + (0.01 * np.random.default_rng(3).normal(size=t.size) if noisy else 0.0)
    acceleration, ends = np.diff(velocity) / 0.002, last_angle(density([u]))
    assert lost_of(acceleration, 0.002, ends) == NOTHING_LOST
