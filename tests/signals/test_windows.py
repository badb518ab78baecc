"""Running medians and highest values beside those of `scipy.ndimage`."""

import tracemalloc

import numpy as np
import pytest
from scipy.ndimage import maximum_filter1d, median_filter

from dsd_cli.signals.windows import beside, median, smooth_size


@pytest.mark.parametrize("reach", [1, 2, 10])
@pytest.mark.parametrize("rows", [1, 5, 400])
def test_medians_and_highest_values_go_on_at_the_ends(rows: int, reach: int) -> None:
    x = np.random.default_rng(11).standard_normal(rows)
    np.testing.assert_array_equal(median(beside(x, reach)), median_filter(x, 2 * reach + 1, mode="nearest"))
    np.testing.assert_array_equal(beside(x, reach).max(axis=1), maximum_filter1d(x, 2 * reach + 1, mode="nearest"))


def test_medians_of_a_long_log_hold_a_part_of_its_windows_at_a_time() -> None:
    rows = beside(np.arange(1e6), 10)
    tracemalloc.start()
    median(rows)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 0.3 * rows.size * rows.itemsize


def test_a_fast_length_is_the_next_even_one_of_small_primes() -> None:
    for least in (*range(2, 300), 12_345, 99_991):
        size = smooth_size(least)
        rest = size
        for prime in (2, 3, 5):
            while rest % prime == 0:
                rest //= prime
        assert (rest, size % 2) == (1, 0)
        assert least <= size < 1.15 * least + 2
