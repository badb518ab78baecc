"""The ladder: every rung lowers the held-out error, and what cannot be added says why in one line."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from dsd_cli.errors import DataError, UsageError
from dsd_cli.identify import improve as improve_module
from dsd_cli.identify.final_fit import add_effect
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.improve import _taken_of, improve
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.results import NONE
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.identify.outside_rig import asked
from tests.oracle.machine_cases import cases
from tests.oracle.machines import run
from tests.oracle.rig import RigCase, make

FRICTION = (
    *("coulomb_friction", "viscous_friction", "stribeck_friction", "presliding_friction", "load_friction"),
    *("viscous_asymmetry", "quadratic_drag"),
)
CANDIDATES = ("coulomb_friction", "viscous_friction", "gravity", "stiffness", "constant_load", "viscous_asymmetry")
FEW = Settings(effects=CANDIDATES)


def _rig(recording):
    case = recording.truth
    observer = ObserverSettings(case.nominal_inertia, case.observer_time_constant)
    log = Log(recording.channels, case.sample_time, "log.csv")
    return prepare(log, observer), PlantModel(case.believed_inertia, case.believed_delay, dict(case.base)), observer


def _gravity():
    """A chooser: gravity, and no more."""
    wishes = iter(["gravity"])
    return lambda _: next(wishes, None)


@pytest.fixture(scope="module")
def pair():
    return _rig(run(cases(("coulomb_friction", "gravity"), [2], duration=5.0))[0])


@pytest.fixture(scope="module")
def nothing():
    return _rig(run(cases("none", [1], duration=5.0))[0])


@pytest.fixture(scope="module")
def ladder(pair):
    recording, model, observer = pair
    told = []
    found = improve([recording], model, observer, FEW, choose=lambda d: d.verdict, on_step=told.append)
    return found, told


def test_both_hidden_effects_are_taken_and_then_nothing(ladder, pair):
    found, _ = ladder
    assert {step.effect for step in found.steps[1:]} == {"coulomb_friction", "gravity"}
    assert found.verdict == NONE
    assert found.stopped == "nothing significant is left"
    assert found.last.verdict == NONE
    assert found.steps[-1].model.effects.keys() == {*pair[1].effects, "coulomb_friction", "gravity"}


def test_what_the_set_has_is_named_first_if_it_lowers_the_error_of_the_model_as_given():
    """Inertia and delay, fitted without friction, leave more than the model as given: Coulomb friction lowered that,
    could not be added by itself, and the ladder went on without it (viscous friction, then "unknown")."""
    (log,) = make([RigCase(what=("coulomb_friction", "stribeck_friction"), seed=64330, sensing="speed40k")])
    recording, model, observer = asked(log)
    found = improve([recording], model, observer, Settings(FRICTION), choose=lambda d: d.verdict)
    assert {step.effect for step in found.steps[1:]} == {"coulomb_friction", "stribeck_friction"}
    assert found.verdict == NONE


def test_effects_that_lower_the_error_only_together_are_added_one_by_one():
    """Alone, each makes inertia and delay worse than the model has them: the ladder ended without either."""
    (log,) = make([RigCase(what=("cogging", "coulomb_friction"), seed=64331, sensing="speed40k")])
    recording, model, observer = asked(log)
    settings = Settings((*CANDIDATES, "cogging"))
    found = improve([recording], model, observer, settings, choose=lambda d: d.verdict)
    assert {step.effect for step in found.steps[1:]} - {"refit"} == {"cogging", "coulomb_friction"}
    assert found.verdict == NONE
    assert all(b.score.heldout_rmse < a.score.heldout_rmse for a, b in pairwise(found.steps))
    assert found.steps[-1].model.inertia == pytest.approx(log.truth["inertia"], rel=0.01)


def test_the_held_out_error_falls_on_every_rung(ladder):
    found, _ = ladder
    errors = [step.score.heldout_rmse for step in found.steps]
    assert all(after < before for before, after in pairwise(errors))
    assert [step.step for step in found.steps] == list(range(len(found.steps)))
    assert found.steps[0].effect == "as given"
    assert errors[-1] < 1.4 * found.last.noise  # rows of starts and stops are in it


def test_every_rung_is_told_when_it_is_taken(ladder):
    found, told = ladder
    assert [(step.step, step.effect) for step in told] == [(step.step, step.effect) for step in found.steps]
    errors = [step.score.heldout_rmse for step in found.steps]
    assert [step.score.heldout_rmse for step in told][:-1] == errors[:-1]  # the last is fitted once more at the end
    assert errors[-1] == found.last.refitted.heldout_rmse


def test_the_ladder_ends_where_the_chooser_says(pair):
    recording, model, observer = pair
    found = improve([recording], model, observer, FEW, choose=lambda d: None)
    assert [step.effect for step in found.steps] == ["as given"]
    assert found.verdict in ("coulomb_friction", "gravity")
    assert "stopped" in found.stopped
    assert found.steps[0].model == model


def test_another_effect_than_the_verdict_may_be_chosen(pair):
    recording, model, observer = pair
    found = improve([recording], model, observer, FEW, choose=_gravity())
    assert [step.effect for step in found.steps] == ["as given", "gravity"]
    assert found.steps[1].score.heldout_rmse < found.steps[0].score.heldout_rmse


def test_what_is_taken_of_an_excerpt_is_fitted_to_all_rows(pair, monkeypatch):
    """The ranking of a long log has values of the excerpt: none of them stands in the model that a user takes."""
    recording, model, observer = pair

    def of_excerpt(*args, **how):
        said = diagnose(*args, **how)
        off = tuple(replace(c, of_excerpt=True, model=said.given, all_values={}) for c in said.ranking if c.model)
        return replace(said, ranking=off)

    plain = improve([recording], model, observer, FEW, choose=_gravity())
    monkeypatch.setattr(improve_module, "diagnose", of_excerpt)
    found = improve([recording], model, observer, FEW, choose=_gravity())
    assert [step.effect for step in found.steps] == ["as given", "gravity"]
    wanted, values = plain.steps[1].estimates, found.steps[1].estimates
    assert values.keys() == wanted.keys()
    for name, one in values.items():
        assert abs(one.value - wanted[name].value) < 0.1 * wanted[name].std_error, name


def test_an_effect_that_is_no_candidate_is_refused(pair):
    recording, model, observer = pair
    with pytest.raises(UsageError, match="cogging"):
        improve([recording], model, observer, FEW, choose=lambda d: "cogging")


def test_a_log_without_anything_missing_is_left_alone(nothing):
    recording, model, observer = nothing
    asked = []
    found = improve([recording], model, observer, FEW, choose=lambda d: asked.append(d) or d.verdict)
    assert found.verdict == NONE
    assert len(found.steps) == 1
    assert asked == []


def test_the_ladder_is_no_longer_than_it_may_be(ladder):
    assert len(ladder[0].steps) <= POLICY.most_effects + 1


def test_adding_the_true_effect_lowers_both_errors_and_refits_all(pair):
    recording, model, observer = pair
    found = add_effect([recording], model, observer, "coulomb_friction")
    assert found.effect == "coulomb_friction"
    assert found.after.heldout_rmse < found.before.heldout_rmse
    assert found.after.rmse < found.before.rmse
    assert found.model.effects.keys() == {*model.effects, "coulomb_friction"}
    assert {"inertia", "delay", "coulomb_friction.level"} <= found.estimates.keys()
    assert found.estimates["coulomb_friction.level"].value == found.model.effects["coulomb_friction"]["level"]
    again = add_effect([recording], model, observer, "coulomb_friction")
    assert (again.after, again.model) == (found.after, found.model)


def test_an_effect_of_the_model_cannot_be_added(pair):
    recording, model, observer = pair
    has = PlantModel(model.inertia, model.delay, {"coulomb_friction": {"level": 0.1}})
    with pytest.raises(UsageError, match="coulomb_friction is in the model already"):
        add_effect([recording], has, observer, "coulomb_friction")


def test_an_effect_that_does_not_exist_cannot_be_added(pair):
    recording, model, observer = pair
    with pytest.raises(UsageError, match="phlogiston"):
        add_effect([recording], model, observer, "phlogiston")


def test_pulses_are_not_added_where_there_are_none(nothing):
    recording, model, observer = nothing
    with pytest.raises(DataError, match="pulse") as error:
        add_effect([recording], model, observer, "external_force")
    assert "\n" not in str(error.value)


def test_an_effect_whose_channel_is_missing_says_which(pair):
    recording, model, observer = pair
    pieces = tuple(_without_position(piece) for piece in recording.pieces)
    without = replace(recording, pieces=pieces, missing={"position": "the log has no position"})
    with pytest.raises(DataError, match=r"gravity is not testable on log\.csv: the log has no position"):
        add_effect([without], model, observer, "gravity")


def _without_position(piece):
    kept = {name: x for name, x in piece.channels.items() if name != "position"}
    return Log(kept, piece.sample_time, piece.source, piece.d_hat_source)


@pytest.mark.parametrize("factor", [0.6, 1.5])
def test_a_wrong_inertia_is_put_right(nothing, factor):
    recording, model, observer = nothing
    wrong = PlantModel(factor * model.inertia, model.delay, dict(model.effects))
    found = add_effect([recording], wrong, observer, "inertia")
    assert found.model.inertia == pytest.approx(model.inertia, rel=0.02)
    assert found.after.heldout_rmse < 0.7 * found.before.heldout_rmse
    assert found.model.effects.keys() == model.effects.keys()


def test_what_was_fitted_holds_on_a_log_that_it_never_saw(pair):
    recording, model, observer = pair
    half = len(recording.pieces[0]) // 2
    whole = recording.pieces[0]
    parts = [{name: x[a:b] for name, x in whole.channels.items()} for a, b in ((0, half), (half, None))]
    first, second = (
        replace(recording, name=n, pieces=(Log(p, whole.sample_time, n),))
        for n, p in zip(("first.csv", "second.csv"), parts, strict=True)
    )
    found = add_effect([first], model, observer, "coulomb_friction", holdout=[second])
    assert found.after.heldout_rmse < found.before.heldout_rmse
    assert np.isfinite([found.after.rmse, found.after.heldout_rmse, found.after.fit_percent]).all()


def test_what_does_not_lower_the_held_out_error_is_not_added(nothing):
    """Where nothing is missing an effect may help by chance; what does not is refused in one line."""
    recording, model, observer = nothing
    bare = pose([recording], model, Settings(effects=()))
    refit = bare.score(Search(bare).refit).heldout_rmse
    said = {}
    for name in (n for n in CANDIDATES if n not in model.effects):
        try:
            assert add_effect([recording], model, observer, name).after.heldout_rmse < refit
        except DataError as error:
            said[name] = str(error)
    assert said
    for name, text in said.items():
        assert text.startswith(f"{name} does not lower the held-out error of log.csv")
        assert "\n" not in text


def test_what_was_taken_of_a_set_ends_where_another_set_begins():
    begun = PlantModel(1.0, 0.0, {"coulomb_friction": {"level": 1.0}, "viscous_friction": {"coefficient": 1.0}})
    asked = Settings(begun=begun, begun_with=("coulomb_friction",))
    assert _taken_of(asked, "viscous_friction") == ("coulomb_friction", "viscous_friction")
    assert _taken_of(asked, "gravity") == ("gravity",)
    assert _taken_of(Settings(), "gravity") == ("gravity",)
