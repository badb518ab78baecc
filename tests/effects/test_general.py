"""Laws of any form: tables over channels and springs that slip, against laws written down a second time."""

import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import RegularGridInterpolator

from dsd_cli.effects import Channels, Role, find_effect, get_effect
from dsd_cli.effects.general import stretches
from dsd_cli.effects.memory import COMPILED
from dsd_cli.effects.one_state import built_up
from dsd_cli.errors import UsageError
from dsd_cli.plant.beyond import held_beyond
from dsd_cli.plant.model import PlantModel
from dsd_cli.plant.motion import Plant
from dsd_cli.signals.log import Log
from tests.cli.rig import AXIS, done, dsd

OVER_Q = {"channels": ["position"], "knots": [[-1.0, 0.0, 1.0]], "values": [1.0, 3.0, 2.0], "factor": "one"}
LAWS = {
    "curve": {**OVER_Q, "scale": 2.0},
    "friction_curve": {**OVER_Q, "channels": ["speed"], "scale": 0.5},
    "inertia_curve": {**OVER_Q, "scale": 1.0},
    "hysteresis": {"radii": [0.05, 0.3], "stiffnesses": [2.0, 1.0], "scale": 1.0},
    "lagged_friction": {"of": "velocity", "time_constants": [0.004, 0.05], "levels": [2.0, -1.0], "scale": 3.0},
    "bouc_wen": {"level": 2.0, "stiffness": 20.0, "exponent": 2.3, "unloading": 1.4},
    "lugre_friction": {"level": 2.0, "damping": 0.1, "stiffness": 20.0, "excess": 1.2, "velocity": 0.5},
}
N = 60


def channels():
    rng = np.random.default_rng(3)
    t = 1e-3 * np.arange(N)
    q = 1.4 * np.sin(np.linspace(0.0, 7.0, N))
    return Channels(t, rng.standard_normal(N), np.gradient(q, 1e-3), q, np.full(N, 1e-3))


def force(name, given, state=None):
    return get_effect(name).force(given, LAWS[name], 1.0, state)


@pytest.mark.parametrize("name", LAWS)
def test_row_by_row_cut_and_whole_are_one_function(name):
    given, state = channels(), None
    whole, last = force(name, given)
    assert np.shape(whole) == (N,)
    for k in range(N):
        single, state = force(name, Channels(*(float(c[k]) for c in given[:5])), state)
        assert np.ndim(single) == 0
        assert float(single) == pytest.approx(whole[k], rel=1e-11, abs=1e-11)
    for cut in (0, 1, 23, N):
        first, middle = force(name, Channels(*(c[:cut] for c in given[:5])))
        second, end = force(name, Channels(*(c[cut:] for c in given[:5])), middle if cut else None)
        np.testing.assert_array_equal(np.concatenate([np.broadcast_to(first, cut), second]), whole)
        assert end == last


@pytest.mark.parametrize("name", LAWS)
def test_values_come_back_and_further_ones_have_a_number(name):
    effect = get_effect(name)
    back = effect.from_columns(*effect.to_columns(LAWS[name]))
    again = effect.from_columns(*effect.to_columns(back))
    assert again == back
    assert list(back) == [p.name for p in effect.parameters if not p.optional]
    assert back == pytest.approx(LAWS[name]) if "scale" not in back else back["scale"] == LAWS[name]["scale"]
    assert get_effect(f"{name}_2").columns is effect.columns
    assert effect.starts(None) == []


def test_a_table_over_two_channels_is_bilinear_and_held():
    knots, values = [[-1.0, 0.0, 2.0], [0.0, 1.0]], [[1.0, 2.0], [0.0, 5.0], [3.0, -1.0]]
    given = {"channels": ["velocity", "position"], "knots": knots, "values": values, "factor": "u", "scale": 1.0}
    rng = np.random.default_rng(0)
    at = Channels(np.zeros(200), rng.standard_normal(200), *rng.uniform(-3.0, 3.0, (2, 200)))
    held = np.stack([np.clip(at.velocity, -1.0, 2.0), np.clip(at.position, 0.0, 1.0)], axis=1)
    wanted = RegularGridInterpolator(knots, np.array(values))(held) * at.u
    np.testing.assert_allclose(get_effect("curve").force(at, given)[0], wanted, atol=1e-12)


def test_a_spring_that_slips_is_a_loop_with_the_area_that_friction_takes():
    """Round a cycle of amplitude A a stop of radius r and stiffness k takes 4 k r (A - r)."""
    way = np.concatenate([np.linspace(0, 1, 4001), np.linspace(1, -1, 8001)[1:], np.linspace(-1, 0, 4001)[1:]])
    way = np.concatenate([way, way[1:]])
    moved = np.diff(way)
    at = Channels(*np.zeros((2, len(moved))), moved, way[1:], np.ones(len(moved)))
    one = {"radii": [0.3], "stiffnesses": [5.0], "scale": 1.0}
    found, _ = get_effect("hysteresis").force(at, one)
    cycle = slice(len(moved) // 2, None)
    assert -float(found[cycle] @ moved[cycle]) == pytest.approx(4 * 5.0 * 0.3 * (1.0 - 0.3), rel=1e-6)


def test_a_spring_and_a_damper_in_series_relax():
    """After a rest, held at speed v for a time t, the force is c v (1 - exp(-t/T)); then at rest it dies away."""
    c, lag, v, step = 4.0, 0.2, 1.5, 1e-3
    t = step * np.arange(1001)
    speed = np.where((t > 0.0) & (t <= 0.5), v, 0.0)
    at = Channels(t, 0.0 * t, speed, 0.0 * t, np.full(len(t), step))
    one = {"of": "velocity", "time_constants": [lag], "levels": [c], "scale": 1.0}
    found, _ = get_effect("lagged_friction").force(at, one)
    moved, rested = np.minimum(t, 0.5), np.maximum(t - 0.5, 0.0)
    last = -np.expm1(-0.5 / lag)
    area = c * v * (moved + lag * np.expm1(-moved / lag) - lag * last * np.expm1(-rested / lag))  # of force over time
    np.testing.assert_allclose(found[1:], -np.diff(area) / step, atol=1e-11)
    assert found[0] == 0.0
    built, _ = get_effect("lagged_friction").force(at, {**one, "of": "direction"})
    np.testing.assert_allclose(built, found / v, atol=1e-12)


def steps_of_constant_speed():
    speed = np.repeat(np.random.default_rng(0).standard_normal(40), 10)
    still = np.zeros(len(speed))
    return Channels(still, still, speed, still, still + 1e-2)


@pytest.mark.parametrize(("exponent", "unloading"), [(1.0, 2.0), (2.0, 1.0), (3.5, 1.5), (1.0, 1.0)])
def test_bouc_wen_is_its_differential_equation(exponent, unloading):
    """h' = (v/delta) (1 - |h|^n (b + g sgn(v h))), in steps of up to 0.23 distances."""
    at, level, distance = steps_of_constant_speed(), 2.0, 0.1
    b, g = 1.0 - 0.5 * unloading, 0.5 * unloading
    h, wanted = 0.0, []
    for v in at.velocity:

        def rates(_, y, v=v):
            return [v / distance * (1.0 - abs(y[0]) ** exponent * (b + g * np.sign(v * y[0]))), y[0]]

        h, area = solve_ivp(rates, (0.0, 1e-2), [h, 0.0], rtol=1e-9, atol=1e-12).y[:, -1]
        wanted.append(-level * area / 1e-2)
    given = {"level": level, "stiffness": level / distance, "exponent": exponent, "unloading": unloading}
    found, _ = get_effect("bouc_wen").force(at, given)
    np.testing.assert_allclose(found, wanted, atol=0.003 * level)
    if exponent == 1.0 and unloading == 2.0:  # Dahl's
        dahl, _ = get_effect("presliding_friction").force(at, {"level": 2.0, "stiffness": 20.0})
        np.testing.assert_allclose(dahl, found, atol=1e-12)


def test_compiled_rows_are_those_of_the_loop():
    moved = np.random.default_rng(1).standard_normal(500) * 10.0 ** np.random.default_rng(2).uniform(-3.0, 1.0, 500)
    assert np.array_equal(*(stretches(moved, 0.4, -0.1, compiled) for compiled in (COMPILED, None)))
    for exponent, unloading in ((1.0, 2.0), (2.3, 1.4), (6.0, 1.0)):
        shape = {"exponent": exponent, "unloading": unloading}
        (a, end), (b, other) = (built_up(moved, 0.3, shape, compiled) for compiled in (COMPILED, None))
        np.testing.assert_allclose(a, b, atol=1e-14)
        assert end == pytest.approx(other, abs=1e-14)
        assert np.max(np.abs(a)) <= 1.0


def test_no_loop_of_bouc_wen_gives_energy():
    """Erlicher and Point (2004): round any closed way the force takes energy."""
    for unloading in (1.0, 1.5, 2.0, 4.0):
        for size in (0.03, 0.3, 3.0):
            way = size * np.sin(np.linspace(0.0, 6.0 * np.pi, 6001))
            moved = np.diff(way)
            mean, _ = built_up(moved, 0.0, {"exponent": 1.7, "unloading": unloading})
            assert float(mean[2000:4000] @ moved[2000:4000]) > 0.0


def test_lugre_at_constant_speed_is_stribeck_friction_and_its_bristles_bend_first():
    """z' = v - |v| z/(delta G): z is built up over delta G, and its damping acts while it bends."""
    given, v, step = LAWS["lugre_friction"], 0.4, 1e-3
    t = step * np.arange(2000)
    at = Channels(t, 0.0 * t, np.full(len(t), v), 0.0 * t, np.full(len(t), step))
    found, last = get_effect("lugre_friction").force(at, given, 1.0, 0.0)
    high = 1.0 + given["excess"] / given["level"] * math.exp(-((v / given["velocity"]) ** 2))
    distance = given["level"] / given["stiffness"]
    left = np.exp(-v * (t[:, None] + step * (np.arange(50) + 0.5) / 50) / (distance * high)).mean(axis=1)
    wanted = -given["level"] * high * (1.0 - left) - given["damping"] * v * left
    np.testing.assert_allclose(found, wanted, atol=1e-6)
    assert last == pytest.approx(high * -math.expm1(-v * 2.0 / (distance * high)), rel=1e-9)


def test_an_inertia_that_changes_over_the_position_keeps_its_energy():
    """(J + D(q)) v^2 / 2 stays while nothing pushes."""
    table = {"channels": ["position"], "knots": [[0.0, 1.0, 2.0]], "values": [0.0, 0.4, 0.0], "factor": "one"}
    plant = Plant(PlantModel(1.0, 0.0, {"inertia_curve": {**table, "scale": 1.0}}), 0.0, 1.0)
    for k in range(3000):
        plant.advance(1e-3 * k, 0.0, 1e-3)
        more = float(np.interp(plant.position, [0.0, 1.0, 2.0], [0.0, 0.4, 0.0]))
        assert 0.5 * (1.0 + more) * plant.velocity**2 == pytest.approx(0.5, rel=2e-3)
    assert plant.position > 2.0


def test_friction_of_a_table_sticks():
    level = {**OVER_Q, "values": [0.2, 0.6, 0.2], "scale": 1.0}
    assert get_effect("friction_curve").role is Role.FRICTION
    plant = Plant(PlantModel(1.0, 0.0, {"friction_curve": level}), 0.0, 0.0)
    plant.advance(0.0, 0.59, 1.0)
    assert plant.position == plant.velocity == 0.0
    plant.advance(0.0, 0.61, 1.0)
    assert plant.position > 0.0


@pytest.mark.parametrize(
    ("effect", "change", "said"),
    [
        ("curve", {"channels": ["speedo"]}, "must be one or two of velocity"),
        ("curve", {"knots": [[0.0, 0.0, 1.0]]}, "must increase"),
        ("curve", {"values": [1.0, 2.0]}, "must be 3 numbers"),
        ("curve", {"values": [1.0, math.nan, 2.0]}, "must be a list of finite numbers"),
        ("curve", {"values": 3.0}, "curve.values: must be a list of finite numbers"),
        ("curve", {"knots": 0.3}, "a list of numbers for each channel"),
        ("curve", {"channels": 1}, "must be one or two of velocity"),
        ("curve", {"channels": [["position"]]}, "must be one or two of velocity"),
        ("curve", {"knots": [1.0, 2.0, 3.0]}, "a list of numbers for each channel"),
        ("curve", {"channels": ["velocity", "position"]}, "for each channel"),
        ("curve", {"channels": ["u", "position"], "knots": [[0, 1]] * 2, "values": 3.0}, "must be 2 numbers in 2 rows"),
        ("curve", {"factor": "w"}, "must be one of one"),
        ("hysteresis", {"radii": [0.0, 1.0]}, "above 0"),
        ("hysteresis", {"stiffnesses": [1.0]}, "must be 2 numbers"),
        ("lagged_friction", {"of": "u"}, "must be one of velocity, direction"),
        ("lagged_friction", {"time_constants": [0.0, 1.0]}, "above 0"),
        ("lagged_friction", {"levels": [1.0]}, "must be 2 numbers"),
        *(
            (effect, {name: bad}, f"{effect}.{name}: must be a list of {kind}")
            for effect, name, kind in (
                ("hysteresis", "radii", "numbers above 0, rad or m"),
                ("hysteresis", "stiffnesses", "finite numbers"),
                ("lagged_friction", "time_constants", "numbers above 0, s"),
                ("lagged_friction", "levels", "finite numbers"),
            )
            for bad in (0.3, [[0.3]], ["a"], [], [math.nan, 1.0])
        ),
    ],
)
def test_what_is_no_table_is_refused(effect, change, said):
    with pytest.raises(UsageError, match=said):
        PlantModel(1.0, 0.0, {effect: {**LAWS[effect], **change}})


def test_beyond_its_knots_a_law_is_held_and_that_is_said():
    log = Log({"t": np.arange(4.0), "position": np.array([0.0, 0.5, 2.0, 3.0])}, 1.0, "log")
    model = PlantModel(1.0, 0.0, {"curve": LAWS["curve"]})
    (line,) = held_beyond(model, [log])
    assert "curve is known for position from -1 to 1; 50.0 %" in line
    assert held_beyond(model, [Log({"t": np.arange(2.0), "position": np.zeros(2)}, 1.0, "log")]) == []
    assert find_effect("curve_2") is not None


def test_beyond_what_it_was_learnt_from_a_formula_goes_on_and_that_is_said():
    log = Log({"t": np.arange(4.0), "position": np.array([0.0, 0.1, 0.8, 0.9])}, 1.0, "log")
    model = PlantModel(1.0, 0.0, {"curve": {**LAWS["curve"], "seen": [[-0.5, 0.5]]}})
    (line,) = held_beyond(model, [log])
    assert line == (
        "curve is known for position from -0.5 to 0.5; 50.0 % of the samples lie beyond, where its formula goes on,"
        " unseen"
    )
    assert model.effects["curve"]["seen"] == [[-0.5, 0.5]]
    assert "seen" not in PlantModel(1.0, 0.0, {"curve": LAWS["curve"]}).effects["curve"]
    for bad in (0.5, [], [[0.5, -0.5]], [[0.0]], [[0.0, 1.0], [0.0, 1.0]]):
        with pytest.raises(UsageError, match="seen"):
            PlantModel(1.0, 0.0, {"curve": {**LAWS["curve"], "seen": bad}})


CONFIG = """
[model.effects.friction_curve]
channels = ["position"]
knots = [[-0.5, 0.0, 0.5]]
values = [0.02, 0.06, 0.02]
factor = "one"
scale = 1.0

[simulate]
duration = 5.0
sample_time = 0.001
encoder_step = 1e-6

[simulate.controller]
kind = "pd"
kp = 4.0
kd = 0.3

[simulate.reference]
kind = "multisine"
frequencies = [0.4, 1.3]
amplitude = 0.8
seed = 2
"""


def test_the_detector_takes_a_table_but_over_u(tmp_path):
    states = """
[states]
delays = [0.0, 0.004]
inertias = [0.005, 0.01]

[detector]
window = 50
rho = 0.05
initial = { delay = 0.0, inertia = 0.005 }
"""
    (tmp_path / "axis.toml").write_text(AXIS + CONFIG.replace("duration = 5.0", "duration = 2.0") + states)
    done("simulate", "-c", "axis.toml", "-o", "log.csv", cwd=tmp_path)
    found = json.loads(done("detect", "log.csv", "-c", "axis.toml", "--format", "json", cwd=tmp_path).stdout)
    assert (found["final"]["delay"], found["final"]["inertia"]) == (0.004, 0.01)
    (tmp_path / "u.toml").write_text(AXIS + CONFIG.replace('channels = ["position"]', 'channels = ["u"]') + states)
    refused = dsd("detect", "log.csv", "-c", "u.toml", cwd=tmp_path)
    assert (refused.returncode, len(refused.stderr.splitlines())) == (2, 1)
    assert "its table is over the command after the delay" in refused.stderr


def test_the_commands_take_it_like_any_effect(tmp_path):
    (tmp_path / "axis.toml").write_text(AXIS + CONFIG)
    simulated = done("simulate", "-c", "axis.toml", "-o", "log.csv", cwd=tmp_path)
    assert "friction_curve is known for position from -0.5 to 0.5" in simulated.stderr
    compared = done("compare", "log.csv", "-c", "axis.toml", cwd=tmp_path)
    assert "where its ends are held" in compared.stderr
    refused = dsd("compare", "log.csv", "-c", "axis.toml", "--fix", "friction_curve.knots=1", cwd=tmp_path)
    assert (refused.returncode, "is a list or a word" in refused.stderr) == (2, True)
    (tmp_path / "bad.toml").write_text(AXIS + CONFIG.replace("[0.02, 0.06, 0.02]", "[0.02, 0.06]"))
    bad = dsd("compare", "log.csv", "-c", "bad.toml", cwd=tmp_path)
    assert (bad.returncode, len(bad.stderr.splitlines())) == (2, 1)
    assert "friction_curve.values: must be 3 numbers" in bad.stderr
