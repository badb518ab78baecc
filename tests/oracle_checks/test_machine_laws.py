"""The oracle's machines against closed forms, and the log convention."""

import math

import numpy as np
import pytest

from tests.oracle import machine_cases, machines
from tests.oracle.machine_cases import EFFECT_IDS, STRANGER_IDS
from tests.oracle.machine_plant import Plant

T = 0.001


def drive(commands, inertia=1.0, delay=0.0, v0=0.0, q0=0.0, start=0.0, **effects):
    """Position and velocity at every row of one plant under these commands."""
    plant = Plant(np.array([inertia]), np.array([delay]), [effects], [()], T, len(commands))
    plant.place(np.array([v0]), q0)
    rows = []
    for k, u in enumerate(commands):
        rows.append([x.item() for x in plant.measured()])
        plant.step(k, start + k * T, np.array([float(u)]))
    return np.array(rows).T


# --- time and the log convention -------------------------------------------------------------------------------------


def test_free_plant_under_constant_drive_starts_after_the_delay():
    delay, inertia = 0.01237, 0.4
    q, v = drive([2.0] * 200, inertia, delay)
    late = np.clip(np.arange(200) * T - delay, 0.0, None)
    np.testing.assert_allclose(v, 2.0 / inertia * late, atol=1e-12)
    np.testing.assert_allclose(q, 1.0 / inertia * late**2, atol=2e-8)


@pytest.mark.parametrize("delay", [0.0, 0.0004, 0.00045, 0.003, 0.00512345, 0.0209999])
def test_each_interval_gets_the_exact_mean_of_the_delayed_command(delay):
    u = np.random.default_rng(3).normal(size=80)
    _, v = drive(u, 0.7, delay)
    area = np.concatenate([[0.0], np.cumsum(u) * T])  # integral of the held command up to t_k
    at = np.arange(81) * T - delay
    means = np.diff(np.interp(at, np.arange(81) * T, area)) / T
    np.testing.assert_allclose(0.7 * np.diff(v) / T, means[:79], atol=1e-9)
    np.testing.assert_allclose(machines.mean_drive(u[:, None], np.array([delay]), T)[:, 0], means, atol=1e-9)


# --- closed forms ----------------------------------------------------------------------------------------------------


def test_viscous_friction_decays_exponentially():
    _, v = drive([0.0] * 1000, 0.5, v0=3.0, viscous_friction={"coefficient": 2.0})
    np.testing.assert_allclose(v, 3.0 * np.exp(-2.0 / 0.5 * np.arange(1000) * T), rtol=2e-3)
    assert v[500] == pytest.approx(3.0 * math.exp(-2.0), rel=1e-3)


def test_coulomb_friction_stops_where_the_energy_ends_and_stays():
    q, v = drive([0.0] * 2000, 0.5, v0=3.0, coulomb_friction={"level": 2.0})
    assert q[-1] == pytest.approx(3.0**2 * 0.5 / (2 * 2.0), rel=0.01)
    assert q[-1] == pytest.approx(3.0**2 * 0.5 / (2 * 2.0), rel=1e-4)
    stopped = round(3.0 * 0.5 / 2.0 / T) + 5
    assert np.ptp(q[stopped:]) < 1e-9
    assert np.abs(v[stopped:]).max() < 1e-9


def test_friction_holds_below_its_level_and_slides_above_it():
    held_q, held_v = drive(1.9 * np.sin(np.arange(2000) * 0.02), 0.5, coulomb_friction={"level": 2.0})
    assert np.ptp(held_q) < 1e-7
    assert np.abs(held_v).max() < 1e-4
    _, v = drive([2.5] * 1000, 0.5, coulomb_friction={"level": 2.0})
    assert v[-1] == pytest.approx(0.5 / 0.5 * 0.999, rel=1e-3)


def test_finer_steps_give_the_same_motion():
    """Small enough for the stiffest laws here: rubbing with a Stribeck slope on a motor whose load is loose."""
    effects = {
        "coulomb_friction": {"level": 1.0},
        "stribeck_friction": {"excess": 0.5, "velocity": 0.2},
        "backlash": {"gap": 0.01, "load_share": 0.4, "stiffness": 0.4 * (2 * np.pi * 50) ** 2},
    }
    q = np.zeros((2, 500))
    for row, steps in zip(q, (10, 30), strict=True):
        plant = Plant(np.ones(1), np.array([0.00137]), [effects], [()], T, 500, steps)
        for k in range(500):
            row[k] = plant.measured()[0].item()
            plant.step(k, k * T, np.array([4.0 * math.sin(0.02 * k)]))
    np.testing.assert_allclose(q[0], q[1], atol=5e-3 * np.ptp(q[1]))


def test_a_spring_swings_at_its_frequency_and_keeps_its_energy():
    q, v = drive([0.0] * 3000, 0.5, q0=1.0, stiffness={"coefficient": 50.0})
    np.testing.assert_allclose(q, np.cos(10.0 * np.arange(3000) * T), atol=2e-3)
    np.testing.assert_allclose(0.25 * v**2 + 25.0 * q**2, 25.0, rtol=1e-3)


def test_flexible_coupling_rings_at_its_resonance_and_keeps_momentum():
    share, inertia = 0.35, 0.8
    p = {"frequency": 23.0, "load_share": share, "damping": 0.02}
    plant = Plant(np.array([inertia]), np.array([0.0]), [{"flexible_coupling": p}], [()], T, 4096)
    v = np.zeros(4096)
    for k in range(4096):
        v[k] = plant.measured()[1].item()
        plant.step(k, k * T, np.array([5.0 if k < 10 else 0.0]))
    momentum = (plant.motor * plant.v + plant.load * plant.vl).item()
    assert momentum == pytest.approx(5.0 * 10 * T, rel=1e-9)
    assert v[-500:].mean() == pytest.approx(5.0 * 10 * T / inertia, rel=1e-3)  # both masses move as one at the end
    spectrum = np.abs(np.fft.rfft((v[20:] - v[-1]) * np.hanning(4076), 65536))
    assert np.argmax(spectrum) / (65536 * T) == pytest.approx(23.0, abs=0.1)


def test_flexible_coupling_has_its_antiresonance_where_the_load_swings_alone():
    """A motor driven at omega_a = omega_r sqrt(1 - share) hardly moves: its load takes the whole drive."""
    share, hertz = 0.4, 20.0
    p = {"frequency": hertz, "load_share": share, "damping": 0.01}
    quiet = hertz * math.sqrt(1 - share)
    tones = np.array([0.85, 1.0, 1.15]) * quiet
    plant = Plant(np.ones(3), np.zeros(3), [{"flexible_coupling": p}] * 3, [()] * 3, T, 6000)
    v = np.zeros((6000, 3))
    for k in range(6000):
        v[k] = plant.measured()[1]
        plant.step(k, k * T, np.sin(2 * np.pi * tones * k * T))
    swing = np.std(v[5000:], axis=0)
    assert swing[1] < 0.15 * min(swing[0], swing[2])


def test_backlash_moves_the_motor_alone_within_the_gap_then_both():
    p = {"gap": 0.02, "load_share": 0.4, "stiffness": 0.4 * (2 * np.pi * 40) ** 2}
    q, v = drive([1.0] * 1500, 1.0, backlash=p)
    free = np.flatnonzero(q < 0.0099)
    np.testing.assert_allclose(q[free], 0.5 / 0.6 * (free * T) ** 2, atol=1e-6)
    held = np.flatnonzero(np.abs(q - 0.5 / 0.6 * (np.arange(1500) * T) ** 2) > 1e-5)[0]
    assert 0.01 < q[held] < 0.0115  # half the gap, from its middle
    assert v[-1] - v[-501] == pytest.approx(0.5, rel=0.02)  # 0.5 s of 1 N m on 1 kg m2


def test_dead_zone_and_saturation_statics():
    u = np.array([-3.0, -1.0, -0.4, 0.0, 0.3, 0.5, 0.9, 4.0])
    _, v = drive([*u, 0.0], 2.0, dead_zone={"width": 0.5})
    np.testing.assert_allclose(2.0 * np.diff(v) / T, [-2.5, -0.5, 0, 0, 0, 0, 0.4, 3.5], atol=1e-9)
    _, v = drive([*u, 0.0], 2.0, saturation={"limit": 0.9})
    np.testing.assert_allclose(2.0 * np.diff(v) / T, [-0.9, -0.9, -0.4, 0, 0.3, 0.5, 0.9, 0.9], atol=1e-9)


def test_actuator_lag_step_response():
    _, v = drive([1.0] * 300, 1.0, 0.0042, actuator_lag={"time_constant": 0.03})
    t = np.clip(np.arange(300) * T - 0.0042, 0.0, None)
    np.testing.assert_allclose(v, t - 0.03 * (1 - np.exp(-t / 0.03)), atol=1e-7)


def test_presliding_loop_area_is_dahls():
    level, distance, stroke = 2.0, 0.01, 0.015
    p = {"level": level, "stiffness": level / distance}
    plant = Plant(np.array([1e12]), np.array([0.0]), [{"presliding_friction": p}], [()], T, 4000)
    x, force = np.zeros((2, 4000))
    for k in range(4000):
        x[k], force[k] = plant.q.item(), level * plant.bend.item()
        plant.v = np.array([stroke * 2 * np.pi * np.cos(2 * np.pi * k * T)])  # the heavy mass keeps this speed
        plant.step(k, k * T, np.zeros(1))
    last = slice(2999, 4000)
    area = np.sum(0.5 * (force[last][1:] + force[last][:-1]) * np.diff(x[last]))
    assert area == pytest.approx(4 * level * (stroke - distance * math.tanh(stroke / distance)), rel=0.01)


LAWS = {
    "viscous_friction": ({"coefficient": 0.7}, lambda q, v, u, t: -0.7 * v),
    "viscous_asymmetry": ({"coefficient": 0.7}, lambda q, v, u, t: -0.7 * abs(v)),
    "quadratic_drag": ({"coefficient": 0.3}, lambda q, v, u, t: -0.3 * v * abs(v)),
    "coulomb_friction": ({"level": 1.3}, lambda q, v, u, t: -math.copysign(1.3, v)),
    "stribeck_friction": (
        {"excess": 1.3, "velocity": 2.0},
        lambda q, v, u, t: -1.3 * math.exp(-((v / 2.0) ** 2)) * math.copysign(1, v),
    ),
    "load_friction": ({"coefficient": 0.2}, lambda q, v, u, t: -0.2 * abs(u) * math.copysign(1, v)),
    "constant_load": ({"force": -0.6}, lambda q, v, u, t: -0.6),
    "gravity": ({"amplitude": 2.0, "phase": 0.3}, lambda q, v, u, t: -2.0 * math.sin(q + 0.3)),
    "stiffness": ({"coefficient": 1.5}, lambda q, v, u, t: -1.5 * q),
    "cubic_stiffness": ({"coefficient": 0.4}, lambda q, v, u, t: -0.4 * q**3),
    "cogging": ({"amplitude": 0.5, "periods": 7.0, "phase": 1.0}, lambda q, v, u, t: 0.5 * math.sin(7.0 * q + 1.0)),
    "periodic_disturbance": (
        {"amplitude": 0.5, "frequency": 3.0, "phase": 1.0},
        lambda q, v, u, t: 0.5 * math.sin(6.0 * math.pi * t + 1.0),
    ),
    "external_force": (
        {"events": [{"start": 1.0, "end": 2.0, "force": 0.4}, {"start": 3.0, "end": 4.0, "force": -0.9}]},
        lambda q, v, u, t: 0.4 if 1.0 <= t < 2.0 else -0.9 if 3.0 <= t < 4.0 else 0.0,
    ),
    "presliding_friction": ({"level": 0.8, "stiffness": 1e6}, lambda q, v, u, t: -math.copysign(0.8, v)),
    "growing_friction": ({"start": 0.2, "rate": 0.3}, lambda q, v, u, t: -(0.2 + 0.3 * t) * math.copysign(1, v)),
    "growing_viscosity": ({"start": 0.2, "rate": 0.3}, lambda q, v, u, t: -(0.2 + 0.3 * t) * v),
    "position_friction": (
        {"level": 1.0, "depth": 0.8, "periods": 1.0, "phase": 0.5},
        lambda q, v, u, t: -(1 + 0.8 * math.sin(q + 0.5)) * math.copysign(1, v),
    ),
    "speed_position_force": ({"coefficient": 0.3}, lambda q, v, u, t: -0.3 * v * q),
}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize(("q", "v", "u", "t"), [(0.7, 2.0, 1.5, 1.5), (-1.9, -0.8, 0.6, 3.2), (2.4, -3.0, -1.1, 2.5)])
def test_force_while_moving_is_the_law(name, q, v, u, t):
    """Impulse over the last of a few samples of a machine so heavy that its motion does not change."""
    values, law = LAWS[name]
    inertia, rows = 1e4, 6
    _, vs = drive([u] * rows, inertia, v0=v, q0=q - (rows - 1.5) * T * v, start=t - (rows - 1.5) * T, **{name: values})
    assert inertia * (vs[-1] - vs[-2]) / T - u == pytest.approx(law(q, v, u, t), abs=2e-3)


def test_every_effect_has_its_law_tested_here():
    covered = {*LAWS, *machine_cases.INPUTS, *machine_cases.STRUCTURES, *machine_cases.PLANT_VALUES, "random_load"}
    assert {*EFFECT_IDS, *STRANGER_IDS} == covered
