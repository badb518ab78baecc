"""The search over sets: no step that does not gain, no needless member, and stand-ins give way to the truth."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dsd_cli.identify.final_fit import ended
from dsd_cli.identify.fit.bank import SHARE, Term
from dsd_cli.identify.fit.errors import Noise
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search import evidence, response
from dsd_cli.identify.search.evidence import preferred
from dsd_cli.identify.search.play import LOG_INERTIA
from dsd_cli.identify.search.sets import Search, _apart
from dsd_cli.identify.search.task import Task, searched_as_is
from dsd_cli.identify.verdict import command_time
from dsd_cli.identify.verdict.diagnose import Settings, diagnose
from dsd_cli.plant.references import Multisine
from tests.identify.search_rig import BELIEVED, OBSERVER, SPEED_NOISE, posed, seen

NAMES = ("coulomb_friction", "viscous_friction", "quadratic_drag", "viscous_asymmetry", "stiffness", "constant_load")
PAIR = {"coulomb_friction": {"level": 0.08}, "viscous_friction": {"coefficient": 0.03}}


@pytest.fixture(scope="module")
def pair():
    return posed(PAIR, NAMES)


def test_the_whole_set_is_found_and_no_stand_in_is_left(pair):
    whole = pair.run(pair.refit)
    assert {t.id for t in whole.terms} == set(PAIR)
    for name in PAIR:
        rest = pair.fit(tuple(t for t in whole.terms if t.id != name), whole.tap)
        assert pair.matters(rest, whole)


def test_its_values_are_those_of_the_plant(pair):
    whole = pair.run(pair.refit)
    model = pair.problem.scale.model(whole)
    assert model.inertia == pytest.approx(BELIEVED.inertia, rel=0.01)
    assert model.effects["coulomb_friction"]["level"] == pytest.approx(0.08, rel=0.02)
    assert model.effects["viscous_friction"]["coefficient"] == pytest.approx(0.03, rel=0.02)


def test_a_stand_in_is_swapped_for_the_truth(pair):
    wrong = pair.fit((Term("quadratic_drag"), Term("coulomb_friction")), pair.refit.tap)
    settled = pair.settled(wrong)
    assert {t.id for t in settled.terms} == set(PAIR)
    assert pair.evidence(settled) > pair.evidence(wrong)


def test_needless_members_are_dropped(pair):
    terms = (*(Term(name) for name in PAIR), Term("stiffness"), Term("constant_load"))
    settled = pair.settled(pair.fit(terms, pair.refit.tap))
    assert {t.id for t in settled.terms} == set(PAIR)


def test_of_two_that_only_together_explain_anything_neither_is_dropped(pair, monkeypatch):
    """Each is doubtful beside the other, and either alone no better than nothing: both went, and nothing was named."""
    whole = pair.fit(tuple(Term(name) for name in PAIR), pair.refit.tap)
    monkeypatch.setattr(Search, "matters", lambda _, before, after: len(after.terms) >= len(before.terms) + 2)
    assert pair.without_needless(whole) is whole
    begun = pair.fit(whole.terms[:1], whole.tap)  # of a set that one of them was: the other does not matter there
    assert pair.without_needless(whole, begun).terms == ()


def test_what_is_left_of_a_set_is_judged_against_what_the_model_was_before_it():
    """Half of a set that was taken, the other half matters as little beside it as before."""
    half = replace(BELIEVED, effects={"coulomb_friction": PAIR["coulomb_friction"]})
    asked = Settings(effects=NAMES, begun=replace(BELIEVED, effects=PAIR), begun_with=("coulomb_friction",))
    search = Search(pose([seen(PAIR, duration=5.0)], half, asked))
    whole = search.fit((*search.base, Term("viscous_friction")), search.refit.tap)
    search.matters = lambda before, after: len(after.terms) >= len(before.terms) + 2
    assert search.without_needless(whole) is whole
    assert search.without_needless(whole, search.refit).terms == search.base


def test_effects_of_the_model_stay_even_if_needless():
    believed = replace(BELIEVED, effects={"stiffness": {"coefficient": 0.01}})
    search = posed({}, NAMES, model=believed, duration=5.0)
    whole = search.settled(search.run(search.refit))
    assert [t.id for t in whole.terms] == ["stiffness"]
    assert search.added(whole.terms) == ()


def test_options_are_every_allowed_effect_once_best_first(pair):
    options = pair.options(pair.refit)
    assert sorted(o.effect for o in options) == sorted(NAMES)
    evidence = [o.evidence for o in options]
    assert evidence == sorted(evidence, reverse=True)
    assert pair.options(pair.refit) is options
    for o in options:
        assert [t.id for t in o.fit.terms] == [o.effect]
        assert o.evidence == pair.evidence(o.fit)


def test_an_effect_that_is_there_already_is_no_option(pair):
    beside = pair.fit((Term("coulomb_friction"),), pair.refit.tap)
    assert sorted(o.effect for o in pair.options(beside)) == sorted(set(NAMES) - {"coulomb_friction"})


def test_nothing_is_added_to_logs_that_lack_nothing():
    found = [posed({}, NAMES, seed=seed, duration=4.0) for seed in range(8)]
    assert [search.run(search.refit).terms for search in found] == [()] * 8


def test_a_gain_must_be_certain_and_of_use(pair):
    whole = pair.run(pair.refit)
    assert pair.matters(pair.refit, whole)
    assert not pair.matters(whole, pair.refit)
    assert not pair.matters(whole, whole)
    useless = Search(pair.problem)
    useless.practical = lambda before, after: False
    assert not useless.matters(pair.refit, whole)
    gain = float(pair.refit.losses.sum() - whole.losses.sum()) / pair.noise.nats
    for nats, certain in ((0.5 * POLICY.least_gain, False), (3.0 * POLICY.least_gain, True)):  # beyond the price
        loud = pair.noise.variance * gain / (pair.price(whole.terms) + nats)
        search = Search(replace(pair.problem, noise=Noise(loud, pair.noise.inflation)))
        search.practical = lambda before, after: True
        assert search.matters(pair.refit, whole) is certain


def test_of_use_is_a_share_of_the_error_or_of_the_force(pair):
    """The thresholds of the policy, from held-out errors computed by hand."""
    whole, errors = pair.run(pair.refit), pair.problem.errors
    was, now = errors.rmse(pair.refit), errors.rmse(whole)
    fall = was**2 - now**2
    by_share = fall > (1.0 - 0.985**2) * was**2 and fall > (0.003 * errors.force) ** 2
    assert pair.practical(pair.refit, whole) == (by_share or fall > (0.015 * errors.force) ** 2)
    assert pair.practical(pair.refit, whole)
    assert not pair.practical(whole, whole)


def test_the_price_is_of_choice_shapes_and_edges(pair):
    pulses = Term.of("external_force", {"edges": ((1.0, 2.0), (3.0, 4.0))})
    lag, friction = Term.of("actuator_lag", {"time_constant": 0.01}), Term("coulomb_friction")
    assert pair.price((friction,)) == POLICY.effect_price
    assert pair.price((lag, friction)) == 2.0 * POLICY.effect_price + POLICY.effect_price
    assert pair.price((pulses,)) == pytest.approx(
        POLICY.effect_price + 2.0 * POLICY.pulse_price + POLICY.effect_price * pulses.effect.searched
    )
    knowing = posed(PAIR, ("viscous_friction",), replace(BELIEVED, effects={"coulomb_friction": {"level": 0.1}}))
    assert knowing.price(knowing.base) == 0.0


def test_the_cheaper_of_two_that_differ_by_nothing_of_use_is_preferred(pair):
    options = pair.options(pair.refit)
    dear, cheap = options[0], options[1]
    searched = {dear.effect: 9.0, cheap.effect: 1.0}
    search = Search(pair.problem)
    search.price = lambda terms: searched.get(terms[-1].id, 20.0)
    search.practical = lambda before, after: False
    assert preferred(search, options[:2]) is cheap
    search.practical = lambda before, after: True
    assert preferred(search, options[:2]) is dear
    assert preferred(search, []) is None


@pytest.mark.parametrize(("lead", "named"), [(5.9, "coulomb_friction"), (6.1, "constant_load")])
def test_of_two_that_cost_the_same_the_commoner_is_taken_unless_the_lead_is_certain(pair, lead, named):
    options = {o.effect: o for o in pair.options(pair.refit)}
    search = Search(pair.problem)
    search.practical = lambda before, after: True
    search.lead = lambda before, after: lead if before is not after else 0.0
    commoner = replace(options["coulomb_friction"], evidence=0.0)
    rarer = replace(options["constant_load"], evidence=lead)
    assert preferred(search, [rarer, commoner]).effect == named


ARM = {"gravity": {"amplitude": 0.3, "phase": 0.4}}
SPRING = {"stiffness": {"coefficient": 0.2}, "constant_load": {"force": 0.05}, "cubic_stiffness": {"coefficient": 4.0}}
OF_POSITION = ("gravity", "constant_load", "stiffness", "cubic_stiffness", "viscous_friction")


@pytest.mark.parametrize(("hidden", "amplitude"), [(ARM, 1.0), (ARM, 0.05), (SPRING, 0.12)])
def test_no_weight_is_found_that_a_spring_must_hold(hidden, amplitude):
    """Over 0.1 rad a weight is a load and a spring, and beside a spring that holds it, it bends as a cubic one does.
    One arm is likelier than a load and a spring that happen to be its tangent."""
    search = posed(hidden, OF_POSITION, reference=Multisine((0.7, 1.9, 3.1), amplitude, seed=3), noise=2e-4)
    assert {t.id for t in search.run(search.refit).terms} == set(hidden)


def test_over_a_small_travel_a_hanging_weight_and_a_spring_are_one():
    """sin(q) of 0.03 rad is q but for 1e-4 of it: one is named, and that it may be the other."""
    hanging = {"gravity": {"amplitude": 1.0, "phase": 0.0}, "viscous_friction": {"coefficient": 0.01}}
    found = diagnose([seen(hanging, reference=Multisine((0.7, 1.9, 3.1), 0.015, seed=3))], BELIEVED, OBSERVER)
    first = found.ranking[0]
    assert {first.effect, *first.indistinguishable_from} == {"gravity", "stiffness"}


def test_the_delay_is_walked_to_from_afar(pair):
    """To the least squares over all whole steps, found by brute force."""
    squares = [pair.solver.squares((), n) for n in range(min(pair.problem.most_tap, 60))]
    best = int(np.argmin(squares))
    for start in (0, best, best + 6):
        assert pair.fit((), start).squares <= squares[best] * (1.0 + 1e-6)


def test_a_walk_ends_at_the_delay_of_the_plant():
    search = posed({}, (), duration=4.0)
    for start in (0, 5, 9):
        delay = search.problem.scale.model(search.fit((), start)).delay
        assert delay == pytest.approx(BELIEVED.delay, abs=1e-4)


def test_delays_stay_within_what_the_log_allows(pair):
    late = pair.taps_for(Term.of("actuator_lag", {"time_constant": 0.5}), 3)
    assert all(0 <= n <= pair.problem.most_tap for n in late)
    assert pair.taps_for(Term("coulomb_friction"), 3) == [3]
    assert 0 <= pair.fit((), 10**6).tap <= pair.problem.most_tap
    assert pair.fit((), -5).tap >= 0


def test_the_first_delay_is_that_of_the_plant():
    for delay in (0.0, 0.0033, 0.017):
        search = posed({}, (), plant=replace(BELIEVED, delay=delay), duration=4.0)
        assert search.problem.scale.model(search.refit).delay == pytest.approx(delay, abs=3e-4)


def test_a_run_reports_shares_that_grow(pair):
    told = []
    pair.run(pair.refit, told.append)
    assert told == sorted(told)
    assert all(0.0 <= share < 1.0 for share in told)


def test_what_the_last_rung_found_is_weighed_too(monkeypatch):
    """A search that takes no step finds a set only if it was found before."""
    recording, before = seen(PAIR), replace(BELIEVED, effects=PAIR)
    monkeypatch.setattr(Search, "run", lambda _, start, *__, **___: start)
    for begun, found in ((None, set()), (before, set(PAIR))):
        asked = Settings(effects=NAMES, begun=begun)
        _, whole = searched_as_is(Task((recording,), BELIEVED, asked))
        assert {t.id for t in whole.terms} == found


def test_terms_that_go_round_in_a_circle_end_where_they_began(monkeypatch):
    """Simpler than one, commoner than another, which is commoner than the first: a log ended in a RecursionError."""
    sets = [SimpleNamespace(terms=(Term(name),)) for name in ("gravity", "constant_load", "stiffness")]
    following = dict(zip((s.terms for s in sets), (*sets[1:], sets[0]), strict=True))
    monkeypatch.setattr(evidence, "_one_commoner", lambda _, fit: following[fit.terms])
    assert evidence.in_common_terms(None, sets[1]) is sets[1]


@pytest.mark.parametrize(
    ("certain", "named"), [({"viscous_friction"}, "viscous_friction"), (set(), "coulomb_friction")]
)
def test_a_set_that_is_certain_is_not_given_up_for_commoner_names_that_are_not(pair, monkeypatch, certain, named):
    """Of half a move of an arm the friction was certain as viscous, and as Coulomb, in whose name it went, not."""
    monkeypatch.setattr(evidence, "_as_good", lambda _search, one, _best: one.effect == "coulomb_friction")
    monkeypatch.setattr(Search, "matters", lambda _, _less, fit: bool(fit.terms) and fit.terms[0].id in certain)
    monkeypatch.setattr(Search, "without_needless", lambda _, fit, _reached: fit)
    fit = pair.fit((Term("viscous_friction"),), pair.refit.tap)
    assert [t.id for t in pair.settled(fit).terms] == [named]


def test_what_lowers_the_error_of_what_is_written_is_not_taken_back(pair, monkeypatch):
    """Beside a force without a name the evidence for friction fell to nothing, and taking it back raised the error by
    half."""
    monkeypatch.setattr(Search, "lead", lambda *_: -1.0)
    given = pair.problem.model
    reached = pair.problem.scale.model(pair.fit(tuple(map(Term, PAIR)), pair.refit.tap))
    asked = Settings(effects=NAMES)
    ends = list(ended(pair.problem.recordings, given, reached, asked, newest="coulomb_friction"))
    assert [end.without for end in ends] == [""]


def test_a_motor_that_u_does_not_move_has_no_play(pair, monkeypatch):
    """Of two levels of u a direction the inertia beside a play came out as exp(-800): "model.inertia = 0: must be"."""
    look = response._swinging(pair, pair.refit)

    def starts(self):
        return [np.where(np.arange(7 + len(self.friction)) == LOG_INERTIA, -800.0, 0.0)]

    monkeypatch.setattr(response.Play, "starts", starts)
    monkeypatch.setattr(response.Play, "best", lambda _, starts: (starts[0], starts))
    monkeypatch.setattr(response.Play, "fitted", lambda _, at: at)
    assert response._play(pair, look) is None


def test_the_error_of_a_filter_beside_columns_that_are_nearly_one_is_a_number():
    """The inverse of their Gram matrix has rounding on its diagonal, also below 0, of which a root was taken."""
    random = np.random.default_rng(76)
    x = random.normal(size=(5, 200)) * 10.0 ** random.uniform(-6, 6, size=(5, 1))
    x[4] = x[3] * (1.0 + 1e-8 * random.normal(size=200))
    x[SHARE] = 1e-3 * x[SHARE] + 1e-6 * x[2]
    assert np.linalg.pinv(x @ x.T)[SHARE, SHARE] < 0.0
    rows = [random.normal(size=200), *x]
    bank = SimpleNamespace(tap_time=1.0, rows=lambda *_, **__: rows)
    search = SimpleNamespace(solver=SimpleNamespace(bank=bank), noise=SimpleNamespace(inflation=1.0))
    freed = command_time._freed(search, (), 0)
    assert 0.0 < freed.error < np.inf


def test_a_bend_that_two_common_forces_make_is_no_stribeck_friction():
    """Of a quarter of the top speed it stood in for both, and the viscous friction beside it was tripled."""
    there = {"coulomb_friction": {"level": 0.2}, "quadratic_drag": {"coefficient": 0.02}}
    search = posed(there, (*NAMES, "stribeck_friction"), noise=0.05 * SPEED_NOISE)
    bent = Term.of("stribeck_friction", {"velocity": 0.25 * search.ranges.top_speed})
    wrong = search.fit((bent, Term("viscous_friction")), search.refit.tap)
    found = {t.id for t in evidence.in_common_terms(search, wrong).terms}
    assert found == {*there, "viscous_friction"}


def test_what_is_just_not_in_a_set_is_in_the_errors_of_its_values():
    """Over this travel a weight beside a cubic spring is a spring as well: ten times the true one, to 3 % by itself."""
    there = {
        "stiffness": {"coefficient": 0.6},
        "cubic_stiffness": {"coefficient": 0.3},
        "gravity": {"amplitude": 0.06, "phase": -0.9},
    }
    search = posed(there, tuple(there), noise=0.1 * SPEED_NOISE)
    fit = search.fit((Term("gravity"), Term("cubic_stiffness")), search.refit.tap)
    alone, averaged = (of(fit).estimates["gravity.amplitude"] for of in (search.problem.values, search.values))
    assert alone.value == averaged.value
    off = abs(alone.value - there["gravity"]["amplitude"])
    assert off > 10.0 * alone.std_error
    assert off < 3.0 * averaged.std_error
    given, reached = search.problem.model, search.problem.scale.model(fit)  # and so `improve` writes them
    *_, end = ended(search.problem.recordings, given, reached, Settings(effects=tuple(there)), newest="gravity")
    assert off < 3.0 * end.values["gravity.amplitude"].std_error


def test_a_delay_may_move_to_0_and_an_effect_that_is_gone_moves_nothing():
    assert _apart("delay", 0.0, 0.004) == -0.004
    assert _apart("coulomb_friction.level", 0.0, 0.1) == 0.0
    assert _apart("gravity.phase", 3.1, -3.1) == pytest.approx(6.2 - 2.0 * np.pi)
