"""Shape parameters: searched to where a fine grid has its least squares, and within the limits of their starts."""

import math

import numpy as np
import pytest

from dsd_cli.effects import Role
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.search.shapes import BRACKET, SHRINK_ALONE, _limits, refined
from tests.identify.search_rig import posed

HIDDEN = {
    "stribeck_friction": ({"excess": 0.15, "velocity": 1.2}, {"velocity": 1.2}),
    "presliding_friction": ({"level": 0.15, "stiffness": 3.0}, {"distance": 0.05}),
    "cogging": ({"amplitude": 0.1, "periods": 12.0, "phase": 0.5}, {"periods": 12.0}),
    "periodic_disturbance": ({"amplitude": 0.1, "frequency": 4.4, "phase": 0.5}, {"frequency": 4.4}),
    "actuator_lag": ({"time_constant": 0.006}, {"time_constant": 0.006}),
    "dead_zone": ({"width": 0.05}, {"width": 0.05}),
}
OFF = {"cogging": 1.01, "periodic_disturbance": 1.005}
#: A lag and a delay trade with each other, and delays are tried in whole steps.
NEAR = {"actuator_lag": 0.15}


@pytest.fixture(scope="module", params=HIDDEN)
def searched(request):
    values, shape = HIDDEN[request.param]
    return posed({request.param: values}, (), duration=8.0), request.param, shape


def test_the_search_ends_at_the_least_squares_of_a_fine_grid(searched):
    search, name, shape = searched
    key, true = next(iter(shape.items()))
    tap = search.fit((Term.of(name, shape),), search.refit.tap).tap  # without the effect the delay is another one
    start = Term.of(name, {key: OFF.get(name, 1.35) * true})
    terms, found_tap = refined(search, (start,), 0, tap)
    squares = search.solver.squares(terms, found_tap)
    grid = true * np.linspace(0.8, 1.25, 46)
    late = start.effect.role is Role.INPUT
    taps = range(max(tap - 5, 0), tap + 2) if late else [tap]  # others keep the delay
    best = min(search.solver.squares((Term.of(name, {key: x}),), n) for x in grid for n in taps)
    before = search.solver.squares((start,), tap)
    assert squares <= before
    assert squares - best < 0.02 * (before - best) + 2e-3 * best
    assert terms[0].shape[key] == pytest.approx(true, rel=NEAR.get(name, 0.05))


def test_a_search_never_leaves_its_bracket_or_its_limits(searched):
    search, name, shape = searched
    (key, true) = next(iter(shape.items()))
    least, most = _limits(search, name, key)
    for factor in (0.2, 1.0, 5.0):
        start = factor * true
        (term,), _ = refined(search, (Term.of(name, {key: start}),), 0, search.refit.tap)
        assert abs(math.log(term.shape[key] / start)) <= (1.0 + SHRINK_ALONE) * BRACKET + 1e-9  # the second round's
        assert term.shape[key] == start or least * 0.999 <= term.shape[key] <= most * 1.001


def test_other_terms_are_left_as_they_are(searched):
    search, name, shape = searched
    others = (Term("viscous_friction"), Term.of(name, shape), Term("constant_load"))
    terms, _ = refined(search, others, 1, search.refit.tap)
    assert (terms[0], terms[2]) == (others[0], others[2])
    assert terms[1].id == name


def test_the_delay_stays_within_what_the_log_allows(searched):
    search, name, shape = searched
    _, tap = refined(search, (Term.of(name, shape),), 0, search.refit.tap)
    assert 0 <= tap <= search.problem.most_tap


def test_an_effect_without_shape_stays():
    search = posed(None, (), duration=4.0)
    terms = (Term("coulomb_friction"),)
    assert refined(search, terms, 0, search.refit.tap) == (terms, search.refit.tap)
