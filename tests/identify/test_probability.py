"""How sure a name is: less where much stays unexplained beside it, hardly less in a short log that leaves nothing."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsd_cli.identify.final_fit import add_effect
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.results import Estimate, Missing, Unexplained
from dsd_cli.identify.search.drift_search import LOOKS_THE_SAME
from dsd_cli.identify.verdict import discrepancy, judgement, probability
from dsd_cli.identify.verdict.belief import UnnamedLaws
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.identify.verdict.discrepancy import Discrepancy
from dsd_cli.identify.verdict.judgement import Verdict
from dsd_cli.identify.verdict.probability import Membership
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

STEP, INERTIA, LEVEL = 0.002, 0.05, 0.4
OBSERVER = ObserverSettings(INERTIA, 0.02)
#: Hz, rad/s, rad: what sixteen sines do no line in time can do for them; what two do one line and a stiffness can.
MANY = [(f, 1.5 / (1.0 + f), 2.0 * f**2) for f in np.random.default_rng(8).uniform(0.2, 3.0, 16).tolist()]
FEW = [(0.5, 2.0, 0.3), (1.7, 0.8, 1.0)]
#: What dry friction, a line in time and a stiffness can be taken for.
LIKELY = (
    *("coulomb_friction", "viscous_friction", "presliding_friction", "stribeck_friction", "load_friction"),
    *("periodic_disturbance", "stiffness", "gravity"),
)
OF_SPEED = ("coulomb_friction", "viscous_friction", "quadratic_drag", "viscous_asymmetry")


def friction_over(
    seconds: float, varies: float, lines: list[tuple[float, float, float]], beside: float = 0.0, seed: int = 8
):
    """Verdict and {name: probability} of a motion of sines against dry friction, whose level may go up and down by
    that share of it, three times a turn; inertia and delay are known. beside : rms, as a share of the level, of a
    force that goes in straight lines from one place to the next, eight times over the travel; then forces of the speed
    alone are asked for."""
    random, t = np.random.default_rng(seed), np.arange(0.0, seconds, STEP)
    velocity = sum(a * np.sin(2 * math.pi * f * t + p) for f, a, p in lines)
    acceleration = sum(2 * math.pi * f * a * np.cos(2 * math.pi * f * t + p) for f, a, p in lines)
    position = sum(-a / (2 * math.pi * f) * np.cos(2 * math.pi * f * t + p) for f, a, p in lines)
    places = np.linspace(position.min(), position.max(), 9)
    force = np.interp(position, places, random.normal(size=9))
    u = INERTIA * acceleration + LEVEL * np.sign(velocity) * (1.0 + varies * np.sin(3.0 * position))
    u += beside * LEVEL * (force - force.mean()) / force.std()
    channels = {
        "u": u,
        "velocity": velocity + 2e-3 * random.normal(size=t.size),
        "position": position + 1e-5 * random.normal(size=t.size),
    }
    recording, model = prepare(Log(channels, STEP, "log.csv"), OBSERVER), PlantModel(INERTIA, 0.0, {})
    found = diagnose([recording], model, OBSERVER, Settings(OF_SPEED if beside else LIKELY))
    return found.verdict, found.probability, {one.effect: one.probability for one in found.missing}


@pytest.mark.parametrize("lines", [MANY, FEW], ids=["many sines", "two sines"])
def test_a_name_that_leaves_half_of_itself_is_less_likely_than_not(lines):
    """What varies is 0.7 / sqrt 2 of what does not: the power ratio is 4, that of a stand-in 9 and more. A motion of
    two sines was explained, without u, by a line in time and a stiffness (93 %), and many times the inertia."""
    verdict, probability, missing = friction_over(20.0, 0.7, lines)
    assert max(missing.values(), default=0.0) < 0.5
    assert verdict == "unknown" or probability < 0.5


@pytest.mark.parametrize("seed", [21, 22, 23])
def test_what_is_left_of_another_channel_makes_friction_no_less_likely(seed):
    """A third of its power is left, and is of the position: no function of that is a sign of the speed. By what is
    left alone it would be 25 % at most."""
    _, _, missing = friction_over(20.0, 0.0, MANY, beside=0.6, seed=seed)
    assert missing["coulomb_friction"] > 0.5


def test_what_is_left_counts_in_full_beside_an_effect_with_memory(monkeypatch):
    """As much is left as the effect takes off, 10 % of u. Beside dry friction a tenth of that is background; beside a
    hysteresis another one is no function of the channels, and 1 / (1 + 3^2) is what is believed."""
    monkeypatch.setattr(discrepancy, "surely_left", lambda search, _fit: search.problem.errors.rmse("whole"))
    monkeypatch.setattr("dsd_cli.identify.verdict.belief.only_at_stops", lambda *_: False)
    squares = {"whole": 0.1, "rest": math.sqrt(2.0) * 0.1}
    errors = SimpleNamespace(force=1.0, rmse=lambda fit: squares[fit])
    monkeypatch.setattr(UnnamedLaws, "_shares", lambda *_: ([(1.0, 1.0)], 0.0))
    nothing_known = Discrepancy((), 0.1, False, 0.1, 0.1)
    laws = UnnamedLaws(SimpleNamespace(problem=SimpleNamespace(errors=errors, floor=0.0)), "whole", nothing_known)
    assert laws.belief(Term("coulomb_friction"), "rest") == pytest.approx(1.0 / (1.0 + 0.1**2))
    assert laws.belief(Term("presliding_friction"), "rest") == pytest.approx(0.1)


def test_a_short_log_that_one_effect_explains_is_nearly_as_sure_as_a_long_one():
    verdict, short, _ = friction_over(3.0, 0.0, MANY)
    assert verdict == "coulomb_friction"
    assert 0.85 < short < 0.99
    verdict, long, missing = friction_over(20.0, 0.0, MANY)
    assert verdict == "coulomb_friction"
    assert long == missing["coulomb_friction"]
    assert short < long


@pytest.mark.parametrize(
    ("dry", "rivals", "first"),
    [
        (0.02, (), "viscous_friction"),
        (0.02, ("presliding_friction",), "coulomb_friction"),
        (0.6, (), "coulomb_friction"),
    ],
    ids=["replaced", "tied", "believed"],
)
def test_a_member_that_is_rather_there_than_not_comes_before_one_with_more_evidence_alone(
    dry, rivals, first, monkeypatch
):
    """A member counts with what ties with it: that dry friction is there is as sure as its name is open."""
    alone = {"coulomb_friction": 100.0, "viscous_friction": 50.0}
    for name, stand_in in {
        "__init__": lambda _self: None,
        "_lowers": lambda _self, _name: True,
        "_worth": lambda _self, name: (True, True, alone[name]),
    }.items():
        monkeypatch.setattr(Verdict, name, stand_in)
    monkeypatch.setattr(judgement, "probability_of", lambda _member, belief, _surest: belief)
    verdict = Verdict()
    verdict.search = verdict.whole = verdict.surest = None
    verdict.alone, verdict.members = (
        {},
        {"viscous_friction": Membership("viscous_friction", {"viscous_friction": 0.78}, ())},
    )
    shares = {"coulomb_friction": dry, "presliding_friction": 1.0 - dry}
    verdict.members["coulomb_friction"] = Membership("coulomb_friction", shares, rivals)
    assert verdict._first() == first


@pytest.mark.parametrize(
    ("effect", "left_on", "belief", "more", "named"),
    [
        ("cogging", ("velocity",), 0.9, 0.9, True),
        ("cogging", ("position",), 0.9, 0.9, True),
        ("cogging", ("position",), 0.5, 0.9, False),
        ("cogging", ("position",), 0.4, 0.9, False),
        ("periodic_disturbance", ("position", "time"), 0.9, 0.9, False),
        ("periodic_disturbance", ("position",), 0.9, 0.9, False),
        ("cogging", ("velocity",), 0.06, 0.9, True),
        ("cogging", ("velocity",), 0.04, 0.9, False),
        ("cogging", ("velocity",), 0.04, 0.01, True),
    ],
)
def test_a_name_stands_for_what_is_left_by_its_channels_or_by_how_little_it_is_believed(
    effect, left_on, belief, more, named, monkeypatch
):
    """Half of the power is left. A law that is rather there than not, functions of its own channels weighed, is named;
    one that is rather not, where what is left is of its channels, is none, nor is a line in time, which any law is on a
    motion that repeats. Where a force without a name is likelier no name is given that the log leaves less belief than
    any had before it."""
    for name, stand_in in {
        "__init__": lambda _self: None,
        "_first": lambda _self: effect,
        "_lowers": lambda _self, _name: True,
        "_unknown": lambda _self: ("unknown", 0.9),
        "_share_of_possible": lambda _self, _before, _after: 0.5,
    }.items():
        monkeypatch.setattr(Verdict, name, stand_in)
    monkeypatch.setattr(judgement, "weightless", lambda *_: False)
    monkeypatch.setattr(judgement, "probability_of", lambda _member, belief, _surest: belief)
    monkeypatch.setattr(judgement, "before_climb", lambda *_: None)
    monkeypatch.setattr(judgement, "unexplained_of", lambda *_: Unexplained(0.1, more))
    verdict = Verdict()
    verdict.search, verdict.whole, verdict.surest = SimpleNamespace(refit=None), None, None
    verdict.named_part = None
    verdict.problem = SimpleNamespace(errors=SimpleNamespace(rmse=lambda _: 1.0))
    verdict.shown, verdict._named_for, verdict.doubted = SimpleNamespace(settings=None), {}, ""
    verdict.members = {effect: Membership(effect, {effect: belief}, ())}
    verdict.beyond = Discrepancy(left_on, 0.5, True, 0.1, 1.0)
    assert verdict._of_members() == ((effect, belief) if named else ("unknown", 0.9))
    assert verdict.doubted == ("" if named else effect)


def test_what_the_verdict_takes_the_place_of_is_no_surer_than_the_verdict(monkeypatch):
    """One way, a load is dry friction: "friction, 33 %" stood above "missing: a load, 94 %"."""

    def named(self):
        self._named_for["coulomb_friction"] = "constant_load"
        return "coulomb_friction", 0.33

    monkeypatch.setattr(Verdict, "verdict", named)
    monkeypatch.setattr(Verdict, "_members_alone", lambda _self: [])
    monkeypatch.setattr(judgement, "without_imitating", lambda *_: (None, None))
    monkeypatch.setattr(judgement, "surest_of", lambda *_: 0.99)
    monkeypatch.setattr(judgement, "lowering_together", lambda *_: set())
    load = Membership("constant_load", {"constant_load": 0.94}, ("coulomb_friction", "presliding_friction"))
    search, shown = SimpleNamespace(problem=None), SimpleNamespace(seen=None)
    own = SimpleNamespace(refitted=SimpleNamespace(heldout_rmse=1.0))
    verdict = Verdict(search, [], None, {"constant_load": load}, own, None, shown, None)
    assert verdict.missing == (Missing("constant_load", 0.33),)


def left_in(rmse: float, untestable: dict[str, str] | None = None, floor: float = 0.001):
    """A search of which such an rms is left, of u, and none of whose effects takes anything off."""
    errors = SimpleNamespace(force=1.0, rmse=lambda _fit: rmse, white=lambda _fit: False)
    problem = SimpleNamespace(errors=errors, floor=floor, untestable=untestable or {})
    return SimpleNamespace(problem=problem, refit=None, practical=lambda _before, _after: False)


def test_unknown_is_no_surer_than_what_is_left_of_u_bears_out(monkeypatch):
    """A third of a percent is none; even odds at the 1 % that no model says better; 3 % and more are."""
    monkeypatch.setattr(discrepancy, "surely_left", lambda search, _fit: search.problem.errors.rmse(None))
    shares = (0.0, 0.003, 0.01, 0.03, 0.3)
    nothing_known = Discrepancy((), 0.0, False, 0.0, 0.0)
    sure = [probability.left_over(left_in(share, floor=0.0), None, nothing_known) for share in shares]
    assert sure == sorted(sure)
    assert sure[0] == 0.0
    assert sure[1] < 0.1
    assert sure[2] == pytest.approx(0.5 * sure[4], abs=0.01)
    assert 0.8 < sure[3] < sure[4] < 0.91


@pytest.mark.parametrize(
    ("untestable", "rmse", "certain", "wanted"),
    [
        ({}, 0.001, False, 1.0),
        ({}, 0.1, False, 0.5),
        ({"gravity": "no position"}, 0.001, False, 1.0 / (1.0 + math.exp(-3.0))),
        ({"constant_load": LOOKS_THE_SAME}, 0.001, False, 0.5),
        ({}, 0.01, True, 0.75),
    ],
    ids=["all tested", "much at stops", "one not tested", "one on another path", "a function takes 1 % of u off"],
)
def test_nothing_is_missing_by_what_was_tested_and_what_is_left(untestable, rmse, certain, wanted, monkeypatch):
    monkeypatch.setattr(probability, "probabilities", lambda *_: {probability.NOTHING: 1.0})
    monkeypatch.setattr(discrepancy, "surely_left", lambda search, _fit: search.problem.errors.rmse(None))
    beyond = Discrepancy((), 0.0, False, rmse, rmse, certain)  # of a coarse sensor no less noise was expected
    search = left_in(rmse, untestable, floor=0.01 if certain else 0.001)
    assert probability.nothing_missing(search, [], beyond) == pytest.approx(wanted, abs=0.01)


@pytest.mark.parametrize(
    ("left", "floor", "more", "wanted"),
    [(0.024, 0.016, 0.01, 0.01), (0.053, 0.03, 0.01, 0.42), (0.053, 0.05, 0.6, 0.6), (0.2, 0.03, 0.01, 0.9)],
    ids=["noise", "more than noise, too little to be missing", "a verdict says so", "missing"],
)
def test_what_no_noise_of_the_sensor_leaves_is_a_force_before_it_is_called_missing(
    left, floor, more, wanted, monkeypatch
):
    """4.4 % of u beside a sensor's 3 % were "more is missing: 1 %", and 5 % of it 80 %: 2.2 % are beyond 1.6 times
    3 %, and half of 1 / (1 + (1 % / 2.2 %)^2) is what is believed of those. Of 1.5 times the noise nothing is."""
    errors = SimpleNamespace(force=1.0, rmse=lambda _: left)
    problem = SimpleNamespace(errors=errors, floor=floor, least_missing=math.hypot(1.6 * floor, 0.03))
    monkeypatch.setattr(discrepancy, "surely_left", lambda *_: left)
    beyond = Discrepancy((), left, False, left, left)
    got = probability.unexplained_of(SimpleNamespace(problem=problem), None, beyond, more)
    assert got.probability == pytest.approx(wanted, abs=0.01)


@pytest.mark.parametrize(("unknown", "certain"), [(True, True), (False, True), (False, False)])
def test_what_a_function_explains_is_a_force_however_much_noise_was_expected(unknown, certain, monkeypatch):
    """An end stop behind 4096 counts: the position explained 2.5 % of u of 2.7, and less was left than the sensor's
    noise was thought to be: "something is missing", 0 %. Such an encoder's steps may follow the motion: even odds."""
    problem = SimpleNamespace(errors=SimpleNamespace(force=1.0, rmse=lambda _: 0.027), floor=0.03, least_missing=0.06)
    monkeypatch.setattr(discrepancy, "surely_left", lambda search, _fit: search.problem.errors.rmse(None))
    beyond = Discrepancy(("position",), 0.01, unknown, 0.027, 0.027, certain)
    got = probability.unexplained_of(SimpleNamespace(problem=problem), None, beyond, 0.01)
    assert got.share_of_u == pytest.approx(0.025 if certain else 0.0, abs=1e-4)
    assert got.probability == pytest.approx(0.5 / (1.0 + 0.4**2) if certain else 0.01, abs=0.01)
    assert got.on == (("position",) if certain else ())


def test_a_shape_that_was_searched_is_a_choice_like_another_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 55 rows, two effects with a shape each: 82 % sure as two choices, and wrong."""
    monkeypatch.setattr(probability, "pushes_leave_more", lambda _search, _whole: False)

    def most(*names: str, rows: int = 55) -> float:
        terms = tuple(Term(name) for name in names)
        problem = SimpleNamespace(blocks=SimpleNamespace(rows=rows), before=())
        search = SimpleNamespace(problem=problem, base=(), added=lambda terms: terms)
        return probability.surest_of(search, SimpleNamespace(terms=terms), SimpleNamespace(surest=1.0))

    assert most("coulomb_friction", "viscous_friction") == pytest.approx(55.0 / (55.0 + 3.0 * 2**2))
    assert most("presliding_friction", "stribeck_friction") == pytest.approx(55.0 / (55.0 + 3.0 * 4**2))
    assert most("presliding_friction", "coulomb_friction") == pytest.approx(55.0 / (55.0 + 3.0 * 3**2))
    assert most("coulomb_friction", rows=10_000) == POLICY.surest


@given(
    st.lists(st.floats(0.0, 1.0), min_size=4, max_size=4).filter(lambda x: sum(x) > 0.0),
    st.sets(st.sampled_from(["viscous_friction", "constant_load"])),
)
def test_belief_in_a_place_is_shared_by_what_ties_there(shares: list[float], rivals: set[str]) -> None:
    """The effect is found where a rival explains more, but by nothing of use: as likely as in a draw."""
    names = ["coulomb_friction", "viscous_friction", "constant_load", "cogging"]
    likely = {name: x / sum(shares) for name, x in zip(names, shares, strict=True)}
    member = Membership(names[0], likely, tuple(sorted(rivals)))
    beliefs = {name: member.belief(name) for name in names}
    assert beliefs[names[0]] >= max(likely[names[0]], member.place / (1 + len(rivals)) - 1e-12)
    assert all(beliefs[names[0]] + beliefs[rival] <= member.place + 1e-12 for rival in rivals)
    assert beliefs["cogging"] == likely["cogging"]


@pytest.mark.parametrize(
    ("effect", "rivals", "wanted"),
    [
        ("coulomb_friction", ("constant_load",), 3 / 4),
        ("coulomb_friction", ("constant_load", "viscous_friction"), 6 / 11),
        ("constant_load", ("coulomb_friction",), 1 / 2),  # no less than it has by itself
        ("saturation", ("dead_zone",), 1 / 2),
    ],
)
def test_in_a_draw_an_effect_counts_by_its_rank(effect, rivals, wanted):
    """Zipf: Coulomb friction is met first, viscous friction half as often, a constant load a third; the rest alike."""
    member = Membership(effect, dict.fromkeys((effect, *rivals), 1.0 / (1 + len(rivals))), rivals)
    assert member.belief(effect) == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("name", "values", "wanted"),
    [
        ("periodic_disturbance", {"amplitude": (0.4, 0.6), "frequency": (0.91, 0.04), "phase": (0.1, 2.0)}, False),
        ("periodic_disturbance", {"amplitude": (0.4, 0.1), "frequency": (0.91, 0.04), "phase": (0.1, 2.0)}, True),
        ("presliding_friction", {"level": (0.24, 0.02), "stiffness": (224.0, 174.0)}, False),
        ("backlash", {"gap": (0.02, 0.001), "load_share": (0.4, 0.3), "stiffness": (9e3, 9e4)}, True),
    ],
)
def test_an_effect_is_told_by_all_its_values_and_a_load_by_any(name, values, wanted):
    estimates = {f"{name}.{k}": SimpleNamespace(value=x, std_error=e, held=False) for k, (x, e) in values.items()}
    assert probability.is_told(name, estimates) is wanted


@pytest.mark.parametrize(("effect", "seen"), [("coulomb_friction", True), ("presliding_friction", False)])
def test_an_effect_that_is_added_is_seen_if_all_its_values_are(effect, seen):
    """Friction over a way that no value tells is Coulomb's: it was added to dry friction without a word."""
    random, t = np.random.default_rng(5), np.arange(0.0, 6.0, STEP)
    velocity = sum(a * np.sin(2 * math.pi * f * t + p) for f, a, p in MANY)
    acceleration = sum(2 * math.pi * f * a * np.cos(2 * math.pi * f * t + p) for f, a, p in MANY)
    u = INERTIA * acceleration + LEVEL * np.sign(velocity)
    channels = {
        "u": u,
        "velocity": velocity + 2e-3 * random.normal(size=t.size),
        "position": np.cumsum(velocity) * STEP + 1e-5 * random.normal(size=t.size),
    }
    recording = prepare(Log(channels, STEP, "log.csv"), OBSERVER)
    added = add_effect([recording], PlantModel(INERTIA, 0.0, {}), OBSERVER, effect)
    assert any("not identifiable from this log" in line for line in added.warnings) is not seen


@pytest.mark.parametrize(("shown", "said"), [(True, "this log"), (False, "this excerpt of the log")])
def test_a_note_says_of_what_log_a_value_is_not_identifiable(shown, said, monkeypatch):
    """What is surely not there is fitted to an excerpt of a long log alone: of the log nobody has asked."""
    known = SimpleNamespace(estimates={"stiffness.coefficient": SimpleNamespace(at_bound=False, std_error=math.nan)})
    known.tied, known.model, score = (), None, SimpleNamespace(rmse=1.0, heldout_rmse=1.0)
    problem = SimpleNamespace(values=lambda _fit: known)
    verdict = object.__new__(Verdict)
    verdict.seen, verdict.problem, verdict.members = None, problem, {}
    verdict.search = SimpleNamespace(excerpt=SimpleNamespace(problem=problem, fit=lambda *_: None))
    monkeypatch.setattr(Verdict, "_probability", lambda _self, _effect: 0.0)
    monkeypatch.setattr(Verdict, "_rivals", lambda _self, _effect: ())
    option = SimpleNamespace(effect="stiffness", fit=SimpleNamespace(terms=(), tap=0))
    assert f"not identifiable from {said}: " in verdict._candidate(option, score, score, shown=shown).note


@pytest.mark.parametrize(
    ("lead", "shares", "useful", "said"),
    [
        (1.8, {"": 0.2, "viscous_friction": 0.6}, True, ["viscous_friction"]),
        (1.8, {"": 0.6, "viscous_friction": 0.2}, True, []),
        (1.8, {"": 0.2, "viscous_friction": 0.6}, False, []),
        (30.0, {"": 0.0, "viscous_friction": 1.0}, True, []),  # few moves alone say it
        (1.8, {"": 0.2, "stribeck_friction": 0.6}, True, []),  # the best of many speeds
    ],
)
def test_what_is_rather_there_beside_a_set_has_even_odds(monkeypatch, lead, shares, useful, said):
    """Of moves at one speed viscous friction was less than 1 % beside a dry friction that held all of it."""
    option = SimpleNamespace(effect=max(shares), fit="with it")
    search = SimpleNamespace(
        options=lambda fit: [option], practical=lambda before, after: useful, lead=lambda before, after: lead
    )
    monkeypatch.setattr(probability, "probabilities", lambda *_: shares)
    monkeypatch.setattr(probability, "surest_of", lambda *_: 0.9)
    found = probability.perhaps_missing(search, "without", None)
    assert [(one.effect, one.probability) for one in found] == [(name, POLICY.even) for name in said]


@pytest.mark.parametrize(
    ("before", "weightless", "named"),
    [(1.0, False, {"coulomb_friction", "viscous_friction"}), (0.1, False, set()), (1.0, True, set())],
    ids=["both lower it", "the set raises it", "hardly any inertia is left"],
)
def test_effects_lower_the_error_together_if_more_is_left_without_each(before, weightless, named, monkeypatch):
    """Without one of them more is left; the third takes nothing off."""
    monkeypatch.setattr(probability, "weightless", lambda *_: weightless)
    left = {"": 0.2, "coulomb_friction": 1.5, "viscous_friction": 1.3, "cogging": 0.2}
    terms = tuple(Term(name) for name in left if name)
    search = SimpleNamespace(
        added=lambda terms: terms,
        without=lambda _fit, term: SimpleNamespace(lacks=term.id),
        problem=SimpleNamespace(score=lambda fit: SimpleNamespace(heldout_rmse=left[fit.lacks])),
    )
    assert probability.lowering_together(search, SimpleNamespace(terms=terms, lacks=""), before) == named


def test_only_a_candidate_is_named_for_what_it_does_with_others(monkeypatch):
    """A second line is none alone: "cogging_4 is missing" had no value and no error."""
    monkeypatch.setattr(Verdict, "__init__", lambda _self: None)
    verdict = Verdict()
    verdict.alone, verdict.together = {}, {"cogging_2"}
    verdict.own = SimpleNamespace(refitted=SimpleNamespace(heldout_rmse=1.0))
    verdict.problem = SimpleNamespace(score=None, errors=SimpleNamespace(rmse=None))
    assert not verdict._lowers("cogging_2")


@pytest.mark.parametrize(
    ("name", "deviations", "sure"),
    [
        ("gain_droop.droop", 2.5, False),
        ("gain_droop.droop", 3.1, True),
        ("load_friction.coefficient", 2.5, True),
        ("stiffness.coefficient", 1.9, False),
    ],
)
def test_a_droop_is_farther_from_0_than_other_laws_must_be(name: str, deviations: float, sure: bool) -> None:
    """Gains that vary with the place or a sagging supply had droops of 2.1 to 2.5 standard errors, up to 92 %."""
    effect = name.partition(".")[0]
    assert probability.is_told(effect, {name: Estimate(0.01 * deviations, 0.01, "1")}) is sure
