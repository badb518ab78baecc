"""At rest under friction nothing is known, whatever level of friction the model has."""

import itertools

import numpy as np
import pytest

from dsd_cli.cli.plan import detection_plan
from dsd_cli.detect.rest import MOST_REST, Motion, RestShare
from dsd_cli.detect.session import Session
from dsd_cli.files.template import load_template
from dsd_cli.signals.cleaning import Cleaner

T = 0.001


def plain_motion(position: list[float], span: int) -> tuple[list[float], list[bool]]:
    """The rules in words: two steps over the span, never back, and not come to rest in its later half; at rest: neither
    two steps nor two changes."""
    out, rests, step = [], [], np.inf
    for k, here in enumerate(position):
        before = [position[max(k - i, 0)] for i in range(span, -1, -1)]
        changes = [b - a for a, b in itertools.pairwise(before)]
        if k and here != position[k - 1]:
            step = min(step, abs(here - position[k - 1]))
        moved, recent = here - before[0], changes[-((span + 1) // 2) :]
        monotone = all(c >= 0 for c in changes) or all(c <= 0 for c in changes)
        known = abs(moved) >= (2 - 1e-6) * step and monotone and any(recent)
        out.append(float(np.sign(moved)) if known else np.nan)
        rests.append(k >= span and sum(c != 0 for c in changes) < 2 and not abs(moved) >= (2 - 1e-6) * step)
    return out, rests


@pytest.mark.parametrize("span", [4, 5, 9])
@pytest.mark.parametrize("cut", [1, 50, 113])
def test_motion_is_that_of_the_rules_in_words_in_any_cut(span: int, cut: int) -> None:
    t = np.arange(200)
    position = np.round(4.0 * np.sin(0.05 * t) + 0.3 * np.random.default_rng(span).normal(size=200) * (t > 120))
    motion = Motion(span)
    parts = [motion.follow(position[:cut]), motion.follow(position[cut:])]
    for got, expected in zip(zip(*parts, strict=True), plain_motion(position.tolist(), span), strict=True):
        np.testing.assert_array_equal(np.concatenate(got), expected)


def stuck_log(jitter: float = 0.0) -> dict[str, np.ndarray]:
    """Moves that the model explains (J = 0.01), then a stiction that no model has: u rises, the axis rests.

    `jitter` : share by which the samples are farther apart or nearer.
    """
    n, half = 4000, 2000
    steps = T * (1.0 + jitter * np.random.default_rng(5).uniform(-1.0, 1.0, n))
    t = np.cumsum(steps) - steps[0]
    u = np.where(t < half * T, 0.4 * np.sign(np.sin(40.0 * t)), 0.12 * np.sin(15.0 * t))
    v = np.zeros(n)
    for k in range(1, half):
        # friction 0.1 opposes; it is overcome at every moment
        drive = u[k - 1] - 0.1 * (np.sign(v[k - 1]) or np.sign(u[k - 1]))
        v[k] = v[k - 1] + (t[k] - t[k - 1]) * drive / 0.01
    v[half:] = 0.0
    return {"t": t, "u": u, "velocity": v}


def labelled(log: dict[str, np.ndarray], method: str, level: float, block: int) -> tuple[np.ndarray, ...]:
    """Confident, inertia and the six columns of estimates of every row, fed in blocks."""
    config = load_template("servo").override(
        (
            f"model.effects={{coulomb_friction={{level={level}}}}}",
            "states.inertias=[0.005,0.01,0.1]",
            "states.delays=[0.0]",
            "detector.initial={delay=0.0, inertia=0.01}",
            f"detector.method={method}",
            'signals.d_hat=""',
            'signals.position=""',
        )
    )
    session = Session(detection_plan(config, {name: name for name in log}, {}, "log"), Cleaner(None))
    parts = []
    for begin in range(0, len(log["t"]), block):
        piece = {name: values[begin : begin + block] for name, values in log.items()}
        parts += session.feed(piece["t"], piece)
    parts += session.finish()
    inertia = session.plan.grid.axes["inertia"][np.concatenate([part.state for part in parts])]
    estimates = [np.concatenate(column) for column in zip(*(part.estimates for part in parts), strict=True)]
    return np.concatenate([part.confident for part in parts]), inertia, np.array(estimates)


@pytest.mark.parametrize("method", ["dsd", "profile"])
@pytest.mark.parametrize("level", [0.02, 0.05, 0.1, 0.2])
def test_a_stuck_axis_is_never_confidently_heavy_whatever_the_level(method: str, level: float) -> None:
    log = stuck_log()
    confident, inertia, _ = labelled(log, method, level, len(log["t"]))
    at_rest = log["t"] > 2.4  # a window after it has come to rest
    assert not confident[at_rest].any()
    if level == 0.1:
        assert confident[400:2000].mean() > 0.5
        assert set(inertia[400:2000][confident[400:2000]]) == {0.01}


@pytest.mark.parametrize("method", ["dsd", "profile"])
@pytest.mark.parametrize("level", [0.02, 0.1])
def test_on_irregular_stamps_no_label_that_rests_on_rest_is_confident(method: str, level: float) -> None:
    """The estimates stay those of the last sample whose flag is set, in blocks of any size."""
    log = stuck_log(jitter=0.4)
    confident, inertia, estimates = labelled(log, method, level, len(log["t"]))
    t = log["t"]
    assert not confident[t > 2.4].any()
    if level == 0.1:
        moving = (t > 0.6) & (t < 2.0)
        assert confident[moving].mean() > 0.5
        assert set(inertia[moving & confident]) == {0.01}
    cut = labelled(log, method, level, 97)
    np.testing.assert_array_equal(cut[0], confident)
    if method == "profile":
        np.testing.assert_array_equal(cut[2], estimates)
        for value, flag in zip(estimates[:4], estimates[[4, 4, 5, 5]], strict=True):
            moved = np.flatnonzero(~((value[1:] == value[:-1]) | (np.isnan(value[1:]) & np.isnan(value[:-1])))) + 1
            assert flag[moved].all()


@pytest.mark.parametrize("cut", [1, 30, 199])
def test_the_share_of_rest_is_that_of_the_window_in_any_cut(cut: int) -> None:
    window, resting = 60, np.random.default_rng(3).random(200) > 0.96
    share = RestShare(window)
    found = np.concatenate([share.unfounded(resting[:cut]), share.unfounded(resting[cut:])])
    expected = [sum(resting[max(k - window + 1, 0) : k + 1]) > MOST_REST * window for k in range(200)]
    assert found.tolist() == expected
    assert 20 < sum(expected) < 180, sum(expected)
    share.restart()
    assert not share.unfounded(np.zeros(5, dtype=bool)).any()
