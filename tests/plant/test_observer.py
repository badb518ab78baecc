"""The observer: step, run and chunks are the same bits; it agrees with plain loops."""

import importlib.util
import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.errors import DataError
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.plant.observer import DisturbanceObserver, observe_log
from dsd_cli.signals.log import Log

_path = Path(__file__).parents[1] / "oracle" / "plant_oracle.py"
_spec = importlib.util.spec_from_file_location("plant_oracle", _path)
oracle = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(oracle)

T = 1e-3


def signals(n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.standard_normal(n), rng.standard_normal(n), np.cumsum(rng.uniform(0.5, 1.5, n)) * T


def in_chunks(observer, u, x, t, cuts):
    edges = [0, *sorted(cuts), len(u)]
    parts = [observer.run(u[a:b], x[a:b], None if t is None else t[a:b]) for a, b in itertools.pairwise(edges)]
    return np.concatenate(parts)


@given(
    n=st.integers(0, 40),
    cuts=st.lists(st.integers(0, 40), max_size=5),
    source=st.sampled_from(["velocity", "position"]),
    irregular=st.booleans(),
    tau=st.sampled_from([0.0, 0.003, 0.01]),
    sign=st.sampled_from([1, -1]),
)
def test_step_run_and_chunks_are_the_same_bits(n, cuts, source, irregular, tau, sign):
    u, x, t = signals(n)
    t = t if irregular else None
    make = lambda: DisturbanceObserver(ObserverSettings(0.7, tau, sign), T, source)  # noqa: E731
    stepper = make()
    steps = np.array([stepper.step(u[k], x[k], None if t is None else t[k]) for k in range(n)])
    assert np.array_equal(steps, make().run(u, x, t))
    assert np.array_equal(steps, in_chunks(make(), u, x, t, [min(c, n) for c in cuts]))


@pytest.mark.parametrize("tau", [0.0, 0.01])
def test_agrees_with_plain_loops(tau):
    u, x, _ = signals(300)
    observer = ObserverSettings(0.7, tau)
    by_velocity = DisturbanceObserver(observer, T, "velocity").run(u, x)
    np.testing.assert_allclose(by_velocity, oracle.observe_velocity(u, x, T, 0.7, tau), rtol=1e-9, atol=1e-9)
    by_position = DisturbanceObserver(observer, T, "position").run(u, x)
    np.testing.assert_allclose(by_position, oracle.observe_position(u, x, T, 0.7, tau), rtol=1e-6, atol=1e-6)


@settings(max_examples=20)
@given(st.sampled_from(["velocity", "position"]))
def test_stamps_on_a_regular_clock_change_nothing(source):
    u, x, _ = signals(100)
    x = x * T**2
    regular = DisturbanceObserver(ObserverSettings(), T, source).run(u, x)
    stamped = DisturbanceObserver(ObserverSettings(), T, source).run(u, x, T * np.arange(100))
    np.testing.assert_allclose(regular, stamped, rtol=1e-6, atol=1e-9)


def test_constant_disturbance_is_found():
    """J = Jn under u and a constant force 0.4: d_hat settles on 0.4, from velocity and from position."""
    n = 200
    u = np.sin(np.arange(n) / 20)
    velocity = np.concatenate([[0.0], np.cumsum((u[:-1] + 0.4) * T)])
    position = np.concatenate([[0.0], np.cumsum(0.5 * T * (velocity[1:] + velocity[:-1]))])
    for source, measured in (("velocity", velocity), ("position", position)):
        d_hat = DisturbanceObserver(ObserverSettings(), T, source).run(u, measured)
        np.testing.assert_allclose(d_hat[120:], 0.4, rtol=1e-4)


def test_observe_log_prefers_velocity_and_honours_the_sign():
    u, x, _ = signals(50)
    log = Log({"u": u, "velocity": x, "position": np.cumsum(x) * T}, T)
    observed = observe_log(log, ObserverSettings())
    assert observed.d_hat_source == "velocity"
    np.testing.assert_array_equal(observe_log(log, ObserverSettings(sign=-1))["d_hat"], -observed["d_hat"])
    assert observe_log(Log({"u": u, "position": x}, T), ObserverSettings()).d_hat_source == "position"


@pytest.mark.parametrize(("channels", "word"), [({"u": [0.0]}, "velocity"), ({"velocity": [0.0]}, "u")])
def test_observe_log_says_what_is_missing(channels, word):
    with pytest.raises(DataError, match=word):
        observe_log(Log(channels, T), ObserverSettings())


@pytest.mark.parametrize("tau", [0.0, 0.003])
def test_irregular_stamps_see_a_constant_acceleration(tau):
    """Jn = 1, u = 0, a = 3 and jittering stamps: d_hat is 3, whatever the intervals."""
    t = np.cumsum(np.random.default_rng(5).uniform(0.3, 1.7, 60)) * T
    for source, measured in (("velocity", 3 * t), ("position", 1.5 * t**2)):
        d_hat = DisturbanceObserver(ObserverSettings(time_constant=tau), T, source, initial=3.0).run(0 * t, measured, t)
        np.testing.assert_allclose(d_hat, 3.0, rtol=1e-6)
