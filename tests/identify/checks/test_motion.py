"""By how much an axis follows its reference: as each lag by itself has it, at a cost that lags hardly add to."""

from time import process_time

import numpy as np
import pytest

from dsd_cli.identify.checks.motion import along_reference
from dsd_cli.identify.checks.stretches import LowPass, Stretch

#: An axis follows within this, s.
LONGEST = 0.25


def follower(n: int, T: float, lag: int, start: float = 0.0) -> Stretch:
    """Sines, and an axis that is late and off by noise of 1e-4 of them; `start` : rad."""
    rng, t = np.random.default_rng(n + lag), T * np.arange(n)
    wanted = start + np.sin(2.0 * np.pi * 0.7 * t) + 0.4 * np.sin(2.0 * np.pi * 2.3 * t)
    position = np.concatenate([np.full(lag, wanted[0]), wanted[: n - lag]]) + 1e-4 * rng.standard_normal(n)
    return Stretch(T, t, None, position, None, None, wanted)


def error(s: Stretch, lag: int) -> float:
    """Mean square of what the reference, so many samples later, leaves of the position."""
    return float(np.mean((s.position[lag:] - s.reference[: s.t.size - lag]) ** 2))


def delayed(s: Stretch, lag: int) -> np.ndarray:
    return np.concatenate([np.full(lag, s.reference[0]), s.reference[: s.t.size - lag]])


@pytest.mark.parametrize("start", [0.0, 1e4])
@pytest.mark.parametrize(("n", "T", "lag"), [(5000, 0.002, 0), (5000, 0.002, 9), (30_001, 1e-4, 340), (401, 0.001, 99)])
def test_the_lag_is_that_of_the_smallest_error(n, T, lag, start):
    s, keep = follower(n, T, lag, start), LowPass(T, 20.0)
    best = min(range(min(n // 4, round(LONGEST / T)) + 1), key=lambda k: error(s, k))
    assert best == pytest.approx(lag, abs=2)
    np.testing.assert_array_equal(along_reference(s, keep).position, keep(delayed(s, best)))


def test_2501_lags_cost_less_than_1000_by_themselves():
    s, keep = follower(300_000, 1e-4, 120), LowPass(1e-4, 20.0)
    along_reference(s, keep)  # the filter's response is kept
    at = process_time()
    along_reference(s, keep)
    all_lags, at = process_time() - at, process_time()
    for lag in range(1000):
        error(s, lag)
    assert all_lags < process_time() - at
