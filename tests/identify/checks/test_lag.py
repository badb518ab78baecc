"""By how much an axis follows its reference: as each lag by itself has it, at a cost that lags hardly add to."""

from time import process_time

import numpy as np
import pytest

from dsd_cli.identify.checks.fitted import lag_of

#: An axis follows within this, s.
LONGEST = 0.25


def follower(n: int, T: float, lag: int, start: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Sines, and an axis that is late and off by noise of 1e-4 of them; `start` : rad."""
    rng, t = np.random.default_rng(n + lag), T * np.arange(n)
    wanted = start + np.sin(2.0 * np.pi * 0.7 * t) + 0.4 * np.sin(2.0 * np.pi * 2.3 * t)
    return wanted, np.concatenate([np.full(lag, wanted[0]), wanted[: n - lag]]) + 1e-4 * rng.standard_normal(n)


def error(wanted: np.ndarray, position: np.ndarray, lag: int) -> float:
    """Mean square of what the reference, so many samples later, leaves of the position."""
    return float(np.mean((position[lag:] - wanted[: wanted.size - lag]) ** 2))


@pytest.mark.parametrize("start", [0.0, 1e4])
@pytest.mark.parametrize(("n", "T", "lag"), [(5000, 0.002, 0), (5000, 0.002, 9), (30_001, 1e-4, 340), (401, 0.001, 99)])
def test_the_lag_is_that_of_the_smallest_error(n, T, lag, start):
    both, most = follower(n, T, lag, start), min(n // 4, round(LONGEST / T))
    best = min(range(most + 1), key=lambda k: error(*both, k))
    assert best == pytest.approx(lag, abs=2)
    assert lag_of(*both, most) == best


def test_2501_lags_cost_less_than_1000_by_themselves():
    both = follower(300_000, 1e-4, 120)
    at = process_time()
    lag_of(*both, 2500)
    all_lags, at = process_time() - at, process_time()
    for lag in range(1000):
        error(*both, lag)
    assert all_lags < process_time() - at
