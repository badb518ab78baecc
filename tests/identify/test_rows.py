"""Rows: the true model leaves nothing, masked intervals leave no trace, and columns add up to the one prediction."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit import rows as rows_module
from dsd_cli.identify.fit.bank import Term, drive, inputs_of, raw_columns
from dsd_cli.identify.fit.blocks import lay_blocks
from dsd_cli.identify.fit.rows import Equations
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.plant.controllers import ControllerSettings, Gains
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import predict_d_hat
from dsd_cli.plant.references import Multisine, Trapezoids
from dsd_cli.plant.simulation import SimulationSettings, simulate
from dsd_cli.signals.log import Log

T, J, STARTUP = 0.002, 0.012, 40
OBSERVER = ObserverSettings(nominal_inertia=0.01, time_constant=0.008)
GAINS = Gains(9.0, 0.6)
SINES = Multisine((1.7, 3.1, 5.3, 7.9), 0.4, seed=3)
MOVES = Trapezoids(distance=1.5, speed=6.0, acceleration=60.0, dwell=0.6, start=0.1)

APPLIED = {"viscous_friction": {"coefficient": 0.03}, "gravity": {"amplitude": 0.2, "phase": 0.4}}
FRICTION = {"coulomb_friction": {"level": 0.15}, "stribeck_friction": {"excess": 0.1, "velocity": 1.0}}
BY_ROLE = {
    "none": {},
    "applied": APPLIED,
    "friction": FRICTION,
    "command": {"dead_zone": {"width": 0.05}},
    "lag": {"actuator_lag": {"time_constant": 0.006}},
    "load": {"flexible_coupling": {"frequency": 25.0, "load_share": 0.3, "damping": 0.02}},
    "load_friction": {"load_friction": {"coefficient": 0.2}},
    "all": {**APPLIED, **FRICTION, "saturation": {"limit": 0.9}},
}


def _log(effects, delay, reference=SINES, source="velocity", sign=1, duration=4.0):
    settings = SimulationSettings(
        model=PlantModel(J, delay, effects),
        duration=duration,
        sample_time=T,
        observer=replace(OBSERVER, sign=sign),
        controller=ControllerSettings("pd", GAINS, "error"),
        reference=reference,
        observe_from=source,
    )
    return simulate(settings)


def _combined(equations, model, plain=True):
    """Columns times the coefficients that the model implies (eq. 13 times alpha)."""
    alpha = OBSERVER.nominal_inertia / model.motor_inertia
    tap = math.floor(model.delay / T + 1e-9)
    late = model.delay / T - tap
    terms = tuple(Term.of(n, get_effect(n).to_columns(v, model.inertia)[1]) for n, v in model.effects.items())
    rows = equations.plain if plain else equations.rows
    inputs = inputs_of(terms)
    found = alpha * (1 - late) * rows(drive(equations, inputs, tap))
    found = found + alpha * late * rows(drive(equations, inputs, tap + 1))
    for term in terms:
        if term.effect.role is Role.INPUT:
            continue
        coefficients, _ = term.effect.to_columns(model.effects[term.id], model.inertia)
        unit = model.inertia / model.motor_inertia if term.effect.role is Role.STRUCTURE else alpha
        for c, raw in zip(coefficients, raw_columns(equations, term, tap), strict=True):
            found = found + unit * c * rows(raw)
    return found


def _filtered(raw, pole):
    out, state = [], 0.0
    for x in raw:
        state = pole * state + (1.0 - pole) * x
        out.append(state)
    return np.array(out)


@pytest.mark.parametrize("delay", [0.0, 0.006, 0.0047], ids=["none", "whole", "fraction"])
@pytest.mark.parametrize("role", BY_ROLE)
@pytest.mark.parametrize("source", ["velocity", "position"])
def test_the_true_model_leaves_nothing_of_an_exact_log(role, delay, source):
    log = _log(BY_ROLE[role], delay, source=source)
    equations = Equations([prepare(log, OBSERVER)], OBSERVER, STARTUP)
    y = equations.plain_measured()
    left = y - _combined(equations, PlantModel(J, delay, BY_ROLE[role]))
    allowed = 2e-3 if set(BY_ROLE[role]) & {"flexible_coupling", *APPLIED, *FRICTION, "load_friction"} else 1e-6
    if source == "position" and delay == 0.0047:
        allowed = max(allowed, 5e-4)  # a second difference weighs what changes within an interval
    assert equations.kept.mean() > 0.5
    assert np.sqrt(np.mean(left**2)) < allowed * np.sqrt(np.mean(y**2))


def test_moves_with_rests_are_explained_where_they_are_clear():
    log = _log(FRICTION, 0.0047, MOVES)
    equations = Equations([prepare(log, OBSERVER)], OBSERVER, STARTUP)
    y = equations.plain_measured()
    left = y - _combined(equations, PlantModel(J, 0.0047, FRICTION))
    assert 0.2 < equations.kept.mean() < 0.95
    assert np.sqrt(np.mean(left**2)) < 2e-3 * np.sqrt(np.mean(y**2))


@pytest.mark.parametrize("role", BY_ROLE)
@pytest.mark.parametrize("source", ["velocity", "position"])
def test_columns_add_up_to_the_one_prediction(role, source):
    """d_hat as predicted, less Q and with u put back by plain loops, masked, and through Q again."""
    delays = (0.004, 0.008) if role == "load_friction" else (0.0047, 0.0091)  # its column is made per whole sample
    true, other = (PlantModel(j, delay, BY_ROLE[role]) for j, delay in zip((J, 0.7 * J), delays, strict=True))
    recording = prepare(_log(BY_ROLE[role], true.delay, MOVES, source), OBSERVER)
    equations = Equations([recording], OBSERVER, STARTUP)
    (stretch,) = equations.stretches
    log, pole = stretch.log, math.exp(-T / OBSERVER.time_constant)
    for model in (true, other):
        predicted = predict_d_hat(replace(model, rest_speed=recording.rest_speed), log, OBSERVER)
        u = log["u"]
        force = np.zeros(len(u))
        for k in range(3, len(u)):
            of_u = u[k - 1] if source == "velocity" else 0.5 * (u[k - 1] + u[k - 2])
            force[k] = (predicted[k] - pole * predicted[k - 1]) / (1.0 - pole) + of_u
        wanted = _filtered(force * stretch.keep, pole)[STARTUP:]
        found = _combined(equations, model)
        assert (stretch.keep == 0.0).sum() > STARTUP
        np.testing.assert_allclose(found, wanted, atol=1e-8 * np.abs(wanted).max())


def _changed(log, name, at, by):
    x = log[name].copy()
    x[at] += by
    return Log({**log.channels, name: x}, log.sample_time, log.source, log.d_hat_source)


def test_what_happens_in_a_masked_interval_leaves_no_trace():
    log = _log(FRICTION, 0.0, MOVES)
    equations = Equations([prepare(log, OBSERVER)], OBSERVER, STARTUP)
    keep = equations.stretches[0].keep
    masked = [k for k in range(STARTUP + 5, len(keep) - 5) if not keep[k : k + 2].any()]  # d_hat_k acts in k and k + 1
    at = [k for k in masked if k % 3 == 0]
    assert len(at) > 20
    touched = Equations([prepare(_changed(log, "d_hat", at, 7.0), OBSERVER)], OBSERVER, STARTUP)
    np.testing.assert_array_equal(touched.stretches[0].keep, keep)
    scale = np.abs(equations.measured()).max()
    np.testing.assert_allclose(touched.measured(), equations.measured(), atol=1e-11 * scale)
    clear = next(k for k in range(500, len(keep)) if keep[k : k + 2].all())
    seen = Equations([prepare(_changed(log, "d_hat", [clear], 7.0), OBSERVER)], OBSERVER, STARTUP)
    assert np.abs(seen.measured() - equations.measured()).max() > 1.0, "the test itself sees d_hat"


def test_columns_in_a_masked_interval_leave_no_trace():
    equations = Equations([prepare(_log(FRICTION, 0.002, MOVES), OBSERVER)], OBSERVER, STARTUP)
    equations.whiten(np.array([1.0, -0.5, 0.2]))
    (stretch,) = equations.stretches
    raw = np.random.default_rng(0).normal(size=len(stretch.log))
    other = np.where(stretch.keep > 0.0, raw, 1e6)
    np.testing.assert_array_equal(equations.rows([other]), equations.rows([raw]))
    np.testing.assert_array_equal(equations.kept, stretch.keep[STARTUP:] > 0.0)


def test_rests_starts_stops_and_reversals_are_masked_and_nothing_else():
    recording = prepare(_log(FRICTION, 0.002, MOVES), OBSERVER)
    (stretch,) = Equations([recording], OBSERVER, STARTUP).stretches
    v = recording.pieces[0]["velocity"]
    slow = recording.rest_speed
    for k in range(STARTUP, len(v)):
        moves_on = abs(v[k]) > slow and abs(v[k - 1]) > slow and v[k] * v[k - 1] > 0.0
        if not moves_on:
            assert stretch.keep[k] == 0.0
        elif all(abs(x) > slow and x * v[k] > 0.0 for x in v[max(k - 31, 0) : k + 31]):
            assert stretch.keep[k] == 1.0
            assert stretch.sign[k] == np.sign(v[k])
    assert not stretch.keep[:STARTUP].any()


def test_whitening_is_that_filter_over_the_rows():
    equations = Equations([prepare(_log(APPLIED, 0.002), OBSERVER)], OBSERVER, STARTUP)
    plain = equations.plain_measured()
    coefficients = np.array([1.0, -0.7, 0.3])
    equations.whiten(coefficients)
    wanted = [
        sum(c * plain[k - i] for i, c in enumerate(coefficients) if k - i >= 0) for k in range(len(plain))
    ]  # the rows before the first are 0: they are masked
    np.testing.assert_allclose(equations.measured(), wanted, atol=1e-12)
    np.testing.assert_array_equal(equations.plain_measured(), plain)
    np.testing.assert_array_equal(equations.unwhitened().measured(), plain)
    assert not np.allclose(equations.measured(), plain)


def test_long_recordings_are_thinned_evenly_and_blocks_follow(monkeypatch):
    logs = [_log(APPLIED, 0.002, duration=2.0), _log(FRICTION, 0.002, duration=1.4)]
    whole = Equations([prepare(log, OBSERVER) for log in logs], OBSERVER, STARTUP)
    monkeypatch.setattr(rows_module, "MOST_ROWS", 500)
    thin = Equations([prepare(log, OBSERVER) for log in logs], OBSERVER, STARTUP)
    total = sum(whole.lengths)
    assert thin.thinning == math.ceil(total / 500)
    assert sum(thin.lengths) <= 500 + 2
    split = np.split(whole.measured(), [whole.lengths[0]])
    np.testing.assert_array_equal(thin.measured(), np.concatenate([x[:: thin.thinning] for x in split]))
    np.testing.assert_array_equal(thin.plain_measured(), whole.measured())
    assert len(thin.kept) == sum(thin.lengths)
    blocks = lay_blocks(thin.lengths, 10, "x")
    found, thinned, at = thin.block_of_plain_rows(blocks), blocks.block_of_rows(), 0
    wanted = []
    for length, rows in zip(thin.lengths, whole.lengths, strict=True):
        wanted += [thinned[at + k // thin.thinning] for k in range(rows)]
        at += length
    assert found.tolist() == wanted


def test_stretches_too_short_for_their_start_are_left_out():
    log = _log(APPLIED, 0.002, duration=2.0)
    recording = prepare(log, OBSERVER, restarts=[75])
    assert [len(p) for p in recording.pieces] == [75, 925]
    assert [len(s.log) for s in Equations([recording], OBSERVER, STARTUP).stretches] == [925]
    both = Equations([recording], OBSERVER, 20)
    assert both.lengths == [55, 905]
    alone = Equations([prepare(log, OBSERVER, restarts=[75])], OBSERVER, 20)
    np.testing.assert_array_equal(both.measured(), alone.measured())


def test_a_jittered_clock_is_no_different():
    """The same log with stamps that jitter by more than the regular clock allows: y by a plain loop."""
    rng = np.random.default_rng(5)
    t = np.cumsum(T * (1.0 + 0.2 * rng.uniform(-1, 1, 1500)))
    v = 3.0 * np.sin(2 * np.pi * 1.3 * t) + 4.0
    u = np.sin(2 * np.pi * 1.3 * t)
    d_hat = np.cos(2 * np.pi * 2.1 * t)
    log = Log({"t": t, "u": u, "velocity": v, "d_hat": d_hat}, T)
    equations = Equations([prepare(log, OBSERVER)], OBSERVER, STARTUP)
    keep, wanted, state = equations.stretches[0].keep, [], 0.0
    for k in range(len(t)):
        p = math.exp(-((t[k] - t[k - 1]) if k else T) / OBSERVER.time_constant)
        raw = (d_hat[k] - p * d_hat[k - 1]) / (1 - p) + u[k - 1] if k else 0.0
        state = p * state + (1 - p) * raw * keep[k]
        wanted.append(state)
    np.testing.assert_allclose(equations.measured(), wanted[STARTUP:], atol=1e-9)
