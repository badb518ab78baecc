"""At rest under friction nothing is known, whatever level of friction the model has."""

import itertools

import numpy as np
import pytest

from dsd_cli.cli.plan import detection_plan
from dsd_cli.detect.rest import Motion
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


def stuck_log() -> dict[str, np.ndarray]:
    """Moves that the model explains (J = 0.01), then a stiction that no model has: u rises, the axis rests."""
    n, half = 4000, 2000
    t = T * np.arange(n)
    u = np.where(t < half * T, 0.4 * np.sign(np.sin(40.0 * t)), 0.12 * np.sin(15.0 * t))
    v = np.zeros(n)
    for k in range(1, half):
        # friction 0.1 opposes; it is overcome at every moment
        drive = u[k - 1] - 0.1 * (np.sign(v[k - 1]) or np.sign(u[k - 1]))
        v[k] = v[k - 1] + T * drive / 0.01
    v[half:] = 0.0
    return {"t": t, "u": u, "velocity": v}


@pytest.mark.parametrize("method", ["dsd", "profile"])
@pytest.mark.parametrize("level", [0.02, 0.05, 0.1, 0.2])
def test_a_stuck_axis_is_never_confidently_heavy_whatever_the_level(method: str, level: float) -> None:
    log = stuck_log()
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
    parts = [*session.feed(log["t"], log), *session.finish()]
    confident = np.concatenate([part.confident for part in parts])
    inertia = session.plan.grid.axes["inertia"][np.concatenate([part.state for part in parts])]
    at_rest = log["t"] > 2.4  # a window after it has come to rest
    assert not confident[at_rest].any()
    if level == 0.1:
        assert confident[400:2000].mean() > 0.5
        assert set(inertia[400:2000][confident[400:2000]]) == {0.01}
