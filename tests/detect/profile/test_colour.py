"""By how much a residual that lasts counts more than white noise: against plain loops."""

import numpy as np
import pytest

from dsd_cli.detect.profile.colour import Neighbours
from dsd_cli.detect.profile.likelihood import Peak

WINDOW, SIZE, DELAYS = 48, 3, 4


def plain_lasting(residual: np.ndarray) -> float:
    """Variance times (1 + c) / (1 - c), both freed of what two fitted values and a short window take from them."""
    n = len(residual)
    c = sum(residual[i] * residual[i - 1] for i in range(1, n)) / sum(residual**2)
    if c <= 2.0 / np.sqrt(n):
        return 0.0
    c += (1.0 + 3.0 * c) / n
    time = min((1.0 + c) / (1.0 - c), n / 2) if c < 1.0 else n / 2
    return time * sum(residual**2) / n / max(1.0 - 2.0 * time / n, 0.25)


@pytest.mark.parametrize("cut", [1, 7, 60, 400])
def test_lasting_is_that_of_plain_loops_in_any_cut(cut: int) -> None:
    rng = np.random.default_rng(5)
    n = 400
    rows = np.cumsum(rng.normal(size=(n, 1 + DELAYS)), axis=0) * 0.1
    rows[:200, 0] = rng.normal(size=200)  # white, then slow
    lag, alpha = rng.uniform(0.0, DELAYS - 1.0, n), rng.uniform(0.0, 1.0, n)
    one = np.ones(n)
    peak = Peak(lag, alpha, one, one, one)
    expected, last = [], 0.0
    for k in range(n):
        if (k + 1) % SIZE == 0 and k + 1 >= WINDOW:
            at = range(k + 1 - WINDOW, k + 1)
            first = min(int(lag[k]), DELAYS - 2)
            share = lag[k] - first
            last = plain_lasting(
                np.array(
                    [
                        rows[i, 0] - alpha[k] * ((1 - share) * rows[i, 1 + first] + share * rows[i, 2 + first])
                        for i in at
                    ]
                )
            )
        expected.append(last)
    look, found = Neighbours(WINDOW, (DELAYS, 1)), []
    for begin in range(0, n, cut):
        part = slice(begin, begin + cut)
        look.feed(rows[part])
        found.append(look.lasting(Peak(*(column[part] for column in peak)), np.zeros(len(lag[part]), dtype=np.intp)))
    values = np.concatenate(found)
    np.testing.assert_allclose(values[WINDOW:], expected[WINDOW:], rtol=1e-9)
    assert (values[WINDOW:190] == 0.0).any()
    assert (values[250:] > 0.0).all()
