"""When an axis rests: while it stays, and not while it only turns or passes slowly."""

import numpy as np
import pytest

from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.fit.stretches import resting, slow_spells
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.axis_motion import moves

REST = 0.1


def _move(*parts):
    return np.concatenate([np.asarray(p, dtype=float) for p in parts])


def test_a_dwell_between_two_moves_is_rest_and_the_moves_are_not():
    v = _move(np.full(50, 1.0), np.zeros(40), np.full(50, -1.0))
    found = resting(v, REST)
    assert found.shape == v.shape
    assert found[51:90].all()  # intervals both of whose ends are slow
    assert not found[:51].any()
    assert not found[90:].any()


def test_an_axis_that_turns_is_not_at_rest():
    """The speed passes straight through the band of slow speeds, in however many samples."""
    for samples in (8, 20, 200, 1000):
        v = _move(np.full(20, 1.0), np.linspace(REST, -REST, samples), np.full(20, -1.0))
        assert not resting(v, REST).any(), samples


def test_creeping_near_the_band_is_not_rest():
    slow = 0.9 * REST
    assert not resting(_move(np.full(20, 1.0), np.full(60, slow), np.full(20, 1.0)), REST).any()
    creeping = 0.3 * REST
    assert resting(_move(np.full(20, 1.0), np.full(60, creeping), np.full(20, 1.0)), REST).sum() == 59


@pytest.mark.parametrize("seed", range(10))
def test_noise_on_a_standing_axis_is_rest(seed):
    rng = np.random.default_rng(seed)
    v = _move(np.full(50, 1.0), np.zeros(300), np.full(50, -1.0)) + REST / 5.0 * rng.normal(size=400)
    assert resting(v, REST)[60:340].mean() > 0.95


@pytest.mark.parametrize("seed", range(10))
def test_noise_on_a_turning_axis_makes_no_rest(seed):
    rng = np.random.default_rng(seed)
    v = _move(np.linspace(1.0, -1.0, 1000)) + REST / 5.0 * rng.normal(size=1000)
    assert not resting(v, REST).any()


def test_a_rest_has_so_many_samples_at_least():
    for count in range(1, 12):
        v = _move(np.full(9, 1.0), np.zeros(count), np.full(9, 1.0))
        assert resting(v, REST).sum() == (count - 1 if count - 1 >= POLICY.least_rest_samples else 0)


def test_a_whole_log_may_be_rest_and_a_rest_may_end_it():
    assert resting(np.zeros(30), REST).all()
    assert resting(_move(np.ones(20), np.zeros(30)), REST)[21:].all()
    assert not resting(np.ones(30), REST).any()


def test_which_way_the_axis_moves_does_not_matter():
    rng = np.random.default_rng(1)
    v = np.cumsum(rng.normal(size=2000)) * 0.02
    np.testing.assert_array_equal(resting(v, REST), resting(-v, REST))
    np.testing.assert_array_equal(resting(v, REST), resting(1000.0 * v, 1000.0 * REST))


def test_an_axis_creeps_where_it_is_slow_for_long_and_not_where_it_turns():
    turns = np.sin(2.0 * np.pi * 0.3 * np.arange(0.0, 10.0, 1e-3))
    assert slow_spells(turns, 0.01).any()
    assert not slow_spells(turns, 0.01, 11).any()
    found = slow_spells(_move(turns, np.full(50, 3e-3), turns[500:]), 0.01, 11)
    assert found[len(turns) + 1 : len(turns) + 50].all()
    assert found.sum() < 60


@pytest.mark.parametrize("width", [0.0, 0.003, 0.006], ids=["ideal", "stiff", "soft"])
def test_friction_that_a_creeping_axis_has_in_part_bends_no_value(width):
    """Between moves the axis creeps at 0.6 % of its rms speed, where friction is a part of its level (`width` of it, in
    that speed): 13 % of the level were lost, and 20 % of the damping wrong."""
    inertia, values = 0.04, {"viscous_friction": 0.4, "coulomb_friction": 0.8, "stiffness": 2.0}
    rng, t = np.random.default_rng(2026), np.arange(0.0, 12.0, 1e-3)
    q = moves(rng, t, 1.0, 2.0)
    rms = float(np.sqrt(np.mean(np.gradient(q, t) ** 2)))
    q += 0.006 * rms / (2.0 * np.pi * 0.7) * np.sin(2.0 * np.pi * 0.7 * t)
    v = np.gradient(q, t)
    friction = np.tanh(v / (width * rms)) if width else np.sign(v)
    force = inertia * np.gradient(v, t) + 0.4 * v + 0.8 * friction + 2.0 * q + 0.002 * rng.normal(size=t.size)
    u = 0.5 * (force + np.append(force[1:], force[-1]))  # held from stamp to stamp
    log = Log({"t": t, "u": u, "position": q + 1e-6 * rng.normal(size=t.size)}, 1e-3, "log.csv")
    parameters = {"coulomb_friction": "level"}
    effects = {name: {parameters.get(name, "coefficient"): value} for name, value in values.items()}
    problem = pose([prepare(log, ObserverSettings(inertia, 0.01))], PlantModel(inertia, 0.0, effects), Settings(()))
    found = problem.values(Search(problem).refit).estimates
    for name, value in values.items():
        assert found[f"{name}.{parameters.get(name, 'coefficient')}"].value == pytest.approx(value, rel=0.005), name
    assert found["inertia"].value == pytest.approx(inertia, rel=0.005)
