"""Golden section against SciPy's, which stops by tolerance."""

import math

import pytest
from scipy.optimize import minimize_scalar

from dsd_cli.signals.golden import golden_section


@pytest.mark.parametrize(
    "valley",
    [lambda x: (x - 0.3) ** 2, lambda x: abs(x - 1.7), lambda x: math.exp(x) - 2.0 * x],
    ids=["parabola", "corner", "lopsided"],
)
def test_the_least_is_where_scipy_finds_it(valley):
    wanted = minimize_scalar(valley, bounds=(-3.0, 4.0), method="bounded", options={"xatol": 1e-10}).x
    assert golden_section(valley, -3.0, 4.0, 40) == pytest.approx(wanted, abs=1e-5)


@pytest.mark.parametrize("steps", [0, 1, 7, 30])
def test_every_step_takes_one_evaluation_and_the_golden_part_of_the_bracket(steps):
    asked = []
    found = golden_section(lambda x: asked.append(x) or (x - 0.7) ** 2, 0.0, 1.0, steps)
    assert len(asked) == steps + 2
    assert abs(found - 0.7) <= 0.5 * ((math.sqrt(5.0) - 1.0) / 2.0) ** steps


@pytest.mark.parametrize(("slope", "end"), [(1.0, 0.0), (-1.0, 1.0)])
def test_without_a_valley_it_ends_at_an_edge(slope, end):
    assert golden_section(lambda x: slope * x, 0.0, 1.0, 30) == pytest.approx(end, abs=1e-6)
