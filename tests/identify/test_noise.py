"""The noise is made white, physics at low frequencies is not, and a share of structure is no false alarm."""

import numpy as np
import pytest
from scipy.signal import lfilter

from dsd_cli.identify.fit.noise import ORDER, structured_share, whitening_filter

ROWS, SEEDS, LAGS = 12_000, 30, 20
POLE = np.exp(-0.1)


def _observed(x):
    return lfilter([1.0 - POLE], [1.0, -POLE], x)


def _of_velocity(rng, rows):
    return _observed(np.diff(rng.normal(size=rows + 1)))


def _of_position(rng, rows):
    return _observed(np.diff(rng.normal(size=rows + 2), 2))


def _white(rng, rows):
    return rng.normal(size=rows)


KINDS = {"d_hat": _white, "velocity": _of_velocity, "position": _of_position}


def _correlation(x):
    return np.array([x[:-k] @ x[k:] for k in range(1, LAGS + 1)]) / (x @ x)


def _whitened(x):
    coefficients = whitening_filter([x])
    return np.array([coefficients @ x[k - len(coefficients) + 1 : k + 1][::-1] for k in range(ORDER, len(x))])


@pytest.mark.parametrize("kind", KINDS)
def test_noise_of_every_sensor_becomes_white(kind):
    before, after = [], []
    for seed in range(SEEDS):
        x = KINDS[kind](np.random.default_rng(seed), ROWS)
        before.append(_correlation(x))
        after.append(_correlation(_whitened(x)))
    largest = np.abs(after).max(axis=1)
    assert np.median(largest) < 0.08
    assert largest.max() < 0.16
    assert np.abs(np.mean(after, axis=0)).max() < 0.1  # what remains is chance, not the same lag in every log
    if kind == "position":
        assert np.abs(np.mean(before, axis=0)).max() > 0.3


def test_the_filter_starts_with_one_and_leaves_white_noise_nearly_as_it_is():
    coefficients = whitening_filter([np.random.default_rng(1).normal(size=60_000)])
    assert coefficients[0] == 1.0
    assert np.abs(coefficients[1:]).max() < 0.05


def _power_at(x, frequency):
    return abs(np.exp(-2j * np.pi * frequency * np.arange(len(x))) @ x) / len(x) * 2.0


@pytest.mark.parametrize("kind", KINDS)
def test_a_slow_sine_on_top_is_not_whitened_away(kind):
    """The filter is the one of the noise alone, so the sine keeps its size against the noise."""
    frequency = 0.004
    for seed in range(10):
        noise = KINDS[kind](np.random.default_rng(seed), ROWS)
        sine = 2.0 * noise.std() * np.sin(2 * np.pi * frequency * np.arange(ROWS))
        alone, both = whitening_filter([noise]), whitening_filter([noise + sine])
        gains = [_power_at(lfilter(a, [1.0], sine), frequency) / lfilter(a, [1.0], noise).std() for a in (alone, both)]
        assert gains[1] > 0.7 * gains[0]


def test_a_spectrum_that_falls_is_taken_as_white():
    """An ordinary whitening filter would take a random walk apart into its steps."""
    walk = np.cumsum(np.random.default_rng(2).normal(size=ROWS))
    coefficients = whitening_filter([walk])
    assert np.abs(coefficients[1:]).sum() < 0.3
    assert abs(coefficients.sum()) > 0.7  # the gain at zero frequency


@pytest.mark.parametrize("kind", KINDS)
def test_noise_alone_has_no_structure_in_any_of_many_seeds(kind):
    shares = [structured_share([KINDS[kind](np.random.default_rng(seed), ROWS)]) for seed in range(60)]
    assert max(shares) < 0.25
    assert np.median(shares) < 0.02


def test_a_random_walk_is_all_structure_also_under_noise():
    for seed in range(30):
        rng = np.random.default_rng(seed)
        walk = np.cumsum(rng.normal(size=ROWS))
        assert structured_share([walk]) > 0.95
        assert structured_share([walk / walk.std() + rng.normal(size=ROWS)]) > 0.12


def test_the_share_is_that_of_a_sine_of_known_power():
    """A sine of the noise's own power fills half of the whole (the median over segments moves that a little)."""
    for seed in range(10):
        noise = np.random.default_rng(seed).normal(size=ROWS)
        sine = np.sqrt(2.0) * np.sin(2 * np.pi * 0.012 * np.arange(ROWS))
        assert structured_share([noise + sine]) == pytest.approx(0.5, abs=0.12)


def test_rows_that_were_masked_do_not_count():
    noise = np.random.default_rng(3).normal(size=ROWS)
    masked = noise.copy()
    masked[4000:9000] = 0.0
    assert structured_share([masked]) < 0.35
    np.testing.assert_allclose(whitening_filter([masked]), whitening_filter([noise]), atol=0.15)


def test_scale_does_not_matter_and_nothing_gives_nothing():
    x = _of_velocity(np.random.default_rng(4), ROWS)
    np.testing.assert_allclose(whitening_filter([1e-6 * x]), whitening_filter([x]), rtol=1e-9)
    assert structured_share([1e-6 * x]) == pytest.approx(structured_share([x]))
    np.testing.assert_allclose(lfilter(whitening_filter([np.zeros(ROWS)]), [1.0], x), x, atol=1e-12)
    assert structured_share([np.zeros(ROWS)]) == 0.0


def test_stretches_are_taken_one_by_one():
    """A jump between two stretches is no noise."""
    rng = np.random.default_rng(5)
    parts = [rng.normal(size=6000), rng.normal(size=6000) + 50.0]
    parts[1] -= parts[1].mean()
    assert structured_share(parts) < 0.25


@pytest.mark.parametrize("rows", [10, 200, 255])
def test_too_short_for_a_spectrum_is_left_as_it_is(rows):
    found = whitening_filter([np.random.default_rng(6).normal(size=rows)])
    np.testing.assert_allclose(found, np.eye(len(found))[0], atol=1e-9)
