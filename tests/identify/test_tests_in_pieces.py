"""Tests in pieces, as of WPILib's SysId: slow ramps of the voltage and steps of it, each way; the steps alone
accelerate, and the ramps are nine tenths of the log."""

import math

import numpy as np
import pytest

from dsd_cli.identify.fit.band import telling_length
from dsd_cli.identify.fit.problem import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.recordings.spectrum import SensorNoise, density
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

T = 0.02
LEVEL, DAMPING, INERTIA = "coulomb_friction.level", "viscous_friction.coefficient", "inertia"
ASKED = Settings(effects=("coulomb_friction", "viscous_friction", "quadratic_drag", "stiffness", "dead_zone"))


def piece(u, ks, kv, ka):
    """Position of V = Ks sign(v) + Kv v + Ka a from rest, u held from sample to sample: exact while u does not turn."""
    left = math.exp(-T * kv / ka)
    q, v = np.zeros(len(u)), 0.0
    for k, volts in enumerate(u[:-1]):
        end = math.copysign(max(abs(volts) - ks, 0.0), volts) / kv
        q[k + 1] = q[k] + end * T + (v - end) * (1.0 - left) * ka / kv
        v = end + (v - end) * left
    return q


def diagnosed(seed, tests):
    """(what is said of a log of these tests, values of the machine), sizes by chance."""
    rng = np.random.default_rng(seed)
    ks, kv, tau, rate = rng.uniform(0.15, 0.9), rng.uniform(0.5, 3.0), rng.uniform(0.1, 0.35), rng.uniform(0.25, 1.0)
    ka, count = kv * tau, rng.uniform(3e-5, 3e-4)
    t = {"slow": np.arange(rng.integers(350, 600)) * T, "fast": np.arange(rng.integers(80, 150)) * T}
    shape = {"slow": rate * t["slow"], "fast": np.where(t["fast"] > 0.1, 7.0, 0.0)}
    every = [(t[kind], sign * shape[kind]) for kind in tests for sign in (1.0, -1.0)]
    begins = np.cumsum([30.0 * (i + 1) for i in range(len(every))])
    channels = {
        "t": np.concatenate([begin + own for begin, (own, _) in zip(begins, every, strict=True)]),
        "u": np.concatenate([u for _, u in every]),
        "position": np.concatenate([np.round(piece(u, ks, kv, ka) / count) * count for _, u in every]),
    }
    restarts = np.cumsum([len(u) for _, u in every])[:-1].tolist()
    believed = ka * rng.uniform(0.6, 1.7)
    observer = ObserverSettings(believed, 0.05)
    recording = prepare(Log(channels, T, "log.csv"), observer, restarts)
    return diagnose([recording], PlantModel(believed), observer, ASKED), {LEVEL: ks, DAMPING: kv, INERTIA: ka}


@pytest.mark.parametrize("seed", [29, 31])
def test_steps_beside_long_ramps_show_dry_friction_and_inertia(seed):
    diagnosis, truth = diagnosed(seed, ("slow", "fast"))
    assert set(diagnosis.found) == {"coulomb_friction", "viscous_friction"}
    for name, value in truth.items():
        found = diagnosis.estimates[name]
        assert abs(found.value - value) < max(3.0 * found.std_error, 0.01 * value), name


@pytest.mark.parametrize("seed", [5, 6, 7])
def test_ramps_alone_tell_no_inertia(seed):
    """J a, dry friction and a delay are each one constant a direction there."""
    diagnosis, _ = diagnosed(seed, ("slow",))
    assert diagnosis.estimates[INERTIA].grade == "not"
    assert math.isnan(diagnosis.estimates[INERTIA].std_error)


def test_a_piece_shorter_than_a_segment_is_in_the_spectrum():
    rng = np.random.default_rng(11)
    quiet, k = 1e-3 * rng.standard_normal(2000), np.arange(150)
    found = density([quiet, np.sin(0.9 * k)])
    assert found.angle[np.argmax(found.power)] == pytest.approx(0.9, abs=0.02)
    # of white noise in pieces of any length the density is its variance
    white = density([3.0 * rng.standard_normal(n) for n in (3000, *[200] * 40)])
    assert np.mean(white.power) == pytest.approx(9.0, rel=0.06)


def test_the_pieces_that_tell_are_those_that_accelerate():
    rng = np.random.default_rng(12)
    noise = SensorNoise("position", 0.0, 1e-4)
    slow, fast = (noise.made(n, rng) for n in (4000, 200))
    steps = [fast + 10.0 * np.exp(-np.arange(200) / 20.0) for _ in range(2)]
    assert telling_length([([slow, slow, *steps], noise)]) == 200
    assert telling_length([([slow + 1.0, *steps], noise)]) == 4000  # it holds more than half
    assert telling_length([([0.0 * slow, 0.0 * fast], noise)]) == 4000  # nothing accelerates
