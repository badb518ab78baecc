"""Quantiles of Student's t beside tables and `scipy.special`."""

import numpy as np
import pytest
from scipy.special import ndtri, stdtrit

from dsd_cli.signals.student import NORMAL, student_quantile


def test_quantiles_are_those_of_the_tables() -> None:
    tabled = {3.0: 3.182, 10.0: 2.228, 30.0: 2.042, 120.0: 1.980}
    assert student_quantile(np.array([*tabled])) == pytest.approx([*tabled.values()], abs=6e-4)


def test_quantiles_between_whole_numbers_have_all_their_digits() -> None:
    freedom = np.geomspace(3.0, 1e3, 200)
    assert student_quantile(freedom) == pytest.approx(stdtrit(freedom, 0.975), rel=1e-11)
    assert ndtri(0.975) == pytest.approx(NORMAL, rel=1e-14)
    assert student_quantile(np.zeros(0)).shape == (0,)
