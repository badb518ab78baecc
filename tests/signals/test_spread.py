"""The standard deviation of what is normal but for a few values."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from dsd_cli.signals.spread import robust_deviation


def test_it_is_the_standard_deviation_of_a_normal_law_whatever_a_few_values_do() -> None:
    x = 0.3 * norm.ppf((np.arange(10_001) + 0.5) / 10_001)  # its quantiles: no luck of a seed
    assert abs(robust_deviation(x) - 0.3) < 1e-4
    x[:50] = 1e9
    assert abs(robust_deviation(x) - 0.3) < 3e-3


def test_of_nothing_it_is_none() -> None:
    assert robust_deviation(np.empty(0)) == 0.0
