"""A controller's answer to one count of its encoder, heard in a log in which it does other things, too."""

import math

import numpy as np
import pytest

from dsd_cli.signals.answers import largest_answer


@pytest.mark.parametrize("pace", [0.02, 0.2, 3.0], ids=["creep", "slow", "fast"])
@pytest.mark.parametrize("kick", [0.0, 2000.0], ids=["smooth", "kicked"])
def test_the_largest_answer_to_a_count_is_that_of_the_gains(pace: float, kick: float) -> None:
    """P, and D through a filter of 5 ms, at 1 kHz: the first sample after a count has kp + kd (1 - keep) / T of it."""
    step, kp, kd, keep = 1e-3, 0.1, 0.02, math.exp(-1.0 / 5.0)
    t = step * np.arange(8000)
    counts = np.round(40.0 * (1.0 + np.sin(2.0 * np.pi * 0.25 * t)) * pace)
    speed, filtered = np.diff(counts, prepend=counts[0]) / step, np.zeros(len(t))
    for k in range(1, len(t)):
        filtered[k] = keep * filtered[k - 1] + (1.0 - keep) * speed[k]
    u = 30.0 * np.sin(2.0 * np.pi * 0.25 * t) - kp * counts - kd * filtered + kick * (np.arange(len(t)) % 500 < 40)
    assert largest_answer(u, counts) == pytest.approx(kp + kd * (1.0 - keep) / step, rel=0.05)
