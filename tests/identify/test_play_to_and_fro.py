"""Play behind a motor that goes to and fro between two places, its Coulomb friction missing as well.

What the play leaves is the same again in each cycle, as cogging is: the search has to see it before it adds lines.
"""

import math

import numpy as np
import pytest

from dsd_cli.effects import get_effect
from dsd_cli.effects.base import Ranges
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.task import Task, searched_as_is
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

T, FINE = 1e-3, 20
INERTIA, SHARE, GAP, STIFFNESS, DAMPING = 0.01, 0.5, 0.012, 60.0, 0.3
VISCOUS, COULOMB = 0.01, 0.15
OBSERVER = ObserverSettings(INERTIA, 0.005)


def contact(apart: float, closing: float) -> float:
    """Torque between motor and load: a spring and a damper on each flank, which push and never pull."""
    depth = abs(apart) - 0.5 * GAP
    if depth <= 0.0:
        return 0.0
    side = math.copysign(1.0, apart)
    drag = 2.0 * DAMPING * math.sqrt(STIFFNESS * SHARE * INERTIA)
    return side * max(STIFFNESS * depth + drag * side * closing, 0.0)


def servo(duration: float, load: float, ripple: float = 0.0) -> Log:
    """Motor and load in explicit steps, much shorter than a sample; the motor sticks. ripple : N m, of 20 rad."""
    t = T * np.arange(round(duration / T))
    phase = (2.0 * t / 0.7) % 2.0
    s = np.clip(np.where(phase < 1.0, phase, phase - 1.0) / 0.75, 0.0, 1.0)
    s = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
    goal = 1.2 * np.where(phase < 1.0, s, 1.0 - s)
    rate, h, motor = np.gradient(goal, T), T / FINE, (1.0 - load) * INERTIA
    q = v = p = w = 0.0
    torques, places = np.zeros(len(t)), np.zeros(len(t))
    for i in range(len(t)):
        u = 9.0 * (goal[i] - q) + 0.6 * (rate[i] - v)
        torques[i], places[i] = u, q
        for _ in range(FINE):
            force = contact(q - p, v - w) if load else 0.0
            net = u - force - VISCOUS * v - ripple * math.sin(20.0 * q)
            way = math.copysign(1.0, v if v else net)
            after = v + h * (net - way * COULOMB) / motor
            v = 0.0 if after * way < 0.0 else after  # what friction stops stays
            q, w = q + h * v, w + (h * force / (load * INERTIA) if load else 0.0)
            p += h * w
    return Log({"t": t, "u": torques, "position": 1e-6 * np.round(places / 1e-6)}, T, "log.csv")


def found(log: Log) -> dict[str, dict[str, float]]:
    """What the search adds to a model that has the viscous friction alone."""
    model = PlantModel(INERTIA, 0.0, {"viscous_friction": {"coefficient": VISCOUS}})
    search, whole = searched_as_is(Task((prepare(log, OBSERVER),), model, Settings()))
    effects = search.problem.scale.model(whole).effects
    return {name: dict(effects[name]) for name in effects if name not in model.effects}


def test_play_is_seen_before_lines_take_its_place():
    there = found(servo(5.0, SHARE))
    assert {*there} == {"coulomb_friction", "backlash"}
    assert there["coulomb_friction"]["level"] == pytest.approx(COULOMB, rel=0.01)
    assert there["backlash"]["gap"] == pytest.approx(GAP, rel=0.01)
    assert there["backlash"]["load_share"] == pytest.approx(SHARE, rel=0.03)
    assert there["backlash"]["stiffness"] == pytest.approx(STIFFNESS, rel=0.05)


def test_a_line_beside_friction_stays_one():
    there = found(servo(5.0, 0.0, ripple=0.05))
    assert {*there} == {"coulomb_friction", "cogging"}
    assert there["cogging"]["amplitude"] == pytest.approx(0.05, rel=0.03)


def test_one_of_the_close_starts_of_a_play_is_in_its_valley():
    seen = Ranges(
        speed=3.0, top_speed=6.0, travel=1.2, drive=0.5, top_drive=1.0, sample_time=T, duration=5.0, band_hz=100
    )
    effect = get_effect("backlash")
    starts = effect.closely(seen)
    for gap, hz in ((0.002, 8.0), (0.02, 25.0), (0.2, 90.0)):
        off = [(abs(math.log(s["gap"] / gap)), abs(math.log(s["frequency"] / hz))) for s in starts]
        assert any(a <= effect.valley["gap"] and b <= effect.valley["frequency"] for a, b in off)
    assert effect.closely(seen._replace(duration=0.0)) == []
