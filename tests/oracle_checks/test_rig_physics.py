"""The machines of the outside rig against physics written a second time here, textbook results and an ODE solver."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.oracle.rig_parts import LOADS
from tests.oracle.rig_physics import Machine
from tests.oracle.rig_run import run

T, J, L = 1e-3, 0.05, 0.0123


def drive(k, q, v):
    """N m: sines, and enough of a loop to keep the axis where it is."""
    t = k * T
    return 0.9 * math.sin(5.0 * t) + 0.6 * math.sin(17.0 * t + 1.0) + 0.25 * math.sin(71.0 * t) - 0.4 * q - 0.15 * v


def gentle(k, q, v):
    """N m, slow and without feedback: dry friction of 0.3 holds for a while at every reversal."""
    return 0.7 * math.sin(6.0 * k * T)


def excite(effects, delay=L, seconds=3.0, loop=drive, inertia=J, step=T):
    return run(Machine(inertia, delay, effects), loop, step * np.arange(round(seconds / step)), 0.0)


def means(x):
    """Over each interval between stamps, trapezoidal."""
    return 0.5 * (x[1:] + x[:-1])


def arriving(u, delay):
    """Mean over [t_k, t_(k+1)) of a command that is held and comes `delay` later."""
    whole, part = divmod(delay / T, 1.0)
    late = np.concatenate([np.zeros(int(whole) + 1), u])
    return ((1.0 - part) * late[1:] + part * late[:-1])[: len(u) - 1]


def sat(x, limit):
    return np.clip(x, -limit, limit)


#: Forces on a rigid axis, written here a second time: values and (t, q, v) -> N m.
FORCES = {
    "viscous_friction": ({"coefficient": 0.2}, lambda t, q, v: -0.2 * v),
    "viscous_asymmetry": ({"coefficient": -0.1}, lambda t, q, v: 0.1 * np.abs(v)),
    "quadratic_drag": ({"coefficient": 0.05}, lambda t, q, v: -0.05 * np.abs(v) * v),
    "constant_load": ({"force": 0.3}, lambda t, q, v: 0.3 + 0.0 * t),
    "stiffness": ({"coefficient": 1.5}, lambda t, q, v: -1.5 * q),
    "cubic_stiffness": ({"coefficient": 2.0}, lambda t, q, v: -2.0 * q**3),
    "gravity": ({"amplitude": 0.5, "phase": 0.7}, lambda t, q, v: -0.5 * np.sin(q + 0.7)),
    "cogging": ({"amplitude": 0.3, "periods": 21.0, "phase": -1.0}, lambda t, q, v: 0.3 * np.sin(21.0 * q - 1.0)),
    "periodic_disturbance": (
        {"amplitude": 0.4, "frequency": 6.0, "phase": 0.4},
        lambda t, q, v: 0.4 * np.sin(12.0 * np.pi * t + 0.4),
    ),
    "external_force": (
        {"events": [{"start": 0.5, "end": 1.0, "force": 0.5}, {"start": 2.0, "end": 2.25, "force": -0.7}]},
        lambda t, q, v: 0.25 * (np.sign(t - 0.5) - np.sign(t - 1.0)) - 0.35 * (np.sign(t - 2.0) - np.sign(t - 2.25)),
    ),
    "root_drag": ({"coefficient": 0.3}, lambda t, q, v: -0.3 * np.sign(v) * np.sqrt(np.abs(v))),
    "random_walk_load": (
        {"spacing": 0.5, "nodes": [0.1, -0.2, 0.4, 0.3, -0.3, 0.0, 0.2]},
        lambda t, q, v: np.interp(t, 0.5 * np.arange(7), [0.1, -0.2, 0.4, 0.3, -0.3, 0.0, 0.2]),
    ),
    "end_stop": ({"stiffness": 3.0, "position": 0.2}, lambda t, q, v: -3.0 * np.maximum(q - 0.2, 0.0)),
    "eddy_brake": ({"peak": 0.3, "speed": 1.5}, lambda t, q, v: -0.6 * (v / 1.5) / (1.0 + (v / 1.5) ** 2)),
}
#: Levels of dry friction: values and (t, q, v, u acting) -> N m.
LEVELS = {
    "coulomb_friction": ({"level": 0.3}, lambda t, q, v, u: 0.3 + 0.0 * v),
    "stribeck_friction": ({"excess": 0.4, "velocity": 0.5}, lambda t, q, v, u: 0.4 * np.exp(-4.0 * v**2)),
    "load_friction": ({"coefficient": 0.4}, lambda t, q, v, u: 0.4 * np.abs(u)),
    "friction_growing_with_time": (
        {"first": 0.1, "last": 0.5, "duration": 3.0},
        lambda t, q, v, u: 0.1 + 0.4 * t / 3.0,
    ),
    "friction_over_position": (
        {"level": 0.3, "depth": 0.8, "periods": 3.0, "phase": 0.2},
        lambda t, q, v, u: 0.3 * (1.0 + 0.8 * np.sin(3.0 * q + 0.2)),
    ),
}


def balance(motion, delay=L):
    """J a less what arrives, N m, mean over each interval."""
    return J * np.diff(motion.v) / T - arriving(motion.u, delay)


@pytest.mark.parametrize("delay", [0.0, L, 0.02])
def test_a_bare_axis_turns_exactly_by_the_command_that_has_arrived(delay):
    u = np.random.default_rng(1).standard_normal(400)
    motion = run(Machine(J, delay), lambda k, q, v: float(u[k]), T * np.arange(400), 0.3)
    speed = np.concatenate([[0.0], np.cumsum(arriving(u, delay)) * T / J])
    np.testing.assert_allclose(motion.v, speed, atol=1e-11)
    first = int(np.nonzero(motion.v)[0][0])
    assert (first - 1) * T <= delay < first * T
    if delay != L:  # whole intervals: constant acceleration within each
        place = 0.3 + np.concatenate([[0.0], np.cumsum(means(speed)) * T])
        np.testing.assert_allclose(motion.q, place, atol=1e-11)


@pytest.mark.parametrize("effect", FORCES)
def test_forces_balance(effect):
    values, law = FORCES[effect]
    motion = excite({effect: values})
    forces = law(means(motion.t), means(motion.q), means(motion.v))
    assert np.std(forces) > 0.03 or effect == "constant_load"
    bend = 3e-2 if effect in ("root_drag", "end_stop") else 2e-3  # where the law bends within an interval
    np.testing.assert_allclose(balance(motion), forces, atol=bend)
    assert np.sqrt(np.mean((balance(motion) - forces) ** 2)) < 1e-3


@pytest.mark.parametrize("effect", LEVELS)
def test_dry_friction_balances_while_it_slides_and_holds_while_it_sticks(effect):
    values, level = LEVELS[effect]
    pull = 0.25  # with a spring there is something to be held against
    motion = excite({effect: values, "stiffness": {"coefficient": pull}}, loop=gentle)
    u = arriving(motion.u, L)
    levels = level(means(motion.t), means(motion.q), means(motion.v), u)
    friction = balance(motion) + pull * means(motion.q)
    way = np.sign(motion.v)
    slides = (way[1:] == way[:-1]) & (way[1:] != 0.0)
    np.testing.assert_allclose(friction[slides], -(levels * way[1:])[slides], atol=0.02)
    sticks = (motion.v[1:] == 0.0) & (motion.v[:-1] == 0.0)
    assert np.all(np.abs(friction[sticks]) <= levels[sticks] + 1e-9)
    assert np.all(np.diff(motion.q)[sticks] == 0.0)
    assert slides.mean() > 0.2
    assert sticks.sum() > 10


def test_coulomb_friction_stops_an_axis_where_the_textbook_says():
    level, pushed = 0.3, 100

    def push(k, q, v):
        return 1.0 if k < pushed else 0.0

    motion = excite({"coulomb_friction": {"level": level}}, delay=0.0, seconds=1.0, loop=push)
    top = (1.0 - level) * pushed * T / J
    stops = pushed * T + top * J / level
    far = 0.5 * (1.0 - level) / J * (pushed * T) ** 2 + 0.5 * top**2 * J / level
    assert motion.v[pushed] == pytest.approx(top, rel=1e-9)
    assert np.all(motion.v[motion.t > stops] == 0.0)
    assert np.all(motion.v[(motion.t > 0.0) & (motion.t < stops - 1e-9)] > 0.0)
    assert motion.q[-1] == pytest.approx(far, rel=1e-9)


@pytest.mark.parametrize(
    ("effect", "values", "acts"),
    [
        ("dead_zone", {"width": 0.3}, lambda u: u - sat(u, 0.3)),
        ("saturation", {"limit": 0.7}, lambda u: sat(u, 0.7)),
        ("gain_asymmetry", {"share": 0.2}, lambda u: np.where(u > 0.0, 1.2 * u, 0.8 * u)),
    ],
)
def test_changed_commands_act_after_the_delay(effect, values, acts):
    motion = excite({effect: values})
    np.testing.assert_allclose(J * np.diff(motion.v) / T, arriving(acts(motion.u), L), atol=1e-9)


def test_lag_is_of_first_order_and_delayed():
    motion = excite({"actuator_lag": {"time_constant": 0.03}}, delay=0.02)
    keep = math.exp(-T / 0.03)
    x = np.zeros(len(motion.u) + 1)
    for k, u in enumerate(motion.u):
        x[k + 1] = u + keep * (x[k] - u)
    mean = motion.u + (x[:-1] - motion.u) * (1.0 - keep) * 0.03 / T
    np.testing.assert_allclose(J * np.diff(motion.v) / T, arriving(mean, 0.02), atol=1e-9)


def test_slew_limit_and_gain_drift_act_as_they_say():
    motion = excite({"slew_limit": {"rate": 15.0}}, delay=0.0)
    acting = J * np.diff(motion.v) / T
    assert np.max(np.abs(np.diff(acting))) == pytest.approx(15.0 * T, rel=1e-6)
    calm = np.abs(acting - motion.u[:-1]) < 1e-3
    assert 0.02 < calm.mean() < 0.98
    motion = excite({"gain_drift": {"loss": 0.4, "mean_square": 0.5, "time_constant": 0.8}}, delay=0.0)
    gain = (J * np.diff(motion.v) / T) / np.where(motion.u[:-1] == 0.0, 1.0, motion.u[:-1])
    assert gain[1] == pytest.approx(1.0, abs=1e-2)
    heat = np.mean(motion.u[1000:] ** 2) / 0.5
    assert np.mean(gain[2000:]) == pytest.approx(1.0 - 0.4 * heat, abs=0.08)


def test_dahl_friction_is_a_hysteresis_of_its_stiffness_and_level():
    level, sigma = 0.3, 12.0
    motion = excite({"presliding_friction": {"level": level, "stiffness": sigma}})
    force = np.zeros(len(motion.t))
    for k, moved in enumerate(np.diff(motion.q)):  # over position it is a first-order rise towards -+ level
        way = np.sign(moved)
        force[k + 1] = -level * way + (force[k] + level * way) * math.exp(-sigma * abs(moved) / level)
    np.testing.assert_allclose(balance(motion), means(force), atol=3e-3)
    assert np.max(np.abs(force)) > 0.95 * level


def test_play_hysteresis_is_a_sum_of_stops():
    widths = [0.03, 0.1, 0.25]
    motion = excite({"play_hysteresis": {"stiffness": 1.2, "widths": widths}})
    stretched = np.zeros((len(motion.t), 3))
    for k, moved in enumerate(np.diff(motion.q)):
        stretched[k + 1] = np.clip(stretched[k] + moved, -np.array(widths), widths)
    np.testing.assert_allclose(balance(motion), means(-1.2 * stretched.sum(axis=1)), atol=1e-2)


def test_swinging_inertia_keeps_the_energy_that_it_is_given():
    share, phase = 0.4, 0.6
    motion = excite({"swinging_inertia": {"share": share, "phase": phase}}, delay=0.0)
    mass = J * (1.0 + share * np.cos(2.0 * motion.q + phase))
    work = np.concatenate([[0.0], np.cumsum(motion.u[:-1] * np.diff(motion.q))])
    np.testing.assert_allclose(0.5 * mass * motion.v**2, work, atol=1e-6)


@pytest.mark.parametrize("friction", [{}, {"coulomb_friction": {"level": 0.3}}])
def test_flexible_coupling_is_two_masses(friction):
    share, frequency, damping = 0.4, 12.0, 0.05
    effects = {"flexible_coupling": {"frequency": frequency, "load_share": share, "damping": damping}, **friction}
    motion = excite(effects, loop=gentle if friction else drive)
    rate = 2.0 * np.pi * frequency * np.sqrt(1.0 - share)
    apart, closing = motion.q - motion.load_q, motion.v - motion.load_v
    pulled = rate**2 * apart + 2.0 * damping * rate * closing
    np.testing.assert_allclose(np.diff(motion.load_v) / T, means(pulled), atol=0.02 * np.std(pulled))
    if not friction:
        both = J * ((1.0 - share) * motion.v + share * motion.load_v)
        np.testing.assert_allclose(np.diff(both) / T, arriving(motion.u, L), atol=1e-9)
    else:
        held = (motion.v[1:] == 0.0) & (motion.v[:-1] == 0.0)
        assert held.sum() > 20
        assert np.max(np.abs(motion.load_v[1:][held])) > 0.05  # the load swings on


def test_backlash_flies_free_and_pushes_at_its_flanks():
    share, gap, stiffness = 0.4, 0.05, 0.4 * J * (2.0 * np.pi * 25.0) ** 2
    motion = excite({"backlash": {"gap": gap, "load_share": share, "stiffness": stiffness}})
    both = J * ((1.0 - share) * motion.v + share * motion.load_v)
    np.testing.assert_allclose(np.diff(both) / T, arriving(motion.u, L), atol=1e-8)
    apart = motion.q - motion.load_q
    inside = np.abs(apart) < 0.5 * gap
    free = inside[1:] & inside[:-1] & (np.abs(means(apart)) < 0.4 * gap)
    pushed = np.diff(motion.load_v) / T
    assert free.sum() > 200
    assert np.all(pushed[free] == 0.0)
    # Deep in a flank, spring and full damping.
    deep = np.abs(apart) > 0.5 * gap * 1.1
    rate = np.sqrt(stiffness / (share * J))
    spring = rate**2 * (apart - 0.5 * gap * np.sign(apart)) + 0.6 * rate * (motion.v - motion.load_v)
    spring = np.where(spring * np.sign(apart) > 0.0, spring, 0.0)
    both_deep = deep[1:] & deep[:-1]
    assert both_deep.sum() > 20
    np.testing.assert_allclose(pushed[both_deep], means(spring)[both_deep], atol=0.05 * np.max(np.abs(spring)))
    assert np.all(pushed * np.sign(means(apart)) >= 0.0)
    load = LOADS["backlash"]({"gap": gap, "load_share": share, "stiffness": stiffness}, J)
    assert load.pull(0.51 * gap, 0.0) == -load.pull(-0.51 * gap, 0.0) > 0.0
    assert load.pull(0.51 * gap, -5.0) == 0.0  # a contact never pulls, however fast the load leaves


@pytest.mark.parametrize("coupled", [False, True])
def test_smooth_machines_move_as_an_ode_solver_says(coupled):
    effects = {
        "viscous_friction": {"coefficient": 0.2},
        "gravity": {"amplitude": 0.5, "phase": 0.7},
        "periodic_disturbance": {"amplitude": 0.3, "frequency": 4.0, "phase": 0.2},
    }
    share, frequency, damping = (0.3, 15.0, 0.05) if coupled else (0.0, 0.0, 0.0)
    if coupled:
        effects["flexible_coupling"] = {"frequency": frequency, "load_share": share, "damping": damping}
    hold, delay = 0.01, 0.013
    u = np.random.default_rng(2).uniform(-1.0, 1.0, 60)
    motion = run(Machine(J, delay, effects), lambda k, q, v: float(u[k]), hold * np.arange(60), 0.2)
    rate = 2.0 * np.pi * frequency * np.sqrt(1.0 - share)

    def flow(t, x, command):
        q, v, ql, vl = x
        pulled = rate**2 * (q - ql) + 2.0 * damping * rate * (v - vl)
        force = command - 0.2 * v - 0.5 * np.sin(q + 0.7) + 0.3 * np.sin(8.0 * np.pi * t + 0.2)
        return [v, (force - share * J * pulled) / (J * (1.0 - share)), vl, pulled]

    x, t = np.array([0.2, 0.0, 0.2, 0.0]), 0.0
    edges = sorted({*(hold * np.arange(60)), *(hold * np.arange(60) + delay)})
    for end in edges[1:]:
        if end > motion.t[-1] + 1e-12:
            break
        j = math.floor((t + 1e-9 - delay) / hold)
        x = solve_ivp(flow, (t, end), x, args=(u[j] if j >= 0 else 0.0,), rtol=1e-10, atol=1e-12).y[:, -1]
        t = end
    assert t == pytest.approx(motion.t[-1])
    seen = [motion.q[-1], motion.v[-1]]
    np.testing.assert_allclose(seen, x[:2], rtol=2e-5, atol=1e-6)
