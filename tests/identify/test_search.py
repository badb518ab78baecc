"""The search over sets: no step that does not gain, no needless member, and stand-ins give way to the truth."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.search.sets import LEAST_GAIN, Noise
from dsd_cli.identify.verdict.examination import Examination, Settings
from tests.identify.comparison_rig import BELIEVED, OBSERVER, recorded

NAMES = ("coulomb_friction", "viscous_friction", "quadratic_drag", "viscous_asymmetry", "stiffness", "constant_load")
PAIR = {"coulomb_friction": {"level": 0.08}, "viscous_friction": {"coefficient": 0.03}}


def _exam(effects, names=NAMES, model=BELIEVED, **more):
    return Examination([recorded(effects, **more)], model, OBSERVER, Settings(effects=names))


@pytest.fixture(scope="module")
def pair():
    return _exam(PAIR, duration=10.0)


def test_the_whole_set_is_found_and_no_stand_in_is_left(pair):
    whole = pair.search.run(pair.refit)
    assert {t.id for t in whole.terms} == set(PAIR)
    for name in PAIR:
        rest = pair.search.fit(tuple(t for t in whole.terms if t.id != name), whole.tap)
        assert pair.search.matters(rest, whole)


def test_a_stand_in_is_swapped_for_the_truth(pair):
    wrong = pair.search.fit((Term("quadratic_drag"), Term("coulomb_friction")), pair.refit.tap)
    settled = pair.search.settled(wrong)
    assert {t.id for t in settled.terms} == set(PAIR)
    assert pair.search.evidence(settled) > pair.search.evidence(wrong)


def test_needless_members_are_dropped(pair):
    terms = (*(Term(name) for name in PAIR), Term("stiffness"), Term("constant_load"))
    settled = pair.search.settled(pair.search.fit(terms, pair.refit.tap))
    assert {t.id for t in settled.terms} == set(PAIR)


def test_effects_of_the_model_stay_even_if_needless():
    believed = replace(BELIEVED, effects={"stiffness": {"coefficient": 0.01}})
    exam = _exam({}, model=believed, duration=5.0)
    whole = exam.search.settled(exam.search.run(exam.refit))
    assert [t.id for t in whole.terms] == ["stiffness"]
    assert exam.search.added(whole.terms) == ()


def test_options_are_every_allowed_effect_once_best_first(pair):
    options = pair.search.options(pair.refit)
    assert sorted(o.effect for o in options) == sorted(NAMES)
    evidence = [o.evidence for o in options]
    assert evidence == sorted(evidence, reverse=True)
    assert pair.search.options(pair.refit) is options
    for o in options:
        assert [t.id for t in o.fit.terms] == [o.effect]
        assert o.fit.squares <= pair.refit.squares * (1.0 + 1e-9)


def test_nothing_is_added_to_logs_that_lack_nothing():
    for seed in range(8):
        exam = _exam({}, seed=seed, duration=4.0)
        assert exam.search.run(exam.refit).terms == ()


def test_a_gain_must_be_certain_and_of_use(pair):
    whole = pair.search.run(pair.refit)
    assert pair.search.matters(pair.refit, whole)
    assert not pair.search.matters(whole, pair.refit)
    assert not pair.search.matters(whole, whole)
    useless = replace_practical(pair, lambda before, after: False)
    assert not useless.matters(pair.refit, whole)
    gain = pair.search.evidence(whole) - pair.search.evidence(pair.refit)
    loud = replace_practical(pair, lambda before, after: True)
    loud.noise = Noise(pair.noise.variance * gain / LEAST_GAIN * 2.0, pair.noise.inflation)
    assert not loud.matters(pair.refit, whole)


def replace_practical(exam, practical):
    search = exam.search.__class__(
        exam.bank, exam.blocks, exam.base, exam.candidates, exam.noise, practical, exam.most_tap
    )
    return search


def test_the_delay_is_walked_to_from_afar(pair):
    best = min(range(pair.most_tap), key=lambda n: pair.search.solver.squares((), n))
    for start in (0, best, best + 6):
        assert pair.search.fit((), start).tap == best


def test_neighbouring_delays_stay_within_what_the_log_allows(pair):
    assert pair.search.around(0) == [0, 1]
    assert pair.search.around(pair.most_tap) == [pair.most_tap, pair.most_tap - 1]
    assert all(n >= 0 for n in pair.search.taps_for(Term.of("actuator_lag", {"time_constant": 0.5}), 3))


def test_the_first_delay_is_the_best_of_all():
    for delay in (0.0, 0.0033, 0.017):
        exam = _exam({}, model=replace(BELIEVED, delay=delay), duration=4.0, noise=0.002)
        taps = range(exam.most_tap)
        assert exam.refit.tap == min(taps, key=lambda n: exam.search.solver.squares((), n))
        assert np.isfinite(exam.refit.loss)
