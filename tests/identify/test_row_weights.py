"""What rows near stops and starts may tell: moves from point to point whose friction rises at low speed, or not."""

import numpy as np
import pytest

from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.verdict.diagnose import Settings, diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

#: s from row to row, and steps of the simulation in that.
STEP, FINE = 1e-3, 4
#: Nm s2, Nm s, Nm, Nm, rad/s: a motor with a weight; u is about 2 Nm rms.
INERTIA, VISCOUS, COULOMB, WEIGHT, SLOW = 1.2e-3, 9e-3, 1.3, -0.4, 7.0
OBSERVER = ObserverSettings(INERTIA, 0.005)
GIVEN = {"coulomb_friction": {"level": COULOMB}, "viscous_friction": {"coefficient": VISCOUS}}
ASKED = Settings(("stribeck_friction", "presliding_friction", "quadratic_drag", "viscous_asymmetry", "constant_load"))


def move(way: float, h: float) -> np.ndarray:
    """Speed of one move and of a rest of 0.25 s after it: 900 rad/s2 up to 80 rad/s, and down again."""
    top = min(80.0, np.sqrt(900.0 * abs(way)))
    up, long = np.arange(0.0, top / 900.0, h) * 900.0, max(int((abs(way) - top**2 / 900.0) / top / h), 0)
    return np.sign(way) * np.concatenate([up, np.full(long, top), up[::-1], np.zeros(int(0.25 / h))])


def point_to_point(seed: int, excess: float):
    """10 s; 1.2 % of u is a force that no effect has, 1 % noise of u, and the position counts 2^16 a turn."""
    random, h = np.random.default_rng(seed), STEP / FINE
    moves = [move(way, h) for way in np.diff(random.uniform(-60.0, 60.0, 40), prepend=0.0)]
    smooth = np.convolve(np.concatenate([np.zeros(800), *moves])[: int(10.0 / h)], np.full(80, 1 / 80), "same")
    speed = np.where(np.abs(smooth) < 1e-9, 0.0, smooth)
    friction = VISCOUS * speed + np.sign(speed) * (COULOMB + excess * np.exp(-((speed / SLOW) ** 2)))
    unknown = np.zeros(len(speed) // 200 + 2)
    for i, x in enumerate(random.normal(size=len(unknown) - 1), 1):
        unknown[i] = 0.85 * unknown[i - 1] + np.sqrt(1.0 - 0.85**2) * x
    hidden = 0.024 * np.interp(np.arange(len(speed)), 200 * np.arange(len(unknown)), unknown)
    force = (INERTIA * np.gradient(speed, h) + friction + hidden - WEIGHT).reshape(-1, FINE).mean(axis=1)
    u = force + 0.02 * random.normal(size=len(force))
    position = h * np.concatenate([[0.0], np.cumsum(speed)[:-1]])[::FINE]
    count = 2.0 * np.pi / 2**16
    return prepare(Log({"u": u, "position": np.round(position / count) * count}, STEP, "log.csv"), OBSERVER)


@pytest.mark.parametrize("seed", [48_614, 48_615])
def test_friction_that_rises_near_stops_is_named_where_it_is(seed):
    """Its rows were all weighed down to one: it made them large itself. Six of twelve logs named it."""
    found = diagnose([point_to_point(seed, 1.2)], PlantModel(INERTIA, 0.0, GIVEN), OBSERVER, ASKED)
    assert set(found.found) == {"constant_load", "stribeck_friction"}
    values = found.joint_values("stribeck_friction")
    for name, true in {"excess": 1.2, "velocity": SLOW}.items():
        assert values[name].value == pytest.approx(true, abs=3.0 * values[name].std_error)
        assert values[name].std_error < 0.1 * true


@pytest.mark.parametrize("seed", [48_616, 48_617])
def test_friction_that_does_not_is_not(seed):
    found = diagnose([point_to_point(seed, 0.0)], PlantModel(INERTIA, 0.0, GIVEN), OBSERVER, ASKED)
    assert found.found == ("constant_load",)
