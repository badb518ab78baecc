"""Verdicts on machines that were made without the package, and what a diagnosis promises whatever it says."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.effects import catalogue
from dsd_cli.errors import DataError, UsageError
from dsd_cli.identify.fit.problem import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.machine_cases import cases
from tests.oracle.machines import run

#: What is hidden -> the verdict that names it.
NAMED = {
    "coulomb_friction": "coulomb_friction",
    "viscous_friction": "viscous_friction",
    "gravity": "gravity",
    "cogging": "cogging",
    "stiffness": "stiffness",
    "inertia": INERTIA,
    "delay": DELAY,
    "none": NONE,
}
#: Nothing is missing from these but a value.
COMPLETE = ("none", "inertia", "delay")
LACKING = [name for name in NAMED if name not in COMPLETE]
DURATION = 5.0
#: Where only the sensor is in question.
FEW = Settings(effects=("coulomb_friction", "gravity", "stiffness", "dead_zone", "quadratic_drag", "viscous_friction"))


def rig(recording):
    """(log, believed model, observer) of a recording of the oracle."""
    case = recording.truth
    log = Log(recording.channels, case.sample_time, "log.csv")
    model = PlantModel(case.believed_inertia, case.believed_delay, dict(case.base))
    return log, model, ObserverSettings(case.nominal_inertia, case.observer_time_constant)


def diagnosed(recording, **more):
    log, model, observer = rig(recording)
    return diagnose([prepare(log, observer)], model, observer, **more)


def numbers(diagnosis):
    """Every number in a diagnosis with the place where it stands; NaN stands for what could not be tested."""
    yield "probability", diagnosis.probability
    yield "noise", diagnosis.noise
    yield "floor", diagnosis.floor
    yield "band", diagnosis.band_hz
    yield "ceiling", diagnosis.ceiling.heldout_rmse
    for name in ("score", "refitted"):
        yield from ((f"{name}.{key}", value) for key, value in vars(getattr(diagnosis, name)).items())
    for key, e in diagnosis.estimates.items():
        yield key, e.value
        yield f"error of {key}", e.std_error
    for c in diagnosis.ranking:
        if not c.untestable:
            yield f"{c.effect}.rmse", c.rmse_after
            yield f"{c.effect}.before", c.heldout_rmse_before
            yield f"{c.effect}.after", c.heldout_rmse_after
            yield f"{c.effect}.probability", c.probability
            for key, e in c.parameters.items():
                if f"not identifiable from this log: {key}" in c.note:
                    continue
                yield f"{c.effect}.{key}", e.value
                yield f"error of {c.effect}.{key}", e.std_error


@pytest.fixture(scope="module")
def logs():
    found = run([case for name in NAMED for case in cases(name, [1], duration=DURATION)])
    return dict(zip(NAMED, found, strict=True))


@pytest.fixture(scope="module")
def answers(logs):
    """Made when they are asked for, once."""
    return _Answers(logs)


class _Answers:
    def __init__(self, logs):
        self._logs, self._known = logs, {}

    def __getitem__(self, name):
        if name not in self._known:
            self._known[name] = diagnosed(self._logs[name])
        return self._known[name]


@pytest.mark.parametrize("name", NAMED)
def test_a_plain_effect_is_named(answers, name):
    assert answers[name].verdict == NAMED[name]


@pytest.mark.parametrize("name", LACKING)
def test_its_values_are_those_of_the_machine(answers, logs, name):
    leader = answers[name].ranking[0]
    assert leader.effect == name
    for key, value in dict(logs[name].truth.hidden)[name].items():
        estimate = leader.parameters[key]
        if key == "phase":
            assert math.cos(estimate.value - value) > 0.97
        else:
            allowed = 6.0 * estimate.std_error + 0.03 * abs(value)
            assert abs(estimate.value - value) < allowed, f"{key}: {estimate.value} for {value}"


def test_a_wrong_inertia_and_a_wrong_delay_are_put_right(answers, logs):
    for name in (INERTIA, DELAY):
        true = getattr(logs[name].truth, name)
        assert answers[name].estimates[name].value == pytest.approx(true, rel=0.03)
        assert answers[name].ranking[0].effect == name


@pytest.mark.parametrize("name", NAMED)
def test_shares_of_belief_are_in_order(answers, name):
    d = answers[name]
    assert 0.0 <= d.probability < 1.0
    assert all(0.0 <= c.probability <= 1.0 for c in d.ranking)
    assert d.ceiling.heldout_rmse > 0.0


@pytest.mark.parametrize("name", COMPLETE)
def test_freeing_all_values_of_a_complete_model_raises_no_error(answers, name):
    """Where an effect is missing the fit, best in whitened rows, follows that instead."""
    assert answers[name].refitted.rmse <= answers[name].score.rmse * 1.002


@pytest.mark.parametrize("name", LACKING)
def test_the_leader_lowers_the_held_out_error_and_is_the_model_with_that_effect(answers, name):
    d = answers[name]
    leader = d.ranking[0]
    assert leader.heldout_rmse_after < leader.heldout_rmse_before
    assert leader.heldout_rmse_before == d.refitted.heldout_rmse
    assert leader.model.effects.keys() == {*d.refitted_model.effects, name}


@pytest.mark.parametrize("name", NAMED)
def test_no_number_is_nan(answers, name):
    assert [place for place, value in numbers(answers[name]) if not math.isfinite(value)] == []


@pytest.mark.parametrize("name", NAMED)
def test_every_effect_is_ranked_once_or_is_in_the_model_already(answers, logs, name):
    ranked = [c.effect for c in answers[name].ranking]
    assert len(ranked) == len(set(ranked))
    assert {INERTIA, DELAY} <= set(ranked)
    assert not set(ranked) & {effect for effect, _ in logs[name].truth.base}
    assert set(ranked) <= {*catalogue(), INERTIA, DELAY}


@pytest.mark.parametrize("name", NAMED)
def test_how_far_the_sensor_sees_is_told(answers, name):
    assert 2.0 <= answers[name].band_hz <= 0.125 / 0.001


@pytest.mark.parametrize("name", LACKING)
def test_a_verdict_is_among_what_was_found(answers, name):
    assert answers[name].verdict in answers[name].found


@pytest.mark.parametrize("name", COMPLETE)
def test_a_wrong_value_is_no_effect_that_was_found(answers, name):
    assert answers[name].found == ()


@pytest.mark.parametrize("name", [n for n in NAMED if n != "none"])
def test_what_is_missing_stands_above_the_floor_of_the_sensor(answers, name):
    assert answers[name].score.rmse > 2.0 * answers[name].floor


def test_where_nothing_is_missing_only_the_noise_of_the_sensor_is_left(answers):
    assert answers["none"].score.rmse == pytest.approx(answers["none"].floor, rel=0.25)


def test_the_error_is_that_of_the_balance_of_forces(answers, logs):
    """Of the model as given, by hand: u late, less J times the slope of the speed, far below the band's end."""
    log, model, _ = rig(logs["gravity"])
    t, size = log["t"], 200
    late = np.interp(t - model.delay - 0.5 * log.sample_time, t + 0.5 * log.sample_time, log["u"])
    slope = np.diff(log["velocity"], prepend=log["velocity"][0]) / log.sample_time
    damping = model.effects.get("viscous_friction", {}).get("coefficient", 0.0)
    r = late - model.inertia * slope - damping * log["velocity"]
    mean = np.convolve(r, np.ones(size) / size, "valid")[size:]
    assert np.sqrt(np.mean(mean**2)) == pytest.approx(answers["gravity"].score.rmse, rel=0.1)


@pytest.mark.parametrize("name", ["coulomb_friction", "none"])
def test_an_encoder_of_4096_counts_is_enough(name):
    """The sensor of most axes, and nothing else: seen through an observer this was indistinguishable from noise."""
    made = [replace(case, encoder_step=2 * np.pi / 4096) for case in cases(name, [1, 2], sensing="position")]
    assert [diagnosed(recording, settings=FEW).verdict for recording in run(made)] == [name, name]


def test_the_same_log_gives_the_same_answer_twice(answers, logs):
    again = diagnosed(logs["viscous_friction"])
    assert list(numbers(again)) == list(numbers(answers["viscous_friction"]))
    assert again.verdict == answers["viscous_friction"].verdict


def test_time_may_begin_anywhere(answers, logs):
    recording = logs["viscous_friction"]
    channels = {**recording.channels, "t": recording.channels["t"] + 1000.0}
    later = diagnosed(replace(recording, channels=channels))
    assert later.verdict == answers["viscous_friction"].verdict
    assert later.score.rmse == pytest.approx(answers["viscous_friction"].score.rmse, rel=1e-6)


def test_units_do_not_matter(answers, logs):
    """u and d_hat in mNm, all else as it was: the verdict and every share stay."""
    recording = logs["gravity"]
    log, model, observer = rig(recording)
    scaled = {name: x * (1000.0 if name in ("u", "d_hat") else 1.0) for name, x in log.channels.items()}
    base = {
        name: {key: v * (1000.0 if key in ("coefficient", "level", "force") else 1.0) for key, v in values.items()}
        for name, values in model.effects.items()
    }
    bigger = PlantModel(1000.0 * model.inertia, model.delay, base)
    watched = replace(observer, nominal_inertia=1000.0 * observer.nominal_inertia)
    found = diagnose([prepare(replace(log, channels=scaled), watched)], bigger, watched)
    wanted = answers["gravity"]
    assert found.verdict == wanted.verdict
    assert found.score.rmse == pytest.approx(1000.0 * wanted.score.rmse, rel=1e-6)
    assert found.ranking[0].parameters["amplitude"].value == pytest.approx(
        1000.0 * wanted.ranking[0].parameters["amplitude"].value, rel=1e-3
    )


def test_the_other_sign_of_d_hat_is_the_same_log(answers, logs):
    log, model, observer = rig(logs["viscous_friction"])
    turned = replace(log, channels={**log.channels, "d_hat": -log["d_hat"]})
    minus = replace(observer, sign=-1)
    found = diagnose([prepare(turned, minus)], model, minus)
    assert dict(numbers(found)) == pytest.approx(dict(numbers(answers["viscous_friction"])))


def test_what_no_effect_explains_is_unknown():
    (recording,) = run(cases("speed_position_force", [1], duration=8.0))
    found = diagnosed(recording)
    assert found.verdict == UNKNOWN
    assert found.score.heldout_rmse > found.noise


@pytest.mark.parametrize("sensing", ["velocity", "position", "d_hat"])
def test_every_kind_of_log_names_friction(sensing):
    (recording,) = run(cases("coulomb_friction", [1], sensing=sensing, duration=DURATION))
    assert diagnosed(recording, settings=FEW).verdict == "coulomb_friction"


def test_effects_without_their_channel_are_listed_with_the_reason(logs):
    log, model, observer = rig(logs["none"])
    recording = replace(prepare(log, observer), missing={"position": "it would drift away"})
    found = diagnose([recording], PlantModel(model.inertia, model.delay), observer)
    untestable = {c.effect: c.untestable for c in found.ranking if c.untestable}
    assert {"gravity", "cogging", "stiffness", "cubic_stiffness"} <= set(untestable)
    assert set(untestable.values()) == {recording.missing["position"]}
    assert [c.effect for c in found.ranking][-len(untestable) :] == list(untestable)
    assert found.verdict not in untestable


def test_a_model_whose_own_effect_lacks_its_channel_is_an_error(logs):
    log, model, observer = rig(logs["none"])
    recording = prepare(log, observer)
    without = replace(recording, missing={"position": "no position"})
    believed = PlantModel(model.inertia, model.delay, {"gravity": {"amplitude": 0.1, "phase": 0.0}})
    with pytest.raises(DataError, match="gravity needs position"):
        diagnose([without], believed, observer)


def test_two_logs_of_one_rig_are_better_than_one():
    first, second = run(
        [replace(case, seed=s) for s in (1, 2) for case in cases("viscous_friction", [1], duration=DURATION)]
    )
    log, model, observer = rig(first)
    both = diagnose([prepare(r, observer) for r in (log, rig(second)[0])], model, observer, FEW)
    one = diagnose([prepare(log, observer)], model, observer, FEW)
    assert both.verdict == one.verdict == "viscous_friction"
    assert both.samples == 2 * one.samples
    errors = [d.ranking[0].parameters["coefficient"].std_error for d in (one, both)]
    assert errors[1] < errors[0]


def _log(u, velocity, rows=3000, **more):
    t = 0.001 * np.arange(rows)
    return Log({"t": t, "u": u(t), "velocity": velocity(t), **more}, 0.001, "log.csv")


def _still(t):
    return np.zeros(len(t))


def _sine(t):
    return np.sin(2 * np.pi * 2.0 * t)


@pytest.mark.parametrize(
    ("log", "said"),
    [
        (_log(_sine, _still), "does not move"),
        (_log(_still, _still), "does not move"),
        (_log(_still, _sine), "u is 0"),
        (_log(_sine, _sine, rows=80), "too short"),
        (_log(_sine, _sine, rows=52), "too short"),
        (_log(_sine, _sine, rows=40), "40 samples"),
    ],
    ids=["still", "dead", "u is 0", "short", "very short", "scrap"],
)
def test_hopeless_logs_are_one_line(log, said):
    observer = ObserverSettings(0.01, 0.01)
    with pytest.raises(DataError, match=said) as error:
        diagnose([prepare(log, observer)], PlantModel(0.01), observer)
    text = str(error.value)
    assert "\n" not in text
    assert text.startswith("log.csv")


def test_a_constant_position_is_a_still_axis():
    t = 0.001 * np.arange(3000)
    log = Log({"t": t, "u": np.sin(9 * t), "position": np.full(3000, 1.3)}, 0.001, "log.csv")
    observer = ObserverSettings(0.01, 0.01)
    with pytest.raises(DataError, match="does not move"):
        diagnose([prepare(log, observer)], PlantModel(0.01), observer)


def test_a_candidate_that_does_not_exist_is_refused(logs):
    with pytest.raises(UsageError):
        diagnosed(logs["none"], settings=Settings(effects=("phlogiston",)))


def test_progress_goes_up_to_one(logs):
    seen = []
    diagnosed(logs["none"], progress=lambda what, share: seen.append(share))
    assert seen == sorted(seen)
    assert seen[0] == 0.0
    assert seen[-1] == 1.0


def test_the_held_out_error_is_that_of_the_recordings_that_no_fit_saw():
    """Of the model as given: what it leaves of the second log alone, within the band of the first."""
    first, second = run([replace(case, seed=s) for s in (1, 2) for case in cases("none", [1], duration=DURATION)])
    log, model, observer = rig(first)
    quiet, aside = prepare(log, observer), prepare(rig(second)[0], observer)
    wrong = replace(model, inertia=1.3 * model.inertia)
    found = diagnose([quiet], wrong, observer, Settings(effects=()), holdout=[aside])
    alone = diagnose([aside], wrong, observer, Settings(effects=()))
    assert found.score.heldout_rmse == pytest.approx(alone.score.rmse, rel=0.1)
    assert found.score.rmse != pytest.approx(alone.score.rmse, rel=0.02)
    assert found.verdict == INERTIA
    assert found.refitted.heldout_rmse < 0.5 * found.score.heldout_rmse
