"""What rows add of their own beside others, against least squares of NumPy."""

import numpy as np
import pytest

from dsd_cli.identify.fit.blocks import condensed
from dsd_cli.identify.fit.testability import _own


@pytest.mark.parametrize("seed", range(5))
def test_columns_that_are_alike_take_no_more_than_one_of_them(seed):
    """Moved one way, dry friction and a load are one column: the direction that is left over must not take a force."""
    rows = np.random.default_rng(seed).normal(size=(6, 97)) * [[1.0], [1e-3], [1e3], [1.0], [1.0], [1.0]]
    rows[3], rows[4] = rows[2] / 7.0, rows[1] + 3.0 * rows[2]
    left = rows[5] - np.linalg.lstsq(rows[1:5].T, rows[5], rcond=1e-10)[0] @ rows[1:5]
    for few in (rows, condensed(rows)):
        assert _own(few, slice(5, 6), np.ones(1)) == pytest.approx(left @ left, rel=1e-9)
