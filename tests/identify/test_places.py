"""A smooth force of the position that no catalogue has, and laws of the position that do hold everywhere."""

import math

import numpy as np

from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

STEP, INERTIA, LEVEL = 0.002, 0.02, 0.3
ASKED = ("coulomb_friction", "gravity", "stiffness", "cogging", "constant_load")


def found(force, seed=4, effects=ASKED):
    """Of u = J a + Coulomb friction + force(q), with what is exactly known of a motion of sines of some rad."""
    random, t = np.random.default_rng(seed), np.arange(0.0, 20.0, STEP)
    hz, phase = random.uniform(0.3, 3.0, 6), random.uniform(0.0, 2.0 * math.pi, 6)
    w, size = 2.0 * math.pi * hz, 0.35 / (0.3 + hz)
    angle = np.outer(t, w) + phase
    position = np.sin(angle) @ size
    velocity, acceleration = np.cos(angle) @ (size * w), -np.sin(angle) @ (size * w**2)
    channels = {
        "u": INERTIA * acceleration + LEVEL * np.sign(velocity) + force(position),
        "velocity": velocity + 2e-3 * random.normal(size=t.size),
        "position": position + 1e-5 * random.normal(size=t.size),
    }
    observer = ObserverSettings(INERTIA, 0.02)
    recording = prepare(Log(channels, STEP, "log.csv"), observer)
    return diagnose([recording], PlantModel(INERTIA, 0.0, {}), observer, Settings(effects))


def likely(diagnosis):
    return {one.effect for one in diagnosis.missing if one.probability >= 0.5}


def test_several_laws_of_the_position_do_not_pass_for_one_that_no_catalogue_has():
    """A bump of half of u was a weight, a load and sines of two periods, each 70 % sure, and 1 % of u unexplained."""
    got = found(lambda q: 0.6 * np.exp(-(((q - 0.3) / 0.3) ** 2)))
    assert likely(got) == {"coulomb_friction"}
    assert got.unexplained.on == ("position",)
    assert got.unexplained.probability > 0.8
    assert got.unexplained.share_of_u > 0.2


def test_laws_that_hold_in_the_other_half_of_the_travel_keep_their_names():
    """A weight, and magnets with a pitch finer than any free function."""
    got = found(lambda q: 0.5 * np.sin(q) + 0.15 * np.sin(24.0 * q + 1.0))
    assert likely(got) == {"coulomb_friction", "gravity", "cogging"}
    assert got.unexplained.probability < 0.5
