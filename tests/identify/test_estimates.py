"""Errors over a model and its neighbours: what each moves a value by, as likely as it is; copies count once."""

import numpy as np
import pytest

from dsd_cli.identify.fit.priors import averaged
from dsd_cli.identify.results import Estimate

KNOWN = {"inertia": Estimate(1.0, 0.01, "kg m^2"), "viscous_friction.coefficient": Estimate(2.0, 0.02, "u/v")}
SURE = 1e20


def errors(odds, moves, known=KNOWN):
    found, _ = averaged(known, np.array(odds), np.array(moves), 0.001)
    return [e.std_error for e in found.values()]


def test_what_is_surely_there_moves_a_value_by_all_that_it_moves_it():
    assert errors([SURE], [[0.0, 0.3]]) == pytest.approx([0.01, np.hypot(0.02, 0.3)])


def test_even_odds_count_half_of_the_square():
    assert errors([1.0], [[0.0, 0.3]]) == pytest.approx([0.01, np.hypot(0.02, 0.3 / np.sqrt(2.0))])


def test_two_that_do_the_same_count_as_one_and_two_that_do_not_as_two():
    assert errors([SURE, SURE], [[0.0, 0.3], [0.0, 0.3]]) == pytest.approx([0.01, np.hypot(0.02, 0.3)])
    assert errors([SURE, SURE], [[0.2, 0.0], [0.0, 0.3]]) == pytest.approx([np.hypot(0.01, 0.2), np.hypot(0.02, 0.3)])


def test_values_that_move_together_are_correlated():
    found, pairs = averaged(KNOWN, np.array([SURE]), np.array([[0.2, -0.4]]), 0.001)
    assert found["viscous_friction.coefficient"].correlations["inertia"] == pytest.approx(-1.0, abs=0.01)
    assert [names for *names, _ in pairs] == [["inertia", "viscous_friction.coefficient"]]


def test_a_value_that_is_held_stays_so():
    held = {**KNOWN, "inertia": Estimate(1.0, 0.0, "kg m^2", held=True, grade="held")}
    assert errors([SURE], [[0.0, 0.3]], held)[0] == 0.0
