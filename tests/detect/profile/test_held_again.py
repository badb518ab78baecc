"""Where a flag is taken away, the estimate goes with it: the one before stays."""

import numpy as np

from dsd_cli.detect import Grid
from dsd_cli.detect.engine import Labels
from dsd_cli.detect.profile.cells import Estimates
from dsd_cli.detect.rows import held_again, without_confidence


def test_an_estimate_whose_flag_is_taken_away_is_the_one_before() -> None:
    n = 6
    value = np.arange(1.0, n + 1.0)
    sure = np.ones(n, dtype=bool)
    estimates = Estimates(value, value / 10, value * 2, value / 5, sure, sure & (value != 2))
    labels = Labels(Grid((0.0,), (1.0,)), np.zeros(n, dtype=np.int32), value, value, sure, estimates)
    doubtful = np.array([True, False, True, True, False, True])
    held = held_again(without_confidence(labels, doubtful), (0.5, 0.05, 0.7, 0.07)).estimates
    np.testing.assert_array_equal(held.delay, [0.5, 2, 2, 2, 5, 5])
    np.testing.assert_array_equal(held.delay_std, [0.05, 0.2, 0.2, 0.2, 0.5, 0.5])
    np.testing.assert_array_equal(held.inertia, [0.7, 0.7, 0.7, 0.7, 10, 10])
    np.testing.assert_array_equal(held.inertia_std, [0.07, 0.07, 0.07, 0.07, 1.0, 1.0])
    np.testing.assert_array_equal(held.delay_confident, ~doubtful)
