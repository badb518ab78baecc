"""White noise is called white, coloured noise is not, and chance is as rare as the bands say."""

import numpy as np
import pytest

from dsd_cli.identify.compare.residuals import residual_tests
from tests.identify.comparison_rig import rng

N, LAGS, SEEDS = 3000, 60, 300


def ar1(x: np.ndarray, pole: float) -> np.ndarray:
    out, y = np.empty_like(x), 0.0
    for k, value in enumerate(x):
        y = pole * y + value
        out[k] = y
    return out


def test_white_noise_is_white_and_ar1_is_not():
    noise = rng(0)
    e, u = noise.normal(size=N), ar1(noise.normal(size=N), 0.9)
    tests = residual_tests([e], [u], 0.001, LAGS)
    assert tests.white
    assert tests.independent_of_u
    assert tests.predictable_share < 0.02
    coloured = residual_tests([ar1(e, 0.8)], [u], 0.001, LAGS)
    assert not coloured.white
    assert coloured.remembers
    assert coloured.predictable_share == pytest.approx(0.64, abs=0.05)
    assert coloured.largest == pytest.approx(0.8, abs=0.05)
    assert coloured.largest_lag == pytest.approx(0.001)


def test_correlations_are_those_of_plain_loops_over_stretches():
    noise = rng(1)
    parts, commands = [[noise.normal(size=n) for n in (40, 70)] for _ in range(2)]
    tests = residual_tests(parts, commands, 1.0, 10)
    everything, everything_u = np.concatenate(parts), np.concatenate(commands)
    for lag in range(11):
        own = with_u = 0.0
        for x, u in zip(parts, commands, strict=True):
            for k in range(lag, len(x)):
                own += (x[k] - everything.mean()) * (x[k - lag] - everything.mean())
                with_u += (x[k] - everything.mean()) * (u[k - lag] - everything_u.mean())
        n = len(everything)
        if lag:
            assert tests.autocorrelation[lag - 1] == pytest.approx(own / (n * everything.var()))
        scale = n * everything.std() * everything_u.std()
        assert tests.correlation_with_u[lag] == pytest.approx(with_u / scale)


def test_an_early_u_is_found_at_its_lag():
    noise = rng(2)
    u = noise.normal(size=N)
    e = 0.5 * np.concatenate([np.zeros(7), u[:-7]]) + noise.normal(size=N)
    tests = residual_tests([e], [u], 0.002, LAGS)
    assert tests.follows_u
    assert tests.largest_lag_with_u == pytest.approx(0.014)
    assert tests.largest_with_u == pytest.approx(0.45, abs=0.05)


@pytest.mark.parametrize("pole_e", [0.0, 0.9])
def test_false_alarms_are_as_rare_as_said(pole_e):
    """Each lag is outside its 99 % band in 1 % of the runs, and the joint tests fail in 1 % (u: at most)."""
    outside = outside_u = alarms = alarms_u = 0
    for seed in range(SEEDS):
        noise = rng(1000 + seed)
        e, u = ar1(noise.normal(size=N), pole_e), ar1(noise.normal(size=N), 0.95)
        tests = residual_tests([e], [u], 0.001, LAGS)
        outside += np.sum(np.abs(tests.autocorrelation) > tests.band)
        outside_u += np.sum(np.abs(tests.correlation_with_u) > tests.band_u)
        alarms += not tests.white
        alarms_u += not tests.independent_of_u
    if pole_e == 0.0:
        assert 0.006 < outside / (SEEDS * LAGS) < 0.013
        assert alarms / SEEDS < 0.03
    else:
        assert alarms == SEEDS
    assert 0.003 < outside_u / (SEEDS * (LAGS + 1)) < 0.018
    assert alarms_u / SEEDS < 0.03


def test_small_is_told_from_large():
    """At many samples a trace of colour is significant; it is not large."""
    tests = residual_tests([ar1(rng(3).normal(size=100_000), 0.05)], [rng(4).normal(size=100_000)], 0.001, 100)
    assert not tests.white
    assert not tests.remembers
    assert tests.predictable_share == pytest.approx(0.0025, abs=0.001)


def test_a_residual_of_zero_is_white():
    tests = residual_tests([np.zeros(200)], [rng(0).normal(size=200)], 0.001, 100)
    assert tests.white
    assert tests.independent_of_u
    assert tests.predictable_share == 0.0


def test_the_largest_correlation_of_noise_is_within_what_is_called_chance():
    """1 % of each is allowed, and four standard errors of the count. The same rule decides "independent of u"."""
    beyond = 0
    for seed in range(SEEDS):
        noise = rng(5000 + seed)
        tests = residual_tests([noise.normal(size=N)], [ar1(noise.normal(size=N), 0.9)], 0.001, LAGS)
        assert (abs(tests.largest_with_u) <= tests.widest_with_u) == tests.independent_of_u
        beyond += abs(tests.largest) > tests.widest or abs(tests.largest_with_u) > tests.widest_with_u
    assert beyond <= 2 * 0.01 * SEEDS + 4.0 * np.sqrt(2 * 0.01 * SEEDS)
