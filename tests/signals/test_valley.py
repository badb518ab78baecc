"""Brent's method from a known start against SciPy's, which stops by the place."""

import math

import pytest
from scipy.optimize import minimize_scalar

from dsd_cli.signals.valley import Point, least_near

VALLEYS = {
    "parabola": lambda x: 1e4 * (x - 0.1) ** 2,
    "bell": lambda x: -1e5 * math.exp(-(((x - 0.15) / 0.5) ** 2)),
    "lopsided": lambda x: math.exp(5.0 * x) - 2.0 * x,
    "corner": lambda x: abs(x - 0.3),
}


def _asked(valley, enough=1e-9, most=40, start=0.0):
    places = []
    found = least_near(lambda x: places.append(x) or valley(x), -0.6, 0.7, Point(start, valley(start)), enough, most)
    return found, places


@pytest.mark.parametrize("name", VALLEYS)
def test_the_least_is_where_scipy_finds_it(name):
    wanted = minimize_scalar(VALLEYS[name], bounds=(-0.6, 0.7), method="bounded", options={"xatol": 1e-10})
    found, _ = _asked(VALLEYS[name])
    assert found.f == pytest.approx(wanted.fun, abs=1e-6)
    assert found.f == VALLEYS[name](found.x)


@pytest.mark.parametrize(("name", "most"), [("parabola", 3), ("bell", 8), ("lopsided", 8)])
def test_a_smooth_valley_takes_few_evaluations(name, most):
    found, places = _asked(VALLEYS[name], enough=1e-6)
    assert len(places) <= most
    wanted = minimize_scalar(VALLEYS[name], bounds=(-0.6, 0.7), method="bounded", options={"xatol": 1e-10})
    assert found.f - wanted.fun <= 2e-6


def test_two_places_may_be_alike():
    step = 0.7 * (3.0 - math.sqrt(5.0)) / 2.0  # the first one, into the wider side
    found, _ = _asked(lambda x: (x - 0.5 * step) ** 2)
    assert found.x == pytest.approx(0.5 * step, abs=1e-5)


def test_from_the_bottom_two_places_show_that_it_is_the_bottom():
    found, places = _asked(lambda x: x * x, enough=1e-3)
    assert found == Point(0.0, 0.0)
    assert len(places) <= 3


def test_no_place_is_asked_for_outside_or_more_often_than_allowed():
    for slope, end in ((1.0, -0.6), (-1.0, 0.7)):
        found, places = _asked(lambda x, slope=slope: slope * x, enough=0.0, most=25)
        assert len(places) == 25
        assert all(-0.6 < x < 0.7 for x in places)
        assert found.x == pytest.approx(end, abs=1e-4)


def test_where_all_is_alike_it_ends():
    _, places = _asked(lambda x: 3.0)
    assert len(places) == 2


@pytest.mark.parametrize(("start", "bottom"), [(-0.6, 0.1), (0.7, 0.1), (0.7, 2.0), (-0.6, -2.0)])
def test_a_start_at_an_end_is_one(start, bottom):
    found, places = _asked(lambda x: (x - bottom) ** 2, start=start)
    assert all(-0.6 < x < 0.7 for x in places)
    assert found.x == pytest.approx(min(max(bottom, -0.6), 0.7), abs=1e-4)
