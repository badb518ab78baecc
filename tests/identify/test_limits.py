"""Logs on which no verdict can be sure: u is later than what it does, the sensor does not tell the direction."""

import json
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter

from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.improve import improve
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.drift_search import searched
from dsd_cli.identify.search.task import Task
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.identify.verdict.limits import limits_of
from dsd_cli.identify.verdict.unacted_command import _despiked, _without_lines
from tests.cli.rig import AXIS, done
from tests.identify.outside_rig import asked
from tests.oracle.rig import RigCase, make

DELAY_MS = 20  # of the rig
#: What stood in for a late u, and what is met most often.
FEW = ("periodic_disturbance", "coulomb_friction", "viscous_friction", "stiffness", "actuator_lag")
#: And what stands in for a u that was not the whole of it, or is hidden by that.
MORE = (*FEW, "quadratic_drag", "saturation", "presliding_friction", "backlash", "flexible_coupling")


def given(case, samples=0, spoil=dict):
    """(recording, model, observer) of a log; u so many samples later against the motion than it was, then spoilt."""
    (log,) = make([case])
    count = len(log.channels["t"]) - samples
    shown = {name: x[:count] if name in ("t", "u") else x[samples:] for name, x in log.channels.items()}
    return asked(log, spoil(shown))


def spoilt(case, spoil, effects=MORE):
    """The diagnosis of a log of which something was spoilt."""
    (log,) = make([case])
    recording, model, observer = asked(log, spoil({name: np.array(x) for name, x in log.channels.items()}))
    return diagnose([recording], model, observer, Settings(effects=effects))


@pytest.mark.parametrize("late_ms", [5, 20])
def test_a_u_that_is_later_than_its_motion_is_no_missing_effect(late_ms):
    """A line at 0.99 stood in for it once: it is said, and all is asked with u on time."""
    recording, model, observer = given(RigCase(what=(), seed=4300, sensing="speed40k"), DELAY_MS + late_ms)
    found = diagnose([recording], model, observer, Settings(effects=FEW))
    assert (found.verdict, found.mended is not None) == ("none", True)
    assert found.estimates["delay"].value == pytest.approx(model.delay, abs=2e-4)
    assert found.estimates["delay"].grade == "not"  # that of the model, of which the log says nothing
    (said,) = [w for w in found.warnings if "later than the motion" in w]
    assert float(re.search(r"by about ([0-9.]+) ms", said)[1]) == pytest.approx(late_ms, rel=0.1)


@pytest.mark.parametrize("seed", [7033, 7037])
def test_some_forty_rows_show_that_u_is_late(seed):
    """They left a ten-thousandth of the squares and were too few to say so: "delay is missing", 93 %."""
    recording, model, observer = given(RigCase(what=(), seed=seed, sensing="enc40k", duration=5.0), DELAY_MS + 5)
    found = diagnose([recording], model, observer, Settings(effects=FEW))
    assert (found.verdict, found.mended is not None) == ("none", True)


def test_logs_of_which_one_is_late_are_not_moved_together():
    """By the mean of both, each stayed off, and nothing was said to be missing."""
    made = [given(RigCase(what=(), seed=4300, sensing="speed40k"), DELAY_MS + late) for late in (8, 2)]
    recordings, (_, model, observer) = [one for one, *_ in made], made[0]
    found = diagnose(recordings, model, observer, Settings(effects=FEW))
    assert (found.verdict, found.mended) == ("unknown", None)
    assert "later than the motion" in found.blocked


def test_what_is_missing_is_named_where_u_is_the_mean_of_the_interval_before_its_stamp():
    """A held u is the mean of the interval behind its stamp: drives that log what they have measured are one late."""
    what = ("viscous_friction",)
    recording, model, observer = given(RigCase(what=what, seed=4302, sensing="speed40k", duration=10.0), DELAY_MS + 1)
    found = diagnose([recording], model, observer, Settings(effects=FEW))
    assert (found.verdict, found.mended is not None) == (*what, True)


@pytest.mark.parametrize("what", [(), ("flexible_coupling",)])
def test_a_u_without_any_delay_is_not_late(what):
    """A load that is missing makes the motor early; what was found beside it explains that."""
    recording, model, observer = given(RigCase(what=what, seed=4301, sensing="speed40k", duration=10.0), DELAY_MS)
    found = diagnose([recording], model, observer, Settings(effects=MORE))
    assert found.verdict == (what[0] if what else "delay")
    assert not any("later" in w for w in found.warnings)


def sampled_slowly(channels):
    return {name: x[::10] for name, x in channels.items()}


def with_wrong_cells(channels):
    rng = np.random.default_rng(3)
    u = np.array(channels["u"])
    u[rng.integers(0, len(u), 40)] += 20.0 * np.std(u) * rng.normal(size=40)
    return {**channels, "u": u}


@pytest.mark.parametrize(
    ("what", "spoil", "seed", "sensing", "duration"),
    [
        ((), sampled_slowly, 4401, "enc4096", 20.0),
        ((), with_wrong_cells, 4400, "speed40k", 10.0),
        (("quadratic_drag",), with_wrong_cells, 4402, "speed40k", 10.0),
    ],
    ids=["a hundred rows a second of a drive at 1 kHz", "wrong cells", "wrong cells, drag missing"],
)
def test_spikes_of_u_that_did_not_act_are_taken_off_and_hide_nothing(what, spoil, seed, sensing, duration):
    """Saturation was missing at 98 %, for it takes spikes off u; a median does that better, and is no physics. Then
    nothing was named any more."""
    found = spoilt(RigCase(what=what, seed=seed, sensing=sensing, duration=duration), spoil)
    assert found.found == what
    assert found.blocked == ""
    assert any("the median of u over" in w for w in found.warnings)


def test_all_rungs_are_of_the_u_without_the_spikes():
    (log,) = make([RigCase(what=("quadratic_drag",), seed=4402, sensing="speed40k", duration=5.0)])
    recording, model, observer = asked(log, with_wrong_cells(log.channels))
    settings = Settings(effects=(*FEW, "quadratic_drag", "saturation"))
    ladder = improve([recording], model, observer, settings, choose=lambda last: last.verdict)
    assert [step.effect for step in ladder.steps if step.kind == "added"] == ["quadratic_drag"]
    assert ladder.verdict == "none"
    assert sum("spikes" in w for w in ladder.warnings) == 1
    top = ladder.steps[-1].score
    assert top.rmse < 2.0 * top.heldout_rmse  # the values at the end are fitted without them, too


def test_a_part_of_u_is_taken_off_once_and_a_constant_u_has_none():
    """Rounding of a constant u was a line, again and again: `improve` never ended."""
    (log,) = make([RigCase(what=(), seed=7100, sensing="enc4096", duration=5.0)])
    recording, model, _ = asked(log, with_hum(with_wrong_cells(log.channels)))
    without = _despiked(recording, 3)
    assert without is not recording
    assert _despiked(without, 21) is without
    hushed, lines = _without_lines(without, model.inertia)
    assert [round(hz) for hz in lines] == [50]
    assert _without_lines(hushed, model.inertia) == (hushed, [])
    constant, *_ = asked(log, {**log.channels, "u": np.full_like(log.channels["u"], 0.3)})
    assert _despiked(constant, 3) is constant
    assert _without_lines(constant, model.inertia) == (constant, [])


def test_kicks_of_a_controller_act_whatever_a_median_leaves():
    """Beside a friction that grows with u a median of u leaves less than u; the acceleration has all of the kicks."""
    recording, model, observer = given(RigCase(what=("load_friction",), seed=6000, sensing="enc4096", duration=10.0))
    found = diagnose([recording], model, observer, Settings(effects=(*FEW, "load_friction")))
    assert not any("spikes" in w for w in found.warnings)


@pytest.mark.parametrize("what", ["saturation", "dead_zone"])
def test_a_true_effect_on_the_command_is_not_taken_for_spikes(what):
    recording, model, observer = given(RigCase(what=(what,), seed=4400, sensing="speedloud", duration=10.0))
    found = diagnose([recording], model, observer)
    assert found.verdict == what
    assert not any("spikes" in w for w in found.warnings)


def test_a_sensor_that_does_not_tell_the_direction_makes_no_verdict_sure():
    """1024 counts on a slow axis: in half of the samples nobody knows which way friction acts."""
    recording, model, observer = given(RigCase(what=("coulomb_friction",), seed=5000, sensing="enc1024", duration=10.0))
    found = diagnose([recording], model, observer, Settings(effects=MORE))
    assert found.probability <= POLICY.even
    assert any("direction of the motion" in w and "finer encoder" in w for w in found.warnings)


@pytest.mark.parametrize("sensing", ["speed40k", "enc8192jitter500"])
def test_usual_sensors_tell_the_direction(sensing):
    recording, model, _ = given(RigCase(what=("coulomb_friction",), seed=4302, sensing=sensing, duration=10.0))
    search, whole = searched(Task((recording,), model, Settings()))
    limits = limits_of(search, whole, Settings(), None)
    moving = [np.abs(s.sign[s.free > 0.0]) for s in search.equations.stretches]
    assert limits.direction == pytest.approx(np.concatenate(moving).mean())
    assert limits.direction > 0.98
    assert limits.said == ()


def behind_a_filter(channels, samples=5):
    """First order, of so many samples."""
    decay = np.exp(-1.0 / samples)
    return {**channels, "u": lfilter([1.0 - decay], [1.0, -decay], channels["u"])}


def with_hum(channels):
    """0.3 of the rms of u that a measuring lead picks up, and that moves nothing."""
    u, t = channels["u"], channels["t"]
    return {**channels, "u": u + 0.3 * np.sqrt(2.0) * np.std(u) * np.sin(2.0 * np.pi * 50.0 * t)}


def said_of_filter(found):
    """s, of the only sentence about it."""
    (said,) = [w for w in found.warnings if "signals.u_filter" in w]
    return float(re.search(r"signals\.u_filter = ([0-9.]+)", said)[1])


@pytest.mark.parametrize(
    ("what", "sensing", "delay_ms", "filter_ms"),
    [
        ((), "enc4096", DELAY_MS, 5),
        (("quadratic_drag",), "speed40k", DELAY_MS, 5),
        ((), "enc40k", 0, 20),
    ],
    ids=["nothing missing", "drag missing", "a filter longer than the delay"],
)
def test_a_filter_that_u_was_logged_behind_is_undone_and_no_load_and_no_play(what, sensing, delay_ms, filter_ms):
    """Presliding friction was missing at 99 %; then nothing could be said; and without a delay u was late."""
    case = RigCase(what=what, seed=7100, sensing=sensing, duration=10.0)
    recording, model, observer = given(case, DELAY_MS - delay_ms, partial(behind_a_filter, samples=filter_ms))
    model = replace(model, delay=1e-3 * delay_ms)
    found = diagnose([recording], model, observer, Settings(effects=MORE))
    assert (found.verdict, found.found) == (what[0] if what else "none", what)
    assert said_of_filter(found) == pytest.approx(1e-3 * filter_ms, rel=0.02)
    assert found.estimates["delay"].grade == "not"
    assert not any("later than the motion" in w for w in found.warnings)
    (lag,) = [c for c in found.ranking if c.effect == "actuator_lag"]
    assert "filter" in lag.untestable  # of which nothing says that there is none


def test_logs_behind_filters_that_differ_stay_as_they_are():
    case = RigCase(what=(), seed=7100, sensing="speed40k", duration=5.0)
    (one, model, observer), (other, *_) = given(case, 0, behind_a_filter), given(case)
    found = diagnose([one, other], model, observer, Settings(effects=FEW))
    assert found.mended is None


TRUTH = (
    AXIS
    + """effects.coulomb_friction.level = {level}

[simulate]
duration = {duration}
sample_time = 0.002
encoder_step = {step}
seed = 3
reference = {{ kind = "multisine", frequencies = {frequencies}, amplitude = 0.5 }}
controller = {{ kind = "pd", kp = {kp}, kd = {kd}, derivative = "error" }}
"""
)
SLOW, FAST = [0.7, 1.1, 2.3, 3.9], [1.7, 3.1, 5.3, 7.9, 11.3]


@pytest.mark.parametrize(
    ("level", "step", "frequencies", "gains"),
    [
        (0.05, 6e-5, SLOW, (10, 0.5)),
        (0.13, 1.5e-3, FAST, (8, 1.0)),
    ],
)
def test_steps_of_the_encoder_that_the_controller_differentiates_are_no_filter(
    level, step, frequencies, gains, tmp_path
):
    """u was "smoothed by 6 to 13 ms", 90 %, in logs that lack nothing: the steps are in u and in the acceleration."""
    found = axis(tmp_path, level, step, frequencies, gains)
    assert found["verdict"] == "none"
    assert not any("smoothed" in w for w in found["warnings"])


def axis(folder, level, step, frequencies, gains, duration=12.0, believed=0.004):
    """The diagnosis of a simulated log that lacks nothing; `believed` : delay, s, of which 4 ms are true."""
    config = TRUTH.format(level=level, step=step, frequencies=frequencies, kp=gains[0], kd=gains[1], duration=duration)
    (folder / "dsd.toml").write_text(config)
    done("simulate", "-o", "log.csv", cwd=folder)
    told = ("--set", f"model.delay={believed}")
    return json.loads(done("diagnose", "log.csv", *told, "--format", "json", cwd=folder).stdout)


@pytest.mark.parametrize(
    ("level", "gains", "duration"),
    [
        (0.2, (10, 1.0), 12.0),  # fitted: 13.8 +- 1.2 ms where the direction is sure, 2.5 ms everywhere
        (0.2, (10, 1.0), 5.0),  # at turns alone 4.9 ms
    ],
)
def test_steps_of_the_encoder_that_come_back_in_u_are_no_other_delay(level, gains, duration, tmp_path):
    """A delay of 4 ms, which was true, "is wrong" at 80 to 99 %."""
    assert axis(tmp_path, level, 1.5e-3, SLOW, gains, duration)["verdict"] == "none"


@pytest.mark.parametrize(
    ("level", "gains", "duration"),
    [(0.13, (8, 1.0), 5.0), (0.25, (10, 0.5), 5.0)],
)
def test_what_turns_leave_beside_a_coarse_encoder_is_no_missing_effect(level, gains, duration, tmp_path):
    """A lag was missing at 80 and 50 %, a cogging line at 66 %; where the direction is sure they explained nothing."""
    found = axis(tmp_path, level, 1.5e-3, SLOW, gains, duration)
    assert (found["verdict"], found["found"]) == ("none", [])
    assert any("stops and creeping" in w for w in found["warnings"])


@pytest.mark.parametrize(
    ("seed", "what", "sensing", "duration"),
    [
        (31101, "actuator_lag", "enc40k", 5.0),
        (31102, "presliding_friction", "enc4096", 10.0),
        (31102, "stribeck_friction", "enc1024", 5.0),
    ],
)
def test_a_true_effect_is_named_though_more_than_noise_is_left_at_stops_alone(seed, what, sensing, duration):
    (log,) = make([RigCase(what=("coulomb_friction", what), seed=seed, sensing=sensing, duration=duration)])
    recording, model, observer = asked(log, log.channels)
    friction = {"coulomb_friction": log.truth["effects"]["coulomb_friction"]}
    found = diagnose([recording], replace(model, effects={**model.effects, **friction}), observer)
    assert found.verdict == what


def test_a_member_of_the_set_is_judged_alone_as_the_set_has_it():
    """The scan of single effects began at another delay, where load friction lowers nothing: "unknown, 50 %"."""
    recording, model, observer = given(RigCase(what=("load_friction",), seed=60000, sensing="speed40k", duration=10.0))
    found = diagnose([recording], model, observer)
    assert (found.verdict, found.found) == ("load_friction", ("load_friction",))
    assert found.ranking[0].heldout_rmse_after < 0.3 * found.refitted.heldout_rmse


@pytest.mark.parametrize("seed", [54008, 54120])
def test_what_creeping_leaves_behind_1024_counts_is_no_law_that_nobody_knows(seed):
    """ "unknown": "gain of u and velocity" and 60 % beside known friction, "u", 90 %, without any."""
    recording, model, observer = given(RigCase(what=(), seed=seed, sensing="enc1024"))
    assert diagnose([recording], model, observer).verdict == "none"


def test_where_a_friction_would_explain_the_creeping_nothing_is_sure():
    """A strong Stribeck friction behind 4096 counts shows nowhere else: "none, 80 %", with 20 % of u unexplained."""
    recording, model, observer = given(RigCase(what=("stribeck_friction",), seed=52107, sensing="enc4096"))
    found = diagnose([recording], model, observer)
    assert found.nearest == "stribeck_friction"
    assert found.probability <= 0.5
    assert any("whether it is stribeck_friction" in line for line in found.advice)


def test_where_the_sensor_hardly_tells_a_direction_unknown_is_no_surer_than_a_name():
    recording, model, observer = given(RigCase(what=(), seed=54020, sensing="enc1024"))
    assert diagnose([recording], model, observer).probability <= 0.5


@pytest.mark.parametrize(
    ("level", "step", "frequencies", "gains", "believed"),
    [
        (0.05, 3.8e-4, SLOW, (10, 0.5), 0.024),  # fitted: 10 +- 6 ms; 24 ms leave five times what the sensor does
        (0.13, 1.5e-3, FAST, (10, 0.5), 0.0),
    ],
)
def test_a_wrong_delay_is_told_beside_such_steps(level, step, frequencies, gains, believed, tmp_path):
    found = axis(tmp_path, level, step, frequencies, gains, believed=believed)
    assert found["verdict"] == "delay"


def test_hum_in_a_measured_u_is_no_load_that_swings_there():
    """A load stands in for it exactly: one that swings at 50 Hz holds the axis still there."""
    found = spoilt(RigCase(what=(), seed=7100, sensing="enc4096", duration=10.0), with_hum)
    assert found.verdict in ("none", "unknown")
    assert not any("coupling" in effect for effect in found.found)


@pytest.mark.parametrize(
    ("seed", "sensing", "duration"),
    [(7103, "enc4096", 10.0), (18634, "speedloud", 5.0)],
)
def test_the_u_of_another_axis_is_said(seed, sensing, duration):
    """A line that moves the axis, a spring, and pushes in time were missing at 87 to 99 %."""
    cases = [RigCase(what=(), seed=one, sensing=sensing, duration=duration) for one in (seed, seed + 1)]
    another, log = make(cases)
    recording, model, observer = asked(log, {**log.channels, "u": another.channels["u"]})
    found = diagnose([recording], model, observer)
    assert (found.verdict, found.found) == ("unknown", ())
    assert any("another axis" in w for w in found.warnings)


@pytest.mark.parametrize("what", ["random_walk_load", "swinging_inertia", "gain_asymmetry"])
def test_a_law_that_no_catalogue_has_makes_no_u_of_another_axis(what):
    recording, model, _ = given(RigCase(what=(what,), seed=20011, sensing="speed40k", duration=5.0))
    search, whole = searched(Task((recording,), model, Settings(effects=MORE)))
    assert not any("another axis" in w for w in limits_of(search, whole, Settings(), None).said)


def test_a_value_given_wrongly_is_told_once_the_spikes_are_off():
    """Beside spikes nothing could be said against it, and nobody asked again: the search went on with it."""
    (log,) = make([RigCase(what=(), seed=4406, sensing="speed40k", duration=4.0)])
    recording, model, observer = asked(log, with_wrong_cells(log.channels))
    told = []
    settings = Settings(effects=FEW, known=PriorKnowledge(fixed={"inertia": 1.4 * log.truth["inertia"]}))
    ladder = improve([recording], model, observer, settings, choose=lambda last: last.verdict, on_told=told.extend)
    assert [one.value for one in told] == ["inertia"]
    assert any("spikes" in w for w in ladder.warnings)
