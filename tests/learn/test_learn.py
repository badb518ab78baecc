"""Learning a law: the numbers behind it against independent ones, and laws that must be refused."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

from dsd_cli.effects import Channels, load_effects
from dsd_cli.effects.general import INERTIA_CURVE
from dsd_cli.effects.tables import Table, table_of
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.results import Estimate
from dsd_cli.identify.search.sets import Search
from dsd_cli.learn import judge as judging
from dsd_cli.learn.choose import contains
from dsd_cli.learn.dictionary import Kind, effect_of, kinds
from dsd_cli.learn.families import FAMILIES, comes_by_again, natural_spline
from dsd_cli.learn.formula import Term, nelder_mead
from dsd_cli.learn.formulate import identified
from dsd_cli.learn.law_file import law_source
from dsd_cli.learn.learning import learn
from dsd_cli.learn.rows import balance_of, covariance_of
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log, with_channels
from tests.identify.search_rig import BELIEVED, seen
from tests.oracle.rig_strange import make
from tests.oracle.rig_strange_laws import Law

ALL = list(kinds(("velocity", "position", "u")))


def asked(law, sensor="speed40k", seed=1, motion="moves", push=None, laws=None):
    log = make(law, seed, sensor, motion, duration=12.0, laws=laws)
    channels = dict(log.channels)
    if push is not None:
        channels["u"] = channels["u"] - push(channels["t"], log)
    recording = prepare(Log(channels, 1e-3, "log"), ObserverSettings(log.inertia, 0.01))
    return log, recording, PlantModel(log.inertia, log.delay, log.believed)


def test_the_spline_between_knots_is_the_natural_one():
    rng = np.random.default_rng(0)
    knots = np.sort(rng.uniform(-1.0, 2.0, 9))
    values, at = rng.standard_normal(9), np.linspace(knots[0], knots[-1], 101)
    wanted = CubicSpline(knots, values, bc_type="natural")(at)
    np.testing.assert_allclose(natural_spline(knots, at) @ values, wanted, atol=1e-12)


def test_no_law_stands_beside_one_that_may_be_it_as_well():
    """A table over velocity and position has any function of the two: beside it they would be large and opposite."""
    named = {family.name: family for family in FAMILIES}
    both = named["a function of velocity and position"]
    beside = {name for name, family in named.items() if not contains(both, family)}
    assert {"a function of the velocity", "friction over the position", "damping over the position"}.isdisjoint(beside)
    assert {"friction over time", "hysteresis", "an inertia over the position", "a function of u"} <= beside
    assert not contains(named["a function of the velocity"], both)


KNOTS = np.linspace(-1.0, 1.0, 8)
TURNS = np.linspace(0.0, 4.0 * np.pi, 4000)


@pytest.mark.parametrize(
    ("path", "share"),
    [
        ((np.cos(TURNS), np.sin(TURNS)), 1.0),  # two turns of a circle
        ((np.cos(0.4 * TURNS), np.sin(0.4 * TURNS)), 0.0),  # most of one
        ((np.cos(0.75 * TURNS), np.sin(0.75 * TURNS)), 0.7),  # one and a half
        ((np.cos(0.6 * TURNS), np.sin(0.6 * TURNS)), 0.38),  # one and a fifth
        ((0.08 * TURNS * np.cos(TURNS), 0.08 * TURNS * np.sin(TURNS)), 0.0),  # outwards, a knot or more a turn
        ((np.linspace(-1.0, 1.0, 4000), 0.02 * np.sin(20.0 * TURNS)), 0.0),  # a line that wavers over a knot
    ],
)
def test_a_path_comes_by_again_only_from_elsewhere(path, share):
    """A surface over two channels is known where their path meets itself, and not because noise crosses a knot."""
    found = comes_by_again((KNOTS, KNOTS), path)
    assert found == pytest.approx(share, abs=0.05 * (0.0 < share < 1.0))


def test_a_place_that_is_passed_once_is_a_moment():
    """Of a force over the position that a log passes once nobody can say that it is none over time."""
    way = np.linspace(-1.0, 1.0, 4000)
    assert comes_by_again((KNOTS,), (way,)) == 0.0
    assert comes_by_again((KNOTS,), (np.sin(3.0 * np.pi * way),)) == 1.0


@pytest.mark.parametrize("strength", [(2.0, 1.0), (-40.0, 12.0)])
def test_a_strength_is_told_from_zero_or_there_is_no_formula(strength):
    value, error = strength
    assert identified({"coefficient": Estimate(value, abs(value) / 3.1, "")})
    assert not identified({"coefficient": Estimate(value, error * 1.7, ""), "width": Estimate(1.0, 0.0, "")})
    assert not identified({"amplitude": Estimate(value, math.nan, ""), "phase": Estimate(0.0, 0.1, "rad")})


@pytest.mark.parametrize("start", [(-1.0, 2.0), (0.4, 0.1)])
def test_the_simplex_ends_where_that_of_scipy_does(start):
    def of(x):
        return (x[0] - 0.3) ** 2 + 3.0 * (x[1] + 0.2 * x[0]) ** 2 + 1.0

    found = nelder_mead(of, np.array(start), np.array([0.3, 0.3]), 150)
    np.testing.assert_allclose(found, minimize(of, start, method="Nelder-Mead").x, atol=2e-3)


@pytest.mark.parametrize("kind", ALL, ids=lambda k: f"{k.base}-{k.modulation}-{k.over}")
def test_every_term_has_a_file_that_is_the_same_law(kind: Kind, tmp_path):
    shape = dict.fromkeys(kind.parameters, 0.7)
    term = Term(kind, tuple(shape.items()))
    sine = kind.modulation == "sine"
    values = {"amplitude": 1.3, "phase": 0.4, **shape} if sine else {"coefficient": 1.3, **shape}
    path = tmp_path / "law.py"
    path.write_text(law_source([term], ["my_law"], [values]))
    (effect,) = load_effects(path)
    rng = np.random.default_rng(1)
    at = Channels(np.linspace(0.0, 3.0, 40), *rng.standard_normal((3, 40)), np.full(40, 1e-3))
    coefficients, given = effect.to_columns(values)
    for a, b in zip(effect.run(at, given)[0], effect_of(kind).run(at, shape)[0], strict=True):
        np.testing.assert_array_equal(a, b)
    assert effect.role is effect_of(kind).role
    assert effect.starts(None)[0].keys() == shape.keys()
    assert dict(effect.from_columns(coefficients, given)) == pytest.approx(values)


@pytest.mark.parametrize(
    ("law", "channels", "effects"),
    [
        ("end_stop", {"position"}, ("learnt_force_beyond_q",)),
        ("torque_ripple", {"u", "position"}, ("learnt_gain_sine_q",)),
        ("lugre", {"memory"}, None),
    ],
)
def test_channels_formula_and_a_falling_error(law, channels, effects):
    """A drag that the machine has not is taken back beside the law; dry friction stays where the law has none."""
    log, recording, model = asked(law)
    model = model.changed(effects={"quadratic_drag": {"coefficient": 0.1 * log.inertia}})
    found = learn([recording], model, stand_ins=("quadratic_drag", "coulomb_friction"))
    first, last = found.rungs[0].score, found.rungs[-1].score
    assert last.heldout_rmse != first.heldout_rmse  # each rung has the error of its own model
    gone = [rung.effect for rung in found.rungs if rung.kind == "taken back"]
    assert gone[0] == "quadratic_drag"
    assert gone[1:] == [] or law == "lugre"  # bristles have dry friction
    assert (found.verdict, set(found.channels)) == ("learnt", channels)
    assert found.after.heldout_rmse < 0.15 * found.refitted.heldout_rmse
    assert found.model.inertia == pytest.approx(log.inertia, rel=0.02)
    if effects:
        assert found.formula is not None
        assert found.formula.effects == effects


def _relaxing(s, q, v, h):
    s.z = s.z * math.exp(-h / s.tau) + v * s.tau * -math.expm1(-h / s.tau)


RELAXING = Law(
    "",
    lambda s: {"z": 0.0, "tau": s.between(0.08, 0.4)},
    lambda s, t, q, v, u: -4.0 * s.size * s.z,
    ("memory",),
    after=_relaxing,
)


def test_one_spring_that_relaxes_has_one_time_constant_and_the_level_of_its_damper():
    """A spring of 4 size behind a damper (Maxwell): the lag of the velocity times 4 size tau."""
    log, recording, model = asked("relaxing", seed=3, laws={"relaxing": RELAXING})
    found = learn([recording], model)
    (curve,) = found.curves
    assert (curve.channels, found.family) == (("time constant",), "springs that relax")
    assert curve.knots[0] == pytest.approx((log.values["tau"],), rel=0.03)
    assert curve.values == pytest.approx((4.0 * log.values["size"] * log.values["tau"],), rel=0.05)
    assert found.model.effects["lagged_friction"]["levels"] == pytest.approx(curve.values, rel=0.03)


@pytest.mark.parametrize(("law", "seed"), [("bouc_wen", 4), ("lugre", 5)])
def test_hysteresis_with_one_state_comes_out_with_the_numbers_that_made_it(law, seed):
    """h' = v/zy (1 - h^2 (1 + sgn(v h))/2), up to 1.2 size; z' = v - sigma |v| z/(size (1 + 0.6 exp(-(v/vs)^2)))."""
    log, recording, model = asked(law, seed=seed)
    found = learn([recording], model)
    drawn, size = log.values, log.values["size"]
    if law == "bouc_wen":
        effect, slow = "bouc_wen", 1.2 * size
        wanted = {"level": slow, "stiffness": slow / drawn["zy"], "exponent": 2.0, "unloading": 1.0}
    else:  # four distances are hardly enough
        effect, slow = "lugre_friction", 1.6 * size * (1.0 - math.exp(-4.0 / 1.6))
        wanted = {"level": size, "stiffness": drawn["sigma"], "excess": 0.6 * size, "velocity": drawn["vs"]}
    assert (found.channels, found.formula.effects, found.formula.known) == (("memory",), (effect,), False)
    values = found.model.effects[effect]
    assert {name: values[name] for name in wanted} == pytest.approx(wanted, rel=0.06)
    for name, true in wanted.items():
        one = found.formula.parameters[f"{effect}.{name}"]
        assert abs(one.value - true) < max(5.0 * one.std_error, 0.02 * true)
    (curve,) = found.curves
    assert (curve.channels, curve.effect) == (("way",), effect)
    assert curve.values[-1] == pytest.approx(slow, rel=0.06)
    assert curve.low[-1] < curve.values[-1] < curve.high[-1]
    assert found.after.heldout_rmse < 0.1 * found.refitted.heldout_rmse


def test_an_inertia_looks_at_the_acceleration_of_its_interval():
    """-(D a + D' v^2/2) in the middle of each interval, out of a motion that is known."""
    t, w = 1e-3 * np.arange(8000), 2.0 * math.pi * 6.0
    speed, place = 2.0 * np.cos(w * t), 2.0 / w * np.sin(w * t)
    log = Log({"t": t, "u": np.sin(3.0 * t), "velocity": speed, "position": place}, 1e-3, "log")
    recording = prepare(log, ObserverSettings(1.0, 0.01))
    balance = balance_of(pose([recording], PlantModel(1.0), Settings(effects=())), 0.0)
    (found,) = balance.columns(INERTIA_CURVE, {"table": Table(("position",), ((-1.0, 1.0),), (-0.5, 0.5))})
    x = w * (t - 0.5e-3)
    wanted = 0.5 * (2.0 / w * np.sin(x) * -2.0 * w * np.sin(x) + 0.5 * (2.0 * np.cos(x)) ** 2)
    (stretch,) = balance.equations.stretches
    rows = balance.equations.acting([np.interp(stretch.frame.times, t, wanted)], True, True)
    np.testing.assert_allclose(found, rows, atol=0.003 * float(np.max(np.abs(rows))))


CUSPS = Law(
    "",
    lambda s: {"n": s.between(4.0, 8.0)},
    lambda s, t, q, v, u: 1.5 * s.size * abs(math.sin(s.n * q)),
    ("position",),
)


@pytest.mark.parametrize(("sensor", "motion"), [("speed40k", "moves"), ("enc40k", "sines")])
def test_a_curve_is_as_fine_as_the_log_supports_and_its_band_holds_the_law(sensor, motion):
    """A force over the position with cusps; by sines with an encoder the log has no rows for twice the knots again."""
    log, recording, model = asked("cusps", sensor, seed=11, motion=motion, laws={"cusps": CUSPS})
    found = learn([recording], model)
    (curve,) = found.curves
    assert curve.channels == ("position",)
    height, knots = 1.5 * log.values["size"], np.array(curve.knots[0])
    true, (low, high) = height * np.abs(np.sin(log.values["n"] * knots)), np.array([curve.low, curve.high])
    known = np.isfinite(low)
    assert np.sqrt(np.mean((np.array(curve.values) - true)[known] ** 2)) < 0.02 * height
    assert np.mean((low <= true)[known] & (true <= high)[known]) >= 0.9


@pytest.mark.parametrize(("sensor", "motion"), [("speed40k", "moves"), ("enc4096", "sines"), ("enc40k", "moves")])
def test_nothing_is_learnt_from_a_complete_model(sensor, motion):
    _, recording, model = asked("nothing", sensor, seed=7, motion=motion)
    assert learn([recording], model).verdict == "none"


def test_no_law_of_u_where_u_hardly_moves_the_axis():
    """A crawl with ripple: J a is a hundredth of u, so that u = u (1 + anything) would fit."""
    rng = np.random.default_rng(3)
    t = 1e-3 * np.arange(12_000)
    speed = 0.8 * np.sign(np.sin(2.0 * np.pi * t / 6.0)) * np.minimum(np.abs(np.sin(2.0 * np.pi * t / 6.0)) * 20.0, 1.0)
    q = np.cumsum(speed) * 1e-3
    a = np.gradient(speed, 1e-3)
    u = 1e-3 * a + 0.3 * np.sign(speed) + 0.5 * np.sin(7.0 * q) + 0.2 * np.sin(3.0 * q + 1.0) * np.sign(speed)
    q = q + 1e-5 * rng.standard_normal(len(q))
    recording = prepare(Log({"t": t, "u": u, "position": q}, 1e-3, "log"), ObserverSettings(1e-3, 0.01))
    found = learn([recording], PlantModel(1e-3, 0.0, {"coulomb_friction": {"level": 0.3}}))
    assert "u" not in found.channels
    assert found.formula is None or not any("gain" in name or "size" in name for name in found.formula.effects)


def test_a_force_over_time_is_no_law_of_the_motion():
    def wander(t, log):
        walk = np.cumsum(np.random.default_rng(5).standard_normal(13))
        return 8.0 * log.inertia * np.interp(t, np.arange(13.0), walk - walk.mean())

    _, recording, model = asked("nothing", push=wander)
    found = learn([recording], model)
    assert found.verdict == "not a function of the motion"
    assert "time" in found.why
    assert found.model.effects.keys() == model.effects.keys()


@pytest.mark.parametrize(("true", "dry"), [("inertia", 5.0), ("gain", 25.0)])
def test_a_gain_over_time_is_said_to_be_an_inertia_as_well_where_nothing_tells(true, dry):
    """J falls by a quarter, or the gain of u rises by a third, in the middle of the log. Without friction the two are
    one law, and both are said; dry friction, which a gain does not leave alone, tells them apart."""
    rng = np.random.default_rng(3)
    t = 1e-3 * np.arange(20_000)
    hz, phase = np.array([0.3, 0.7, 1.3, 1.9]), rng.uniform(0.0, 6.0, 4)
    w, size = 2.0 * np.pi * hz, 0.3 / hz
    middle = np.outer(t + 5e-4, w) + phase  # of the interval in which u is held
    q, v, a = np.sin(np.outer(t, w) + phase) @ size, np.cos(middle) @ (size * w), -np.sin(middle) @ (size * w**2)
    changed = np.where(t < 10.0, 1.0, 0.75)
    u = changed * a + dry * np.sign(v) if true == "inertia" else changed * (a + dry * np.sign(v))
    log = Log({"t": t, "u": u, "position": q + 1e-5 * rng.standard_normal(len(q))}, 1e-3, "log")
    own = {"coulomb_friction": {"level": dry}} if dry else {}
    found = learn([prepare(log, ObserverSettings(1.0, 0.01))], PlantModel(1.0, 0.0, own))
    assert (found.verdict, found.family) == ("learnt", "a gain of u over time")
    named = {one.family: one for one in found.ties}
    assert ("an inertia that changes over time" in named) == (true == "inertia")
    if true == "inertia":
        assert "early and late" in named["an inertia that changes over time"].separate


@pytest.mark.parametrize(("law", "seed"), [("cross_term", 5), ("gain_by_sign", 6)])
def test_the_delay_is_found_beside_the_law(law, seed):
    """Without the law u looks early or late: a delay that stayed there would leave more than the true force does."""
    log, recording, model = asked(law, seed=seed)
    found = learn([recording], model)
    assert found.model.delay == pytest.approx(log.delay, abs=2e-4)
    # u of sample k acts from there on a delay later, when the force of the law is that of the sample after
    _, known, model = asked(law, seed=seed, push=lambda t, log: -np.interp(t + log.delay + 1e-3, t, log.truth))
    problem = pose([known], model, Settings(effects=()))
    least = problem.score(Search(problem).refit).heldout_rmse
    assert found.after.heldout_rmse < 1.1 * least
    assert found.after.rmse < 1.1 * least


@pytest.mark.parametrize(
    ("law", "times", "true"),
    [
        ("eddy_brake", 2.0, lambda s, x: -2.5 * s["size"] * (x / s["vc"]) / (1.0 + (x / s["vc"]) ** 2)),
        ("end_stop", 1.4, lambda s, x: -12.0 * s["size"] * np.maximum(x - s["q0"], 0.0)),
        ("gain_by_sign", 9.0, lambda s, x: s["share"] * np.abs(x)),
    ],
)
def test_a_formula_goes_on_where_a_larger_motion_goes(law, times, true):
    """Its table would be held from the end of what the log visited on, where an eddy brake gets weaker and a stop
    harder; u grows with the square of the speed, and a gain of it goes on for ever."""
    log, recording, model = asked(law, seed=4)
    found = learn([recording], model)
    (table,) = (table_of(values, name) for name, values in found.model.effects.items() if name.startswith("curve"))
    (name,) = table.channels
    seen = {"position": log.motion[0], "velocity": log.motion[1], "u": log.channels["u"]}[name]
    x, still = np.array([-times, 0.3, times]) * np.max(np.abs(seen)), np.zeros(3)
    learnt = table(Channels(still, still, still, still, still)._replace(**{name: x}))
    np.testing.assert_allclose(learnt, true(log.values, x), rtol=0.03, atol=0.01 * log.values["size"])


def test_a_law_that_acts_in_no_row_has_the_coefficient_zero():
    """An end stop that no whitened row reaches: its column is 0, and the equations of all of them were singular."""
    rng = np.random.default_rng(8)
    target, own = rng.standard_normal((2, 60))
    rows = [target, own, np.zeros(60)]
    problem = judging.Problem(rows, 1, np.zeros((1, 1)), np.zeros((3, 3)), ())
    (found,) = judging._solved((np.stack(rows) @ np.stack(rows).T)[None], problem, 1e-4)
    assert found == pytest.approx([target @ own / (own @ own), 0.0], rel=1e-6)


def test_noise_of_u_is_no_force_that_no_channel_explains():
    """A duty, or a current without a filter, at 30 % of u: 8 % of u stay in the band, and they are no force."""
    recording, random = seen({}, noise=2e-5, duration=8.0), np.random.default_rng(70)
    (piece,) = recording.pieces
    u = piece["u"] + 0.3 * float(np.sqrt(np.mean(piece["u"] ** 2))) * random.normal(size=len(piece))
    found = learn([replace(recording, pieces=(with_channels(piece, u=u),))], BELIEVED)
    assert found.verdict == "none"
    assert "noise of u" in found.why


def test_from_a_constant_u_nothing_is_learnt():
    """A constant of the position explained it, and where nothing moved a column of zeros ended it without an answer."""
    t = 0.002 * np.arange(4000)
    motion = 0.4 * np.sin(3.0 * t) + 0.2 * np.sin(7.1 * t)
    log = Log({"t": t, "u": np.full(t.size, 0.3), "position": motion}, 0.002, "constant")
    found = learn([prepare(log, ObserverSettings(0.01, 0.01))], PlantModel(0.01, 0.0, {}))
    assert found.verdict == "none"
    assert found.why.startswith("u is constant")
    assert np.isfinite(covariance_of(np.vstack([motion, np.zeros(t.size)]))).all()
