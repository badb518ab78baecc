"""Friction that builds up over time: beside a further law, and where it would be the stops of an axis."""

import math

import pytest

from bench.learn_nothing import COMPLETE, known_of
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.learn.learning import learn
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.rig_strange import LAWS, make
from tests.oracle.rig_strange_laws import Law

LATE = LAWS["friction_builds_up"]


def _magnet(s, q):
    return -0.8 * s.size * math.exp(-(((q - 0.3) / 0.15) ** 2))


BOTH = Law("", LATE.draw, lambda s, t, q, v, u: LATE.force(s, t, q, v, u) + _magnet(s, q), LATE.on, after=LATE.after)
#: Less after a while than right after a turn, by less than the dry friction beside it, so that it does not drive.
FALLS = Law("", LATE.draw, lambda s, t, q, v, u: -0.1 * LATE.force(s, t, q, v, u), LATE.on, after=LATE.after)


def learnt_of(law, seed, sensor, motion):
    log = make(law, seed, sensor, motion, laws={**COMPLETE, "both": BOTH, "falls": FALLS})
    model = PlantModel(log.inertia, log.delay, {**log.believed, **known_of(log)})
    return log, learn([prepare(Log(log.channels, 1e-3, law), ObserverSettings(log.inertia, 0.01))], model)


def test_a_push_at_every_turn_that_is_shorter_than_the_band_shows_is_no_friction_that_builds_up():
    """The axis sticks at its turns for 1 to 200 ms, the encoder shows 20 ms of them as motion; the model has it all."""
    log, found = learnt_of("stribeck", 9302, "enc40k", "sines")
    assert (log.motion[1] == 0.0).sum() > 500  # it does stick
    assert found.verdict != "learnt"
    assert "may be the sensor's noise" in found.why  # counts at turns: of those rows hardly any counts


def test_a_force_over_the_position_is_learnt_beside_friction_that_builds_up():
    log, found = learnt_of("both", 9301, "speed40k", "moves")
    assert found.verdict == "learnt"
    assert set(found.channels) == {"memory", "position"}
    lags = found.model.effects["lagged_friction"]
    assert lags["time_constants"] == pytest.approx([log.drawn["tau"]], rel=0.15)
    assert lags["levels"] == pytest.approx([1.3 * log.drawn["size"]], rel=0.1)


def test_friction_that_is_highest_right_after_a_turn_is_said_to_fall_off():
    log, found = learnt_of("falls", 9401, "speed40k", "moves")
    lags = found.model.effects["lagged_friction"]
    assert lags["time_constants"] == pytest.approx([log.drawn["tau"]], rel=0.15)
    assert lags["levels"] == pytest.approx([-0.13 * log.drawn["size"]], rel=0.1)
    assert found.family == "friction that falls off over time after each turn"
