"""Ripples over a position that creeps: its speed, and how much of a residual they hold."""

import numpy as np
import pytest

from dsd_cli.identify.fit.drift import ripples

STEP, N = 0.011, 1800
t = STEP * np.arange(N)
PERIODS = np.arange(2.0, 80.0, 0.4)


def wandering(seed):
    """A position that goes to and fro over about 4 rad, irregularly; shape (n,)."""
    rng = np.random.default_rng(seed)
    return 2.0 * np.sin(np.cumsum(rng.uniform(0.5, 3.0, N // 60 + 1).repeat(60)[:N]) * STEP)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("creep", [-0.12, 0.0, 0.05])
def test_a_ripple_and_its_creep_are_found(seed, creep):
    rng = np.random.default_rng(seed)
    place, n = wandering(seed), float(rng.uniform(8.0, 60.0))
    left = np.cos(n * place + rng.uniform(0.0, 6.0)) + 0.3 * rng.normal(size=N)
    shares, speeds = ripples(left, t, place + creep * t, PERIODS, 0.2)
    best = int(np.argmax(shares))
    assert PERIODS[best] == pytest.approx(n, abs=0.4)
    assert speeds[best] == pytest.approx(creep, abs=2.0 * np.pi / (N * STEP) / n + 2.0 * 0.4 / n * 0.2)
    assert 0.6 < shares[best] < 1.1


def test_noise_is_no_ripple():
    """20 seeds of white noise: no ripple holds as much as a fifth of what counts as one."""
    found = [
        ripples(np.random.default_rng(s).normal(size=N), t, wandering(s), PERIODS, 0.2)[0].max() for s in range(20)
    ]
    assert max(found) < 0.03
