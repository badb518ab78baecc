"""Which part of a log `dsd tune` looks at: one in which u moves the axis, and it says which."""

import json
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.cli.progress import Progress
from dsd_cli.cli.tune import _evidence
from dsd_cli.detect.tune import evidence as module
from dsd_cli.detect.tune.baum_welch import fit
from dsd_cli.errors import DataError
from dsd_cli.files.config import load_config
from tests.cli.rig import done, dsd, refused

T, J = 0.001, 0.01
CONFIG = """
[signals]
time = "t"
time_unit = "s"
u = "u"
velocity = "v"
[observer]
nominal_inertia = 0.01
time_constant = 0.005
sign = 1
[model]
inertia = 0.01
delay = 0.0
rest_speed = 0.05
[states]
delays = [0.0, 0.004]
inertias = [0.0067, 0.01, 0.015]
[detector]
method = "dsd"
window = 100
rho = 0.4
"""


def moving(n: int, seed: int) -> np.ndarray:
    """t, u, v of J dv/dt = u, u held over each sample, and a sensor with noise; shape (n, 3)."""
    rng, t = np.random.default_rng(seed), np.arange(n) * T
    u = 0.5 * np.sin(60.0 * t) + 0.4 * np.sign(np.sin(23.0 * t))
    v = np.concatenate([[0.0], np.cumsum(u[:-1]) * T / J]) + 0.001 * rng.normal(size=n)
    return np.column_stack([t, u, v])


def at_rest(n: int, u: float = 0.0, seed: int | None = None) -> np.ndarray:
    """An axis that stands, with or without noise of its sensor (std 0.001), whatever u is; shape (n, 3)."""
    t = np.arange(n) * T
    noise = np.zeros(n) if seed is None else 0.001 * np.random.default_rng(seed).normal(size=n)
    return np.column_stack([t, u * np.sin(20.0 * t), noise])


def written(folder: Path, *recordings: np.ndarray) -> Path:
    """The recordings one after the other, each with a clock that begins at 0."""
    (folder / "c.toml").write_text(CONFIG)
    np.savetxt(folder / "log.csv", np.vstack(recordings), delimiter=",", header="t,u,v", comments="", fmt="%.8g")
    return folder


@pytest.mark.parametrize(
    "rest", [at_rest(600), at_rest(600, 0.1), at_rest(600, 0.1, 830511)], ids=["u = 0", "stiction", "noise"]
)
def test_a_longer_rest_is_not_what_a_log_is_tuned_on(tmp_path, rest):
    """ "rho 0.426 -> 1e-12, window 100 -> 1, labels 100 %" came of a rest of 600 samples beside moves of 400."""
    written(tmp_path, rest, moving(400, 830512), rest)
    found = json.loads(done("tune", "log.csv", "-c", "c.toml", "--format", "json", cwd=tmp_path).stdout)
    assert found["part"].startswith("recording 2 of 3 without a gap, t = 0 to 0.399 s")
    pole = np.exp(
        -T / 0.005
    )  # of white noise e, (1 - p) (e - e') / (1 - p z^-1) has the variance 2 (1 - p)^2 / (1 + p)
    assert found["noise"] == pytest.approx(J * 0.001 / T * (1.0 - pole) * np.sqrt(2.0 / (1.0 + pole)), rel=0.15)
    assert "tuned on 3" in (said := done("tune", "log.csv", "-c", "c.toml", cwd=tmp_path).stdout)
    assert "of recording 2 of 3 without a gap, t = 0 to 0.399 s: there u moves the axis most" in said


@pytest.mark.parametrize("rest", [at_rest(600), at_rest(600, 0.1, 830513)], ids=["u = 0", "noise below rest_speed"])
def test_a_log_at_rest_all_through_is_refused(tmp_path, rest):
    written(tmp_path, rest, rest)
    refused(dsd("tune", "log.csv", "-c", "c.toml", "-o", "new.toml", cwd=tmp_path), 1, "nowhere does u move the axis")
    assert not (tmp_path / "new.toml").exists()


def test_too_short_is_said_with_the_log_and_the_part_that_was_looked_at(tmp_path):
    """ "193 samples can be judged" of a log with thousands."""
    written(tmp_path, moving(150, 830514), moving(190, 830515), moving(160, 830516))
    got = dsd("tune", "log.csv", "-c", "c.toml", cwd=tmp_path)
    refused(got, 1, "log.csv: 1")
    refused(got, 1, "in the longest part, recording 2 of 3 without a gap, t = 0 to 0.189 s")


def test_a_long_recording_is_represented_by_where_it_moves(tmp_path, monkeypatch):
    """Its first 20,000 samples were taken, also where those are a rest."""
    monkeypatch.setattr(module, "MOST_SAMPLES", 500)
    log = np.vstack([at_rest(1000), moving(500, 830517)])
    log[:, 0] = np.arange(1500) * T
    folder = written(tmp_path, log)
    found, _ = _evidence(str(folder / "log.csv"), load_config(folder / "c.toml", (), ()), Progress(False))
    assert found.part == "t = 1 to 1.499 s"
    np.testing.assert_allclose(found.inputs.u, log[1000:, 1], atol=1e-7)


def test_candidates_that_predict_the_same_are_refused_and_a_rest_without_noise_does_not_hide_the_noise():
    """The median of the errors was 0, and 1e-12 of any unit stood in for it."""
    for error in (0.0, 0.3):
        with pytest.raises(DataError, match="predict the same"):
            fit(np.full((300, 2), error))
    errors = np.random.default_rng(830518).normal(0.0, 0.3, size=400)
    right = np.concatenate([np.zeros(600), errors])
    wrong = np.concatenate([np.zeros(600), errors + 3.0])
    squares = np.column_stack([right, wrong]) ** 2
    found = fit(squares)
    assert fit(1e-28 * squares).rho == pytest.approx(1e-14 * found.rho, rel=1e-6)  # u in a unit that is large
    assert found.rho == pytest.approx(np.sqrt(np.mean(right**2)), rel=0.02)
