"""Machines whose inertia varies: no catalogue has them, and a weight and a constant load pass for them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.rig import RigCase, make

J, DELAY_ROWS, STEP, COUNT = 0.01, 15, 1e-3, 20_000


def arm(t, q):
    """(J, dJ/dq) of an arm, or of a crank, whose load comes and goes with its angle."""
    return J * (1.0 + 0.4 * math.sin(q)), 0.4 * J * math.cos(q)


def payload(t, q):
    """Picked up halfway."""
    return (J if t < 0.5 * COUNT * STEP else 1.4 * J), 0.0


def log_of(inertia, seed=1, counts=40_000):
    """J(q) a + J'(q) v^2 / 2 = u(t - delay) by Runge-Kutta, under a loop that wanders over some rad."""
    rng = np.random.default_rng(seed)
    hz, phase = rng.uniform(0.2, 3.0, 6), rng.uniform(0.0, 2.0 * np.pi, 6)
    w, size = 2.0 * np.pi * hz, 0.4 / hz
    t = STEP * np.arange(COUNT)
    wanted = (size * np.sin(np.outer(t, w) + phase)).sum(axis=1)
    speed = (size * w * np.cos(np.outer(t, w) + phase)).sum(axis=1)
    pushed = -(size * w**2 * np.sin(np.outer(t, w) + phase)).sum(axis=1)
    dither = np.convolve(rng.normal(size=COUNT), np.ones(5) / math.sqrt(5.0), "same") * 0.2 * np.std(pushed)

    def change(at, x, u):
        mass, slope = inertia(at, x[0])
        return np.array([x[1], (u - 0.5 * slope * x[1] ** 2) / mass])

    x, u, q = np.array([wanted[0], speed[0]]), np.zeros(COUNT), np.zeros(COUNT)
    for k in range(COUNT):
        q[k] = x[0]
        u[k] = J * (pushed[k] + dither[k] + 400.0 * (wanted[k] - x[0]) + 24.0 * (speed[k] - x[1]))
        acts = u[max(k - DELAY_ROWS, 0)]
        a = change(t[k], x, acts)
        b = change(t[k], x + 0.5 * STEP * a, acts)
        c = change(t[k], x + 0.5 * STEP * b, acts)
        d = change(t[k], x + STEP * c, acts)
        x = x + STEP / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    pitch = 2.0 * np.pi / counts
    return Log({"t": t, "u": u, "position": pitch * np.round(q / pitch)}, STEP, "log.csv")


def diagnosed(log):
    observer = ObserverSettings(J, 0.02)
    return diagnose([prepare(log, observer)], PlantModel(J, DELAY_ROWS * STEP, {}), observer)


@pytest.mark.parametrize(("inertia", "on"), [(arm, "position"), (payload, "time")])
def test_an_inertia_that_varies_is_unknown_and_said_to_vary(inertia, on):
    """The arm was a constant load and gravity, 82 % sure; the payload a line in time and a cubic spring."""
    found = diagnosed(log_of(inertia))
    assert (found.verdict, found.found, found.nearest) == ("unknown", (), "")
    assert found.depends_on == ("gain of u", on)
    assert any("inertia" in line and on in line for line in found.advice)


def test_an_inertia_that_does_not_vary_is_not_said_to():
    found = diagnosed(log_of(lambda t, q: (J, 0.0)))
    assert (found.verdict, found.depends_on) == ("none", ())


def test_where_no_position_can_be_had_nothing_is_asked_of_it():
    """Of u and d_hat alone, where what the speed adds up to drifts away: a traceback once."""
    (log,) = make([RigCase(what=("coulomb_friction",), seed=7100, sensing="speed40k", duration=5.0)])
    observer = ObserverSettings(log.observer["nominal_inertia"], log.observer["time_constant"])
    model = PlantModel(log.believed["inertia"], log.believed["delay"], log.believed["effects"])
    recording = prepare(Log(log.channels, log.sample_time, "log.csv"), observer)
    bare = [
        replace(piece, channels={name: x for name, x in piece.channels.items() if name != "position"})
        for piece in recording.pieces
    ]
    recording = replace(recording, pieces=tuple(bare), missing={"position": "it would drift away"})
    assert diagnose([recording], model, observer).verdict == "coulomb_friction"
