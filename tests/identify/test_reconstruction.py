"""The constant and the ramp that an integrated speed has too much, on motions whose true speed is known."""

import numpy as np
import pytest

from dsd_cli.identify.recordings.reconstruction import drift
from dsd_cli.signals.log import Log

T, N = 0.004, 3000
#: rad/s in 1 s, of the noise of `integrated`.
WALK = 1e-3 * np.sqrt(T) / 0.05
t = T * np.arange(N)


def to_and_fro():
    """Trapezoids of speed with a rest of 0.5 s between them, both ways alike; shape (n,), rad/s."""
    phase = (t % 3.0) / 3.0
    up = np.interp(phase, [0.0, 0.08, 0.25, 0.33, 0.5, 0.58, 0.75, 0.83, 1.0], [0, 2, 2, 0, 0, -2, -2, 0, 0])
    return np.asarray(up)


def sines():
    return 1.4 * np.cos(2.1 * t) + 0.9 * np.cos(5.3 * t + 1.0)


def integrated(speed, forces, offset, ramp=0.0, noise=0.0, seed=0):
    """(speed with the constant and the ramp that integration adds, net force J a, log with u)."""
    a = np.gradient(speed, T)
    place = np.cumsum(speed) * T
    net = 0.05 * a + noise * np.random.default_rng(seed).normal(size=N)
    u = net + forces(speed, place)
    return speed + offset + ramp * (t - t.mean()), net, Log({"t": t, "u": u}, T)


def coulomb(speed, _place):
    return 0.3 * np.sign(speed)


def spring(_speed, place):
    return 0.8 * place


@pytest.mark.parametrize("offset", [-0.7, 0.2])
@pytest.mark.parametrize(("motion", "forces"), [(to_and_fro, coulomb), (sines, coulomb), (sines, spring)])
def test_the_constant_is_found_by_what_forces_do(motion, forces, offset):
    """Friction jumps where the true speed is zero; a spring is where it was. Within 3 % of the rms speed."""
    speed = motion()
    found = drift(*integrated(speed, forces, offset, noise=1e-3), WALK)
    assert found.shape == (N,)
    assert np.abs(found - offset).max() < 0.03 * np.std(speed)


def test_a_ramp_is_found_where_rests_are_spread_over_the_log():
    speed = to_and_fro()
    found = drift(*integrated(speed, coulomb, 0.4, ramp=0.001, noise=1e-3), WALK)
    assert np.abs(found - 0.4 - 0.001 * (t - t.mean())).max() < 1e-6  # the speed itself has no noise


def test_rests_are_followed_as_noise_makes_the_speed_wander():
    """Of 20 seeds; known at rests alone, a random walk is a bridge between them: walk^2 gap / 6 of variance there."""
    speed, walk, off = to_and_fro(), 0.02, []
    for seed in range(20):
        _, net, piece = integrated(speed, coulomb, 0.0, noise=1e-3, seed=seed)
        wandered = 0.2 + walk * np.cumsum(np.random.default_rng(100 + seed).normal(size=N)) * np.sqrt(T)
        off.append(drift(speed + wandered, net, piece, walk) - wandered)
    bridge = walk * np.sqrt(1.0 / 6.0 * 2.0 / 3.0)  # 1 s of every 1.5 s are a move
    assert np.sqrt(np.mean(np.square(off))) < 2.0 * bridge  # a constant and a ramp leave four times as much


def test_slow_moves_at_constant_speed_are_no_rests():
    """They are as quiet as rests, and near: but for the walk they would be taken for rests of a speed that jumps."""
    creep = np.where((t % 3.0 > 1.5) & (t % 3.0 < 2.1), 0.05, 0.0)
    speed = to_and_fro() + creep * (to_and_fro() == 0.0)
    _, net, piece = integrated(to_and_fro(), coulomb, 0.0, noise=1e-3)
    found = drift(speed + 0.2, net, piece, 1e-3)
    np.testing.assert_allclose(found, 0.2, atol=5e-3)


def test_an_axis_that_works_comes_back():
    """A constant under which it would run away is no answer, whatever it explains: here forces tell nothing."""
    found = drift(*integrated(sines(), lambda speed, place: 0.0 * speed, 0.5), WALK)
    travel = [np.ptp(np.cumsum(sines() + 0.5 - x) * T) for x in (0.5, float(found[0]))]
    assert travel[1] < 2.0 * travel[0]


def test_an_axis_that_stands_is_all_constant():
    stood = Log({"t": t, "u": np.zeros(N)}, T)
    np.testing.assert_array_equal(drift(np.full(N, 0.3), np.zeros(N), stood, WALK), np.full(N, 0.3))


def test_the_answer_does_not_depend_on_when_the_log_begins():
    speed, net, piece = integrated(sines(), coulomb, 0.6, noise=1e-3)
    later = Log({"t": t + 1e4, "u": piece["u"]}, T)
    np.testing.assert_allclose(drift(speed, net, later, WALK), drift(speed, net, piece, WALK), rtol=1e-9)
