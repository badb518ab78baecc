"""Ripples over a position that creeps: its speed, and how much of a residual they hold."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.fit.path_estimate import along_ripple, ripples
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.search.sets import Search
from tests.identify.outside_rig import asked
from tests.oracle.rig import RigCase, make

STEP, N = 0.011, 1800
t = STEP * np.arange(N)
PERIODS = np.arange(2.0, 80.0, 0.4)


def wandering(seed):
    """A position that goes to and fro over about 4 rad, irregularly; shape (n,)."""
    rng = np.random.default_rng(seed)
    return 2.0 * np.sin(np.cumsum(rng.uniform(0.5, 3.0, N // 60 + 1).repeat(60)[:N]) * STEP)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("creep", [-0.12, 0.0, 0.05])
def test_a_ripple_and_its_creep_are_found(seed, creep):
    rng = np.random.default_rng(seed)
    place, n = wandering(seed), float(rng.uniform(8.0, 60.0))
    left = np.cos(n * place + rng.uniform(0.0, 6.0)) + 0.3 * rng.normal(size=N)
    shares, speeds = ripples(left, t, place + creep * t, PERIODS, 0.2)
    best = int(np.argmax(shares))
    assert PERIODS[best] == pytest.approx(n, abs=0.4)
    assert speeds[best] == pytest.approx(creep, abs=2.0 * np.pi / (N * STEP) / n + 2.0 * 0.4 / n * 0.2)
    assert 0.6 < shares[best] < 1.1


def test_noise_is_no_ripple():
    """20 seeds of white noise: no ripple holds as much as a fifth of what counts as one."""
    found = [
        ripples(np.random.default_rng(s).normal(size=N), t, wandering(s), PERIODS, 0.2)[0].max() for s in range(20)
    ]
    assert max(found) < 0.03


@pytest.fixture(scope="module")
def creeping():
    """An axis with cogging, u and d_hat alone: (recording, model)."""
    (log,) = make([RigCase(what=("cogging",), seed=64320, sensing="udhat")])
    recording, model, _ = asked(log)
    return recording, model


def _along(recordings, model):
    search = Search(pose(recordings, model, Settings()))
    return along_ripple(search.problem, search.refit, recordings)


def test_recordings_are_moved_by_the_creep_that_a_ripple_tells(creeping):
    recording, model = creeping
    share, (moved,) = _along([recording], model)
    assert share > 0.5
    (before,), (after,) = recording.pieces, moved.pieces
    assert np.ptp(after["velocity"] - before["velocity"]) < 1e-12
    assert (after["velocity"] - before["velocity"])[0] == pytest.approx(-0.078, abs=0.01)


def test_two_recordings_of_one_ripple_creep_each_at_its_own_speed(creeping):
    recording, model = creeping
    (piece,) = recording.pieces
    faster = replace(piece, channels={**piece.channels, "velocity": piece["velocity"] + 0.05,
                                      "position": piece["position"] + 0.05 * piece["t"]})  # fmt: skip
    share, moved = _along([recording, replace(recording, name="faster", pieces=(faster,))], model)
    assert share > 0.5
    speeds = [m.pieces[0]["velocity"][0] for m in moved]
    assert speeds[1] == pytest.approx(speeds[0], abs=0.01)


def test_without_a_position_nothing_is_moved(creeping):
    recording, model = creeping
    (piece,) = recording.pieces
    without = replace(piece, channels={k: x for k, x in piece.channels.items() if k != "position"})
    recordings = [replace(recording, pieces=(without,))]
    share, same = _along(recordings, model)
    assert share == 0.0
    assert same[0] is recordings[0]
