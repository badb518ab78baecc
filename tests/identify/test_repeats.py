"""Several lines of one kind in a search: names, what tells them apart, and which one comes first."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.effects import Ranges
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import Estimate
from dsd_cli.identify.search import sets
from dsd_cli.identify.search.response import _swinging
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.shapes import _beside_cycle, apart, names_to_try, refined, renamed
from dsd_cli.identify.search.task import _deviations, identified_only
from dsd_cli.identify.verdict.diagnose import strongest_first
from tests.identify.search_rig import BELIEVED, MOVES, posed, seen

RANGES = Ranges(1.0, 3.0, 3.0, 0.5, 2.0, 1e-3, 10.0, passes=8.0)
#: One period over the travel of RANGES, rad/rad.
BIN = 6.283185307 / 3.0


def line(name: str, periods: float) -> Term:
    return Term.of(name, {"periods": periods})


def test_what_is_there_is_asked_again_under_its_next_name_if_it_repeats():
    allowed = ("viscous_friction", "cogging", "periodic_disturbance")
    assert list(names_to_try(allowed, (), RANGES)) == list(allowed)
    here = {"cogging", "cogging_2", "viscous_friction"}
    assert list(names_to_try(allowed, here, RANGES)) == ["cogging_3", "periodic_disturbance"]
    assert list(names_to_try(("cogging", "cogging_2"), (), RANGES)) == ["cogging"]
    assert list(names_to_try(("cogging_2",), {"cogging"}, RANGES)) == ["cogging_2"]


def test_an_axis_that_goes_over_its_travel_once_tells_one_line():
    once = RANGES._replace(passes=1.2)
    assert list(names_to_try(("cogging", "periodic_disturbance"), {"cogging"}, once)) == ["periodic_disturbance"]


@pytest.mark.parametrize("seed", range(20))
def test_of_a_motion_that_repeats_only_what_does_not_is_a_line_in_time(seed):
    """Any law of the motion repeats with it: here a saw-tooth of each cycle of 33.1 rows, beside a push of a third of
    its size with 4.37 periods a cycle."""
    random = np.random.default_rng(seed)
    phase = np.arange(1000) / 33.1 + random.uniform()
    push = 2.0 * np.pi * (4.37 * phase + random.uniform())
    rows = (phase % 1.0) - 0.5 + 0.1 * np.sin(push) + 0.02 * random.normal(size=1000)
    strongest = [int(np.argmax(np.abs(np.fft.rfft(x, 8000)))) / 8.0 for x in (rows, _beside_cycle(rows, 33.1))]
    assert strongest == [pytest.approx(1000 / 33.1, abs=0.5), pytest.approx(4.37 * 1000 / 33.1, abs=0.5)]


@pytest.mark.parametrize("cycle", [math.inf, 400.0])
def test_of_a_motion_that_does_not_repeat_all_may_be_a_line_in_time(cycle):
    rows = np.random.default_rng(1).normal(size=1000)
    np.testing.assert_array_equal(_beside_cycle(rows, cycle), rows)


def test_lines_of_a_kind_are_a_period_apart_and_others_are_no_matter():
    first = line("cogging", 20.0)
    assert not apart(line("cogging_2", 20.0 + 0.9 * BIN), [first], RANGES)
    assert apart(line("cogging_2", 20.0 + 1.1 * BIN), [first], RANGES)
    assert apart(line("cogging_2", 40.0), [first], RANGES)
    assert apart(Term.of("periodic_disturbance", {"frequency": 20.0}), [first], RANGES)
    assert apart(Term.of("viscous_friction", {}), [first], RANGES)
    assert apart(first, [first], RANGES)


def test_names_follow_the_order_in_the_places_that_there_are():
    drag, a, b, c = (
        Term.of("viscous_friction", {}),
        line("cogging_2", 6.0),
        line("cogging_4", 12.0),
        line("cogging", 9.0),
    )
    assert renamed((a, drag, b), (b, a)) == (line("cogging", 12.0), drag, line("cogging_2", 6.0))
    assert renamed((c, a, drag, b), (b, a)) == (c, line("cogging_2", 12.0), drag, line("cogging_3", 6.0))


TWO = {
    "cogging": {"amplitude": 0.04, "periods": 21.0, "phase": 0.5},
    "cogging_2": {"amplitude": 0.08, "periods": 13.0, "phase": -1.0},
}
ALLOWED = ("viscous_friction", "constant_load", "cogging", "periodic_disturbance")


@pytest.fixture(scope="module")
def search():
    return posed(TWO, ALLOWED, reference=MOVES)


def test_a_search_that_goes_on_from_a_full_set_adds_nothing(search, monkeypatch):
    """A rig distinguishes no more effects, in however many searches after each other they were found."""
    one = search.fit((*search.base, line("cogging", 13.0)), search.refit.tap)
    assert len(search.run(one).terms) > len(one.terms)
    monkeypatch.setattr(sets, "POLICY", replace(POLICY, most_effects=1))
    assert search.run(one).terms == one.terms


@pytest.mark.parametrize(("lines", "beside"), [((13.0,), 1), ((13.0, 21.0), 0)])
def test_a_load_is_sought_beside_one_line_and_in_the_place_of_several(search, lines, beside):
    """A sum of lines is any function of a motion to and fro, what a load does too."""
    terms = (line(name, n) for name, n in zip(("cogging", "cogging_2"), lines, strict=False))
    look = _swinging(search, search.fit((*search.base, *terms), search.refit.tap))
    assert len([t for t in look.fit.terms if t.effect.periods is not None]) == beside


def test_both_are_found_and_the_larger_has_the_first_name(search):
    whole, (first,) = strongest_first(search, identified_only(search, search.run(search.refit)))
    found = {t.id: t.shape["periods"] for t in search.added(whole.terms)}
    assert found == {"cogging": pytest.approx(13.0, rel=2e-3), "cogging_2": pytest.approx(21.0, rel=2e-3)}
    assert (first.effect, first.fit.terms[-1].shape["periods"]) == ("cogging", found["cogging"])


def test_a_name_of_which_the_user_knows_something_stays(search):
    known = PriorKnowledge(priors={"cogging_2.periods": (13.0, 0.1)})
    told = Search(pose([seen(TWO, reference=MOVES)], BELIEVED, Settings(ALLOWED, known)))
    whole = told.fit((line("cogging", 21.0), line("cogging_2", 13.0)), told.refit.tap)
    assert strongest_first(told, whole) == (whole, [])


@pytest.mark.parametrize("periods", [(13.0, 21.0, 29.3), (29.3, 13.0, 21.0)], ids=["a later one", "the first"])
def test_a_line_of_which_no_force_is_told_is_dropped(search, periods):
    terms = tuple(line(name, n) for name, n in zip(("cogging", "cogging_2", "cogging_3"), periods, strict=True))
    at = search.fit(terms, search.refit.tap)
    assert [t.shape["periods"] for t in identified_only(search, at).terms] == pytest.approx([13.0, 21.0], rel=2e-3)


@pytest.mark.parametrize(
    ("effect", "values", "told"),
    [
        ("cogging", {"amplitude": (0.005, 0.004), "periods": (995.0, 1.6), "phase": (1.5, 0.1)}, 1.25),
        ("periodic_disturbance", {"amplitude": (0.4, 0.2), "frequency": (0.91, 0.04), "phase": (0.1, 2.0)}, 2.0),
        ("cogging", {"amplitude": (0.005, 0.0), "periods": (995.0, 1.6), "phase": (1.5, 0.1)}, 0.0),
    ],
)
def test_a_line_is_told_by_its_force(effect, values, told):
    """A wave that is not there has a length, and an angle, that many standard errors are away from 0."""
    estimates = {f"{effect}.{name}": Estimate(value, error, "") for name, (value, error) in values.items()}
    assert _deviations(Term.of(effect, {}), estimates) == pytest.approx(told)
    held = {name: replace(e, held=True) for name, e in estimates.items()}
    assert _deviations(Term.of(effect, {}), held) == math.inf


def test_a_shape_is_not_searched_where_another_line_is(search):
    """From half a period beyond the limit it would go to the true line, which is there already."""
    width = 6.283185307 / search.ranges.travel
    terms = (line("cogging", 13.0), line("cogging_2", 13.0 + 1.05 * width))
    moved, _ = refined(search, terms, 1, search.refit.tap)
    assert apart(moved[1], moved[:1], search.ranges)


@pytest.mark.parametrize("seed", range(3))
def test_one_line_stays_one(seed):
    one = {"cogging": TWO["cogging_2"]}
    search = posed(one, ALLOWED, reference=MOVES, seed=seed)
    search = Search(search.problem.measured_again(search.run(search.refit)))
    assert [t.id for t in search.run(search.refit).terms] == ["cogging"]
