"""A regular clock and a held command, whatever the log was: motion by splines, impulses by what was held."""

from dataclasses import dataclass

import numpy as np
import pytest

from dsd_cli.identify.d_hat_makers import OpenLog
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.recordings.smoothing import MEAN_OF_SIX, regularised
from dsd_cli.plant.maker import MAKERS, Maker
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from dsd_cli.signals.passes import passed
from tests.oracle.d_hat_makers import made

T, ROWS = 0.001, 800


def _stamps(seed, share=0.3):
    rng = np.random.default_rng(seed)
    return np.cumsum(T * (1.0 + share * rng.uniform(-1, 1, ROWS)))


@dataclass(frozen=True)
class _Log(Log):
    """With how its command was logged: held until the next sample, or measured at the sample."""

    u_hold: str = "held"


def _log(t, u, hold="held", **channels):
    return _Log({"t": t, "u": u, **channels}, T, "log.csv", u_hold=hold)


def test_a_regular_log_is_left_as_it_is():
    t = T * np.arange(ROWS)
    log = _log(t, np.sin(9 * t), velocity=np.cos(9 * t))
    assert regularised(log) is log


@pytest.mark.parametrize("seed", range(4))
def test_jittered_stamps_become_even_ones_over_the_same_time(seed):
    t = _stamps(seed)
    found = regularised(_log(t, np.zeros(ROWS), velocity=np.zeros(ROWS)))
    steps = np.diff(found["t"])
    np.testing.assert_allclose(steps, found.sample_time, rtol=1e-9)
    assert found.sample_time == pytest.approx(T, rel=0.05)
    assert found["t"][0] == t[0]
    assert found["t"][-1] == pytest.approx(t[-1], abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_a_cubic_motion_comes_back_at_the_new_stamps(seed):
    t, powers = _stamps(seed), [3.0, -2.0, 0.5, 1.0]
    found = regularised(_log(t, np.zeros(ROWS), position=np.polyval(powers, t)))
    np.testing.assert_allclose(found["position"], np.polyval(powers, found["t"]), atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_a_held_command_keeps_its_mean_over_every_new_interval(seed):
    """By brute force: the staircase, sampled ten thousand times per interval."""
    t, rng = _stamps(seed), np.random.default_rng(seed)
    u = rng.normal(size=ROWS)
    found = regularised(_log(t, u, velocity=np.sin(t)))
    for k in rng.integers(0, ROWS - 2, 30):
        fine = found["t"][k] + found.sample_time * (np.arange(10_000) + 0.5) / 10_000
        held = u[np.searchsorted(t, fine, side="right") - 1]
        assert found["u"][k] == pytest.approx(held.mean(), abs=2e-3)


def test_no_impulse_is_lost():
    t = _stamps(9)
    u = np.random.default_rng(9).normal(size=ROWS)
    found = regularised(_log(t, u, velocity=np.sin(t)))
    given = np.sum(u[:-1] * np.diff(t))
    assert np.sum(found["u"][:-1]) * found.sample_time == pytest.approx(given, abs=1e-9)


@pytest.mark.parametrize("jitter", [False, True])
def test_a_command_that_was_measured_becomes_its_mean_ahead(jitter):
    """A smooth signal that was sampled is not a staircase: half a sample lies between the two."""
    t = _stamps(3, 0.2) if jitter else T * np.arange(ROWS)
    found = regularised(_log(t, np.sin(2 * np.pi * 5.0 * t), hold="sampled", velocity=np.cos(t)))
    w, start = 2 * np.pi * 5.0, found["t"]
    wanted = (np.cos(w * start) - np.cos(w * (start + found.sample_time))) / (w * found.sample_time)
    inner = slice(3, -3)
    late = np.abs(np.sin(w * start) - wanted)[inner].max()  # what a staircase would be off
    assert np.abs(found["u"] - wanted)[inner].max() < (0.3 if jitter else 1e-3) * late


@pytest.mark.parametrize("maker", [Maker(), Maker("euler", "newest")], ids=str)
def test_a_d_hat_has_the_samples_of_a_command_that_was_measured(maker):
    """Whatever acted between them: with the observer's own u taken out again the acceleration is that of the speed."""
    t, nominal, tau = T * np.arange(ROWS), 0.03, 0.01
    u, v = np.sin(2 * np.pi * 25.0 * t), np.sin(2 * np.pi * 6.0 * t)
    log = _log(t, u, hold="sampled", d_hat=made(t, u, v, nominal, tau, maker.filter, maker.u))
    observer = ObserverSettings(nominal, tau, 1)
    asked = OpenLog((prepare(log, observer),), PlantModel(nominal, 0.0, {}), observer, MAKERS)
    for recording in (asked.made(maker)[0][0], asked.parts[maker][0]):
        (piece,) = recording.pieces
        assert piece["u"] == pytest.approx(passed(u, MEAN_OF_SIX, 2), abs=1e-12)
        assert piece["acceleration"][2:] == pytest.approx(np.diff(v)[1:] / T, abs=1e-6)


def test_the_mean_ahead_is_exact_on_quintics():
    k = np.arange(40.0)
    powers = np.array([1e-6, -2e-4, 0.01, -0.3, 2.0, 1.0])
    whole = np.polyint(powers)
    wanted = np.polyval(whole, k + 1) - np.polyval(whole, k)
    np.testing.assert_allclose(passed(np.polyval(powers, k), MEAN_OF_SIX, 2)[2:-3], wanted[2:-3], rtol=1e-9)
    assert passed(np.full(9, 3.0), MEAN_OF_SIX, 2).tolist() == pytest.approx([3.0] * 9)
