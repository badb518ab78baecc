"""How much of the noise of its sensor a controller puts into u, and what that may add to a delay."""

import numpy as np
import pytest

from dsd_cli.identify.recordings.sensor import feedback_noise_of, rate

T, J, ROWS = 0.002, 0.01, 4000


def coarse(seed, step=1.5e-3):
    """A position in steps of an encoder that wanders over some rad, and its second difference."""
    rng, t = np.random.default_rng(seed), T * np.arange(ROWS)
    hz, phase = rng.uniform(0.5, 4.0, 4), rng.uniform(0.0, 2.0 * np.pi, 4)
    q = step * np.round(0.3 * np.sin(2.0 * np.pi * np.outer(t, hz) + phase).sum(axis=1) / step)
    return q, np.diff(q, 2, prepend=q[0], append=q[-1]) / T**2


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("kp", "kd"), [(2.0, 0.2), (10.0, 0.5), (8.0, 1.0)])
def test_the_gain_on_the_speed_is_found(seed, kp, kd):
    q, a = coarse(seed)
    u = -kp * q - kd * np.diff(q, prepend=q[0]) / T
    assert rate([feedback_noise_of(u, a, T)], J) == pytest.approx(kd / J, rel=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_a_u_that_does_not_know_the_sensor_does_not_answer_its_noise(seed):
    """What the chance of some sixty segments leaves of an equally loud u is far below what a controller does."""
    rng = np.random.default_rng(100 + seed)
    q, a = coarse(seed)
    speed = np.diff(q, prepend=q[0]) / T
    u = 0.5 * np.std(speed - np.convolve(speed, np.ones(5) / 5.0, "same")) * rng.normal(size=ROWS)
    assert rate([feedback_noise_of(u, a, T)], J) < 0.4 * 0.5 / J


def test_stretches_count_together_however_short():
    q, a = coarse(7)
    u = -0.5 * np.diff(q, prepend=q[0]) / T
    parts = [feedback_noise_of(u[i:j], a[i:j], T) for i, j in ((0, 1500), (1500, 1600), (1600, ROWS))]
    assert rate(parts, J) == pytest.approx(0.5 / J, rel=0.05)


def test_a_sensor_without_noise_returns_none():
    assert rate([feedback_noise_of(np.ones(500), np.zeros(500), T)], J) == 0.0
