"""What the response shows above the band of the balance, on logs of the outside rig that do not show it in the band."""

import math
import sys
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from dsd_cli.effects.driven import driven_load
from dsd_cli.effects.memory import Coupling, load_acceleration
from dsd_cli.identify.compare.balance import force_view
from dsd_cli.identify.final_fit import add_effect
from dsd_cli.identify.fit.bank import Term, raw_columns
from dsd_cli.identify.fit.driven_load import with_driven_load
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.improve import improve
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search import response
from dsd_cli.identify.search.response import response_of
from dsd_cli.identify.search.seen import Seen
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.signals import (
    BLOCKS,
    delay_of,
    gains,
    innovations,
    signals_of,
    strongest_line,
    without_line,
)
from dsd_cli.identify.search.task import Task
from dsd_cli.identify.verdict import resonance
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle import machines, rig_parts
from tests.oracle.machine_cases import cases
from tests.oracle.rig import Exact, RigCase, RigLog, make_exact

LOADS = ("flexible_coupling", "backlash")
#: Loads, what is hidden beside them or in their place, and what stands in for them most often.
LIKELY = Settings(
    (
        *(*LOADS, "coulomb_friction", "viscous_friction", "stribeck_friction", "stiffness", "actuator_lag"),
        *("saturation", "periodic_disturbance"),
    )
)


@cache
def made(case: RigCase) -> tuple[RigLog, Exact]:
    return make_exact(case)


class Axis:
    """A log of the rig, prepared."""

    def __init__(self, what, seed, sensing="enc4096"):
        self.log, self.exact = made(RigCase(what=what, seed=seed, sensing=sensing))
        believed = self.log.believed
        self.model = PlantModel(believed["inertia"], believed["delay"], believed["effects"])
        observer = self.log.observer
        self.observer = ObserverSettings(observer["nominal_inertia"], observer["time_constant"])
        self.recording = prepare(Log(self.log.channels, self.log.sample_time, "log.csv"), self.observer)

    @property
    def truth(self):
        return next(dict(v) for name, v in self.log.truth["effects"].items() if name in LOADS)

    def response(self, doubtful=True):
        search = Search(pose([self.recording], self.model, Settings()))
        return response_of(search, search.refit, LOADS, doubtful)

    def seen(self, doubtful=True):
        return self.response(doubtful).seen

    def diagnosed(self):
        return diagnose([self.recording], self.model, self.observer, LIKELY)


@pytest.fixture(scope="module")
def swinging():
    return Axis(("flexible_coupling",), 2)


@pytest.fixture(scope="module")
def loose():
    return Axis(("backlash",), 0)


def near(values, truth, share, deviations=4.0):
    """Whether values are within that share of the truth, or within so many of their standard errors."""
    return {
        name: (value, truth[name])
        for name, (value, error) in values.items()
        if abs(value - truth[name]) > max(share * truth[name], deviations * error)
    }


def test_a_load_that_swings_far_above_the_band_of_a_coarse_encoder(swinging):
    found = swinging.seen()
    assert found.effect == "flexible_coupling"
    assert not near(found.values, swinging.truth, 0.02)


def test_play_behind_a_coarse_encoder(loose):
    found = loose.seen()
    assert found.effect == "backlash"
    assert not near(found.values, loose.truth, 0.03)


def test_a_load_that_samples_cannot_tell_is_no_explanation():
    """The squares of a simplex fall towards a stiffer load; where samples end, one that is senseless must not win."""
    (made,) = machines.run(cases("backlash", [50], amplitude="faint", sensing="position"))
    case, step = made.truth, made.truth.sample_time
    observer = ObserverSettings(case.nominal_inertia, case.observer_time_constant)
    model = PlantModel(case.believed_inertia, case.believed_delay, {name: dict(p) for name, p in case.base})
    search = Search(pose([prepare(Log(made.channels, step, "log.csv"), observer)], model, Settings()))
    found = response_of(search, search.refit, LOADS, doubtful=True).seen
    assert found.effect == "backlash"
    assert found.resonance_hz < 0.1 / step
    truth = dict(case.hidden)["backlash"]
    assert not near({name: found.values[name] for name in truth}, truth, 0.2)
    level = found.values.get("load_level", (0.0, 0.0))[0]  # there is none
    assert level < 0.01 * float(np.std(made.channels["u"]))


@pytest.mark.parametrize(
    ("what", "seed", "sensing"),
    [
        ((), 2, "speed40k"),
        ((), 2016, "enc4096"),  # long moves at constant speed: the encoder's error is a tone, fed back into u
        ((), 76080, "enc4096"),  # and so is its first harmonic, at another place and above the sampling's end
        (("actuator_lag",), 2, "speedloud"),
        (("stribeck_friction",), 2, "speedloud"),
    ],
)
def test_no_load_where_there_is_none(what, seed, sensing):
    """Even where play is looked for in any case; and noise and the tones of an encoder push nothing all along."""
    found = Axis(what, seed, sensing).response()
    assert found.seen is None
    assert what or math.isnan(found.line_hz)


def test_a_push_above_the_band_is_no_nothing():
    """A line that pushes all along, fed back into u, is said with its frequency; "nothing is missing" is not the
    answer, and no load is seen."""
    axis = Axis(("periodic_disturbance",), 3001)
    (truth,) = (v for name, v in axis.log.truth["effects"].items() if name == "periodic_disturbance")
    response = axis.response()
    assert response.seen is None
    assert response.line_hz == pytest.approx(truth["frequency"], rel=0.01)
    found = axis.diagnosed()
    assert (found.verdict, found.probability <= 0.6) == ("unknown", True)
    assert any("something pushes at" in said for said in found.warnings)


def repeating(push: float, counts: int, hz: float = 123.4, rows: int = 10_000) -> float:
    """Hz of the line that the response shows of a rigid axis which does the same each second; u is exact.

    push : at that frequency, unit of u, of which there is 0.057 rms. counts : of a turn, to which the position is had.
    """
    step, inertia = 1e-3, 0.01
    t = np.arange(rows) * step
    u = 0.05 * sum(size * np.sin(2.0 * np.pi * f * t + f) for f, size in ((3, 1.0), (7, 0.5), (16, 0.3)))
    a = (u + push * np.sin(2.0 * np.pi * hz * t)) / inertia
    v = np.cumsum(a) * step - a * step
    v -= v.mean()
    x = np.append(0.0, np.cumsum(v * step + 0.5 * a * step**2)[:-1])
    count = 2.0 * np.pi / counts
    log = Log({"t": t, "u": u, "position": np.round(x / count) * count}, step, "log.csv")
    recording = prepare(log, ObserverSettings(inertia, 5e-3))
    search = Search(pose([recording], PlantModel(inertia, 0.0, {}), Settings()))
    found = response_of(search, search.refit, LOADS, doubtful=False)
    return math.nan if found is None else found.line_hz


def test_what_is_rounded_off_a_motion_that_repeats_is_no_push():
    """It makes lines at harmonics of the motion, whatever the counts; a push larger than they are is still seen."""
    assert [hz for counts in (4096, 20_000, 65_536, 262_144) if not math.isnan(hz := repeating(0.0, counts))] == []
    for hz in (123.4, 140.35, 180.4):  # however near to a harmonic
        assert repeating(0.02, 262_144, hz) == pytest.approx(hz, abs=0.02)
    # few cycles do not say how near a harmonic is
    assert repeating(0.02, 262_144, 180.1, rows=4_000) == pytest.approx(180.1, abs=0.05)


def to_and_fro(seed: int, counts: int, swings: float = 0.0, push: float = 0.0, rate: float = 500.0):
    """The response of an axis that a loop drives to and fro in trapezoids, behind so many counts a turn; nothing else
    is in it but, above the band of the balance, half of it on a spring or a push.

    swings : Hz of motor against load, 0: rigid. push : at 90.3 Hz, so many counts far.
    """
    rng, step, fine, inertia, count = np.random.default_rng(seed), 1.0 / rate, 8, 0.1, 2.0 * np.pi / counts
    n, gain, known = round(10.0 * rate), 2.0 * np.pi * rng.uniform(3.0, 6.0), 1.0 - math.exp(-0.5)
    phase = np.arange(n) * step / rng.uniform(1.0, 2.5) % 1.0
    in_half = 2.0 * (phase % 0.5)
    speed = np.clip(np.minimum(in_half, 1.0 - in_half) / rng.uniform(0.15, 0.35), 0.0, 1.0)
    speed *= rng.uniform(0.5, 5.0) * np.where(phase < 0.5, 1.0, -1.0)
    wanted, angle = np.cumsum(speed) * step, 2.0 * np.pi * 90.3
    spring, size = (2.0 * np.pi * swings) ** 2 * inertia / 4.0, push * count * inertia * angle**2
    damper, h, act = 0.02 * math.sqrt(spring * inertia), step / fine, [0.0, 0.0]
    q = load = rng.uniform(0.0, count)
    v = w = fed = 0.0
    u, place = np.zeros(n), np.zeros(n)
    for k in range(n):
        place[k] = count * round(q / count)
        fed += known * ((place[k] - place[k - 1]) / step * (k > 0) - fed)
        u[k] = inertia * gain * (gain * (wanted[k] - place[k]) + 1.6 * (speed[k] - fed))
        act.append(float(u[k]))
        force = act.pop(0)
        for i in range(fine):
            pushed = force + size * math.sin(angle * (k * step + i * h))
            if swings:
                between = spring * (q - load) + damper * (v - w)
                v += h * (pushed - between) / (0.5 * inertia)
                w += h * between / (0.5 * inertia)
            else:
                v += h * pushed / inertia
            q, load = q + h * v, load + h * w
    recording = prepare(Log({"u": u, "position": place}, step, "log.csv"), ObserverSettings(inertia, 0.02))
    search = Search(pose([recording], PlantModel(inertia, 2.0 * step, {}), Settings()))
    return response_of(search, search.refit, LOADS, doubtful=False)


@pytest.mark.parametrize(("seed", "counts", "rate"), [(1, 8192, 500.0), (0, 8192, 500.0), (1, 4096, 250.0)])
def test_what_counts_alone_make_of_a_motion_is_neither_a_push_nor_a_load(seed, counts, rate):
    """At constant speed they are a tone, which the loop feeds back into u; between the same places the same again."""
    found = to_and_fro(seed, counts, rate=rate)
    assert found is None or (found.seen is None and math.isnan(found.line_hz))


def test_behind_the_same_counts_a_push_is_seen():
    assert to_and_fro(2, 8192, push=0.4).line_hz == pytest.approx(90.3, abs=0.05)


def test_behind_the_same_counts_a_load_is_seen():
    found = to_and_fro(2, 8192, swings=25.0).seen
    assert found.effect == "flexible_coupling"
    assert found.values["frequency"][0] == pytest.approx(25.0, rel=0.03)
    assert found.values["load_share"][0] == pytest.approx(0.5, abs=0.05)


def test_a_load_that_rattles_is_followed_beside_the_forces_that_are_true():
    """With the inertia and the gravity that a rigid axis has beside it, the true play leaves more than that axis."""
    axis = Axis(("backlash",), 7201, "speed40k")
    found = axis.diagnosed()
    assert (found.verdict, found.found) == ("backlash", ("backlash",))
    (named,) = (c for c in found.ranking if c.effect == "backlash")
    values = {name: named.parameters[name].value for name in ("gap", "load_share")}
    assert values == pytest.approx({name: axis.truth[name] for name in values}, rel=0.03)


def test_a_load_that_only_follows_the_noise_of_the_motion_is_none():
    """The balance alone halves its error by play of less than a count, for the load then takes the sensor's noise."""
    assert Axis((), 2090).diagnosed().verdict not in LOADS


def test_a_gain_without_a_value_is_not_sure():
    """An actuator lag of 1.2 +- 1.7 ms, beside friction on irregular stamps, gained enough to be named with 99 %."""
    found = Axis((), 3006, "enc8192jitter500").diagnosed()
    assert found.verdict in ("none", "unknown") or found.probability <= 0.5


def test_the_response_knows_a_load_at_the_end_of_the_band_better_than_the_balance():
    axis = Axis(("flexible_coupling",), 5)
    found = axis.diagnosed()
    assert found.verdict == "flexible_coupling"
    errors = {n: (e.value, e.std_error) for n, e in found.ranking[0].parameters.items()}
    assert not near(errors, axis.truth, 0.05)


def test_a_line_is_taken_out_between_the_bins_and_what_is_no_line_stays(swinging):
    search = Search(pose([swinging.recording], swinging.model, Settings()))
    signals = signals_of(search, search.refit, delay_of(search, search.refit))
    rows = np.flatnonzero(np.concatenate(signals.kept))  # one stretch
    noise = np.random.default_rng(6).standard_normal(len(rows))
    line = 3.0 * np.cos(2.0 * np.pi * 13.6283 * signals.step * rows + 1.0)
    calm = without_line(signals, strongest_line(signals, noise + line))
    assert np.std(calm(line)) < 0.02
    assert np.std(calm(noise) - noise) < 5.0 * math.sqrt(4 / len(rows))


def test_noise_of_any_spectrum_becomes_white():
    rng = np.random.default_rng(5)
    tone = lfilter([1.0], [1.0, -1.8 * math.cos(1.0), 0.81], rng.standard_normal(20_000))
    white = innovations(tone, 1e-3)(tone)
    lagged = [float(white[lag:] @ white[:-lag]) / float(white @ white) for lag in range(1, 30)]
    assert max(map(abs, lagged)) < 0.05  # about 5 standard errors; the tone has 0.8 after three samples
    assert np.var(white) == pytest.approx(1.0, rel=0.05)


def test_noise_that_has_other_tones_from_moment_to_moment_becomes_white():
    """As an encoder's error at one constant speed after the other; one filter for all would leave 0.2 and more."""
    rng, size = np.random.default_rng(6), 5000
    moments = [lfilter([1.0], [1.0, -1.8 * math.cos(w), 0.81], rng.standard_normal(size)) for w in (0.4, 1.1, 1.9, 2.6)]
    tones = np.concatenate(moments)
    white = innovations(tones, 1e-3)(tones)
    for moment in np.split(white[-3 * size :], 3):
        steady = moment[size // 4 : -size // 4]  # a filter is of half a second: at a change, of both tones
        lagged = [float(steady[lag:] @ steady[:-lag]) / float(steady @ steady) for lag in range(1, 30)]
        assert max(map(abs, lagged)) < 5.0 / math.sqrt(len(steady))  # standard errors


def test_the_answer_is_the_load_and_the_error_in_the_band_falls(swinging):
    found = swinging.diagnosed()
    named = found.ranking[0]
    assert (found.verdict, named.effect) == ("flexible_coupling",) * 2
    assert found.probability > 0.9
    assert "response of the acceleration" in named.note
    assert named.heldout_rmse_after < 0.6 * found.refitted.heldout_rmse
    errors = {name: e.std_error for name, e in named.parameters.items()}
    assert all(0.0 < e < math.inf for e in errors.values())
    assert not near({n: (e.value, e.std_error) for n, e in named.parameters.items()}, swinging.truth, 0.02)
    assert found.model.inertia == pytest.approx(swinging.log.truth["inertia"], rel=0.01)


def test_the_ladder_takes_it_stops_there_and_compare_sees_the_same_error(loose):
    few = Settings((*LOADS, "coulomb_friction", "viscous_friction", "stiffness", "actuator_lag"))
    ladder = improve([loose.recording], loose.model, loose.observer, few, choose=lambda d: d.verdict)
    assert [s.effect for s in ladder.steps if s.kind == "added"] == ["backlash"]
    assert ladder.verdict != "unknown"
    reached = ladder.steps[-1]
    assert reached.score.rmse < 0.5 * ladder.steps[0].score.rmse
    view = force_view([loose.recording], reached.model)
    assert view.log.rmse == pytest.approx(reached.score.rmse, rel=0.05)


def test_it_can_be_added_by_name(swinging):
    added = add_effect([swinging.recording], swinging.model, swinging.observer, "flexible_coupling")
    given = added.model.effects["flexible_coupling"]
    assert given["frequency"] == pytest.approx(swinging.truth["frequency"], rel=0.02)
    assert added.after.heldout_rmse < added.refitted.heldout_rmse


@pytest.mark.parametrize("seed", [1, 3000])
def test_play_behind_a_fine_sensor(seed):
    """From the starts of a grid a simplex ended in another valley, beside forces that were fitted without the play."""
    axis = Axis(("backlash",), seed, "speed40k")
    found = axis.seen()
    assert found.effect == "backlash"
    assert near(found.values, axis.truth, 0.05) == {}
    assert found.model.inertia == pytest.approx(axis.log.truth["inertia"], rel=0.01)
    assert found.model.delay == pytest.approx(axis.log.truth["delay"], abs=1.5e-3)


def test_a_contact_with_another_damping_bends_no_gap(monkeypatch):
    monkeypatch.setattr(rig_parts, "CONTACT_DAMPING", 0.1)
    case = RigCase(what=("backlash",), seed=0, sensing="enc4096")
    monkeypatch.setattr(sys.modules[__name__], "made", lambda _: make_exact(case))
    axis = Axis(("backlash",), 0)
    found = axis.seen()
    assert found.effect == "backlash"
    assert found.values["gap"][0] == pytest.approx(axis.truth["gap"], rel=0.03)


def test_a_saturated_drive_is_no_load():
    """A load driven by the command as it was before its limit took the whole misfit of the limit."""
    answer = Axis(("saturation",), 4000).diagnosed()
    assert answer.verdict == "saturation"
    assert set(answer.found) >= {"saturation"}


def test_what_the_response_shows_beside_friction_is_part_of_the_answer():
    answer = Axis(("backlash", "coulomb_friction"), 2, "speedloud").diagnosed()
    assert set(answer.found) == {"backlash", "coulomb_friction"}
    assert answer.verdict in answer.found


def test_a_load_in_the_band_stays_where_the_response_does_not_show_it():
    answer = Axis(("flexible_coupling", "coulomb_friction"), 1, "speed40k").diagnosed()
    assert set(answer.found) == {"flexible_coupling", "coulomb_friction"}
    assert answer.verdict in answer.found


def test_a_load_that_friction_hides_from_the_response_stays_over_a_background():
    """Several times the sensor's noise is left that no law describes, with the load as without it."""
    axis = Axis(("flexible_coupling", "coulomb_friction"), 1, "speed40k")
    over = {name: x[:8000] for name, x in axis.log.channels.items()}
    slow = lfilter([0.02], [1.0, -0.98], np.random.default_rng(8).standard_normal(8000))
    over["u"] = over["u"] + 0.03 * np.std(over["u"]) * slow / np.std(slow)
    recording = prepare(Log(over, axis.log.sample_time, "log.csv"), axis.observer)
    few = Settings((*LOADS, "coulomb_friction", "viscous_friction"))
    answer = diagnose([recording], axis.model, axis.observer, few)
    assert set(answer.found) == {"flexible_coupling", "coulomb_friction"}


def test_a_model_without_a_load_drives_none(swinging):
    (same,) = with_driven_load([swinging.recording], swinging.model)
    assert same is swinging.recording


@pytest.mark.parametrize(("seed", "sensing"), [(0, "enc4096"), (3000, "speed40k"), (3001, "speed40k")])
def test_the_load_of_a_model_moves_as_that_of_the_axis_did(seed, sensing):
    """Against the exact motion of the load, which no log tells: with play a sampled motor would not tell it either."""
    axis = Axis(("backlash",), seed, sensing)
    log, exact = axis.log, axis.exact
    model = PlantModel(log.truth["inertia"], log.truth["delay"], log.truth["effects"])
    problem = pose([axis.recording], model, Settings())
    (term,) = [t for t in problem.base if t.id == "backlash"]
    stretch = problem.errors.bank.equations.stretches[0]
    moved = raw_columns(problem.errors.bank.equations, term, log.truth["delay"])[0][0]
    first = int(np.searchsorted(exact.motion.t, -1e-9))  # the log begins here
    true = np.diff(exact.motion.load_v[first - 1 :])[: len(moved)] / log.sample_time  # the interval that ends there
    equations = problem.errors.bank.equations
    assert "push" in stretch.log
    assert 0 < stretch.begin < 500
    assert equations.centres[0][0] == max(stretch.begin, equations.startup) + equations.band.half
    late = slice(stretch.begin, None)  # from there on it has forgotten where it began
    by_motion, _ = load_acceleration(
        *(exact.motion.q[first:], exact.motion.v[first:], np.full(len(true), log.sample_time)),
        term.effect.coupling(term.shape), None,
    )  # fmt: skip
    error, other = (np.std(x[late] - true[late]) / np.std(true[late]) for x in (moved, by_motion))
    assert error < 0.05
    assert other > error


def test_beside_a_lag_a_load_is_driven_by_the_delay_that_was_found_with_it(monkeypatch):
    """Else u is late twice: by the delay without the lag, and by the lag."""
    load = {"gap": 0.01, "load_share": 0.5, "stiffness": 40.0}
    lag = {"backlash": load, "actuator_lag": {"time_constant": 2e-3}}
    believed, late, found = PlantModel(1e-3, 4e-3, {}), PlantModel(1e-3, 6e-3, {}), PlantModel(1.01e-3, 3e-3, lag)
    seen = Seen("backlash", {n: (x, 0.0) for n, x in load.items()}, (), 99.0, 0.5, 90.0, 80.0, late)
    monkeypatch.setattr(resonance, "response_of", lambda *_: response.Response(seen))
    whole = SimpleNamespace(terms=(Term("actuator_lag"),))
    scale = SimpleNamespace(model=lambda _fit: found)
    beside = SimpleNamespace(problem=SimpleNamespace(scale=scale), base=())
    monkeypatch.setattr(resonance, "searched", lambda _task: (beside, whole))
    asked = []
    monkeypatch.setattr(resonance, "searched_with", lambda _task, there: asked.append(there) or (beside, whole))
    search = SimpleNamespace(
        allowed=(*LOADS, "actuator_lag"), equations=SimpleNamespace(counting=1.0, band=SimpleNamespace(hz=50.0))
    )
    task = Task((), believed, Settings())
    shown = resonance.with_response(search, SimpleNamespace(terms=()), task, True)
    assert shown.seen is None  # the lag comes first
    assert (asked[0].delay, asked[0].inertia) == (found.delay, found.inertia)
    assert set(asked[0].effects) == {"backlash", "actuator_lag"}


@pytest.mark.parametrize(
    ("doubtful", "found", "searches"),
    [(False, "backlash", 0), (True, "backlash", 1), (False, "flexible_coupling", 1)],  # another name is another answer
)
def test_where_the_balance_leaves_noise_beside_its_load_none_is_searched_beside_the_response(
    doubtful, found, searches, monkeypatch
):
    """The effects that would make up for worse values of the load took 26 s of 29 s of a diagnosis."""
    load = {"gap": (0.0109, 0.0004), "load_share": (0.39, 0.005), "stiffness": (38.0, 1.7)}
    seen = Seen("backlash", load, (), 15e3, 0.7, 150.0, 20.0, PlantModel(0.01, 0.002, {}))
    monkeypatch.setattr(resonance, "response_of", lambda *_: response.Response(seen))
    asked = []
    problem = SimpleNamespace(errors=SimpleNamespace(rmse=lambda fit: fit.left))
    search = SimpleNamespace(
        allowed=LOADS, problem=problem, equations=SimpleNamespace(counting=1.0, band=SimpleNamespace(hz=110.0))
    )
    whole, beside = SimpleNamespace(terms=(Term(found),), left=0.013), SimpleNamespace(terms=(), left=0.023)
    monkeypatch.setattr(resonance, "searched", lambda task: asked.append(task) or (search, beside))
    task = Task((), PlantModel(0.01, 0.002, {}), Settings())
    assert resonance.with_response(search, whole, task, doubtful).whole is whole
    assert len(asked) == searches


@pytest.mark.parametrize(
    ("without", "beside", "sure", "stays"),
    [
        (14.8, 4.2, True, True),  # a belt with dry friction, which has no linear response
        (14.8, 4.2, False, False),
        (1.25, 0.4, True, False),  # the sensor leaves 1.2: what the load took may be that
        (14.8, 11.0, True, False),  # it might follow any part of what is left
    ],
)
def test_a_load_without_a_response_stays_where_it_can_be_no_noise(without, beside, sure, stays, monkeypatch):
    whole, best = (SimpleNamespace(terms=(), tap=0, left=left) for left in (beside, without))
    problem = SimpleNamespace(floor=0.75, errors=SimpleNamespace(rmse=lambda fit: fit.left))
    search = SimpleNamespace(
        allowed=LOADS,
        problem=problem,
        added=lambda _: [Term("flexible_coupling")],
        fit=lambda *_: best,
        matters=lambda *_: sure,
    )
    monkeypatch.setattr(resonance, "searched", lambda _: (search, best))
    task = Task((), PlantModel(1.0, 0.0, {}), Settings())
    found = resonance.Resonance(search, whole, Settings(), None, rattles=True)
    assert resonance._without_load(found, task).whole is (whole if stays else best)


def test_what_a_simulation_and_contacts_differ_by_is_in_the_error():
    """A contact with another damping than is simulated bends a gap by more than the simulation can know."""
    model = PlantModel(0.1, 0.0, {})

    def play(gap: float, error: float, off: float) -> Seen:
        values = {"gap": (gap, error), "load_share": (0.4, 0.01), "stiffness": (9.0, 0.1)}
        return Seen("backlash", values, (), 99.0, 0.5, 90.0, 80.0, model, off)

    contacts = play(1.02, 0.02, 0.02)
    same = response._predicted(response.Response(play(1.0, 0.001, math.nan)), contacts)
    assert same.values["gap"] == (1.0, pytest.approx(0.02, rel=0.01))
    assert same.values["stiffness"] == (9.0, pytest.approx(0.1))
    assert same.model.effects["backlash"]["gap"] == 1.0
    assert response._predicted(response.Response(play(0.8, 0.001, math.nan)), contacts) is contacts
    assert response._predicted(None, contacts) is contacts


def test_blocks_hold_equal_parts_of_what_tells_two_residuals_apart():
    """One quick move in a long record: each of the blocks has its share of the evidence."""
    rng = np.random.default_rng(3)
    better = rng.standard_normal(20_000)
    worse = better.copy()
    ringing = driven_load(np.where(np.arange(400) < 40, 1.0, 0.0), 1e-3, Coupling.of(30.0, 0.02), 0.4)
    worse[5000:5400] += 8.0 * ringing / np.abs(ringing).max()
    found = gains(worse, better)
    assert len(found) == BLOCKS
    assert found.sum() == pytest.approx(np.sum(worse**2 - better**2) / (2.0 * np.mean(better**2)), rel=0.15)
    assert found.max() < 0.2 * found.sum()


@pytest.mark.parametrize(("spread", "doubtful", "sought"), [(0.1, False, 1), (25.0, False, 0), (25.0, True, 1)])
def test_play_is_sought_where_a_load_has_a_frequency_or_something_is_left(spread, doubtful, sought, monkeypatch):
    """A load of 8.6 +- 25 Hz was the colour of the noise, and the search a third of the diagnosis."""
    target = np.random.default_rng(5).normal(size=4000)
    modes = SimpleNamespace(
        rigid=lambda: np.zeros((4000, 1)),
        columns=lambda _at: np.zeros((4000, 1)),
        left=lambda _at: 0.5 * target,
        values=lambda _at, _variance: ({"frequency": (8.6, spread), "load_share": (0.4, 0.1)}, 1e9),
    )
    signals = SimpleNamespace(target=target, step=1e-3)
    look = SimpleNamespace(signals=signals, modes=modes, at=None, of_counts=[np.zeros(4000)])
    asked: list[object] = []
    monkeypatch.setattr(response, "_play", lambda *all_of_it: asked.append(all_of_it))
    response._load_in(None, (response.PLAY, response.COUPLING), doubtful, look)
    assert len(asked) == sought
