"""The tiers of the paired study: logs that repeat and show what they promise; makers of d_hat as the books say."""

import ast
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from tests.oracle import axes, d_hat_makers, tiers_axes, tiers_logs, tiers_rig
from tests.oracle.axes import Axis, moved, stamps
from tests.oracle.questions import Question
from tests.oracle.rig_sensors import observe

TIERS = {t.name: t for t in (*tiers_axes.tiers(), *tiers_rig.tiers(), *tiers_logs.tiers())}


def test_no_tier_is_made_with_the_package_that_it_judges():
    for path in Path(axes.__file__).parent.glob("*.py"):
        tree = ast.parse(path.read_text("utf-8"))
        names = [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
        names += [str(n.module) for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
        assert not [n for n in names if n.startswith("dsd_cli")], path.name


@pytest.mark.parametrize(
    "name", ["geared joint", "crawl through cogging", "one direction", "small travel", "sensors read unevenly"]
)
def test_a_seed_gives_the_same_log_again_and_another_seed_another(name):
    first, again, other = (TIERS[name].draw(seed) for seed in (7, 7, 8))
    for channel in first.channels:
        assert np.array_equal(first.channels[channel], again.channels[channel])
    assert not np.array_equal(first.channels["u"][:1000], other.channels["u"][:1000])


def left_of_u(question: Question, *columns: np.ndarray) -> float:
    """Share of u that a regression on these leaves below 10 Hz, of the rows in which columns[1] is no creeping."""
    step = float(np.mean(np.diff(question.channels["t"])))
    low = signal.butter(3, 10.0, fs=1.0 / step, output="sos")
    rows = [signal.sosfiltfilt(low, x)[200:-200] for x in (question.channels["u"], *columns)]
    moving = np.abs(rows[2]) > 0.2 * np.sqrt(np.mean(rows[2] ** 2))
    u, table = rows[0][moving], np.stack(rows[1:], axis=1)[moving]
    return float(np.linalg.norm(u - table @ np.linalg.lstsq(table, u, rcond=None)[0]) / np.linalg.norm(u))


def test_a_geared_joint_is_nearly_all_friction_and_a_plain_regression_says_so():
    question = TIERS["geared joint"].draw(1)  # beside them a constant load
    q, step = question.channels["position"], float(np.mean(np.diff(question.channels["t"])))
    v = np.gradient(signal.sosfiltfilt(signal.butter(3, 20.0, fs=1.0 / step, output="sos"), q), step)
    a = np.gradient(v, step)
    assert left_of_u(question, a, a) > 0.9
    assert left_of_u(question, a, v, np.sign(v), np.ones_like(v)) < 0.12
    assert question.truth["effects"].keys() == set(question.hidden)


def test_a_crawl_is_explained_by_its_cogging_and_not_by_inertia():
    question = TIERS["crawl through cogging"].draw(3)
    q, step = question.channels["position"], float(np.mean(np.diff(question.channels["t"])))
    v = np.gradient(signal.sosfiltfilt(signal.butter(3, 20.0, fs=1.0 / step, output="sos"), q), step)
    n = question.truth["effects"]["cogging"]["periods"]
    assert left_of_u(question, *2 * [np.gradient(v, step)]) > 0.8
    assert left_of_u(question, np.sign(v), np.sin(n * q), np.cos(n * q)) < 0.25


def test_the_forces_of_an_axis_balance():
    """J a = u(t - L) + forces, from the exact motion's own differences."""
    rng = np.random.default_rng(4)
    t = stamps(0.001, 6.0)
    q = 0.8 * np.sin(2.0 * np.pi * 0.4 * t) * np.clip((t + 1.0) / 0.8, 0.0, 1.0) ** 3
    shares = {"inertia": 0.3, "viscous_friction": 0.7, "constant_load": 0.6}
    ran = moved(Axis(t=t, q=q, inertia=0.02, delay=0.003, shares=shares, bandwidth=30.0, speed_noise=0.0), rng)
    assert ran is not None
    log = t >= 0.0
    acceleration = np.gradient(ran.motion.v, t)[log]
    given = np.interp(t[log] - 0.003, t, ran.motion.u) + sum(f[log] for f in ran.forces.values())
    error = np.linalg.norm(0.02 * acceleration - given) / np.linalg.norm(ran.motion.u[log])
    assert error < 0.01
    for effect in ("viscous_friction", "constant_load"):
        assert ran.share(effect) == pytest.approx(shares[effect], rel=0.15)


@pytest.mark.parametrize(("how", "gbt"), [("euler", 0.0), ("bilinear", 0.5), ("backward_euler", 1.0), ("exact", None)])
def test_makers_step_the_filter_as_a_library_does(how, gbt):
    """scipy.signal.cont2discrete of 1 / (tau s + 1): gbt alpha 0 is forward Euler, whose output is one step late."""
    T, tau, n = 0.001, 0.01, 400
    rng = np.random.default_rng(1)
    u, v = rng.standard_normal(n), np.cumsum(rng.standard_normal(n))
    x = np.concatenate([[0.0], 0.3 * np.diff(v) / T - u[:-1]])
    kept = {} if gbt is None else {"alpha": gbt}
    b, a, _ = signal.cont2discrete(([1.0], [tau, 1.0]), T, "zoh" if gbt is None else "gbt", **kept)
    ahead = 1 if how in ("euler", "exact") else 0
    wanted = signal.lfilter(np.ravel(b), a, np.concatenate([x[ahead:], np.zeros(ahead)]))
    made = d_hat_makers.made(T * np.arange(n), u, v, 0.3, tau, how, "previous")
    assert made[1 : n - 1] == pytest.approx(wanted[1 : n - 1], abs=1e-9 * np.abs(made).max())


def test_pairings_differ_by_what_u_does_in_a_sample():
    """Q is linear: newest less previous is Q of the differences of u, the mean lies half way."""
    t, rng = 0.002 * np.arange(300), np.random.default_rng(2)
    u, v = rng.standard_normal(300), np.cumsum(rng.standard_normal(300))
    made = {p: d_hat_makers.made(t, u, v, 1.3, 0.02, "exact", p) for p in d_hat_makers.PAIRINGS}
    assert made["previous"] == pytest.approx(observe(t, u, v, 1.3, 0.02), abs=1e-9)
    p = np.exp(-0.1)
    swapped = signal.lfilter([1.0 - p], [1.0, -p], np.diff(u, prepend=u[0]))
    assert made["previous"] - made["newest"] == pytest.approx(swapped, abs=1e-9)
    assert 2.0 * made["mean"] == pytest.approx(made["newest"] + made["previous"], abs=1e-9)


def test_one_machine_behind_every_maker():
    as_here, other = (TIERS[f"d_hat: {how}"].draw(3) for how in ("exact, previous u", "euler, newest u"))
    assert np.array_equal(as_here.channels["u"], other.channels["u"])
    assert as_here.observer == other.observer
    assert not np.allclose(as_here.channels["d_hat"], other.channels["d_hat"])
