"""`dsd init` writes the clock and the channels that the commands will take, and the inertia that check will find."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from dsd_cli.signals.clock import settle_clock
from tests.cli.rig import done
from tests.files import strangers

STEP = 2e-3


def swung(rows: int = 6000, noise: float = 0.003) -> dict[str, np.ndarray]:
    """An inertia of 0.01 with dry friction 0.02, swung along a path; `noise` of u."""
    t = np.arange(rows) * STEP
    v = 8.0 * np.cos(8.0 * t) * np.clip(3.0 * np.sin(0.7 * t), -1.0, 1.0)
    u = 0.01 * np.gradient(v, STEP) + 0.02 * np.tanh(v / 0.01)
    rng = np.random.default_rng(31)
    return {"t": t, "u": u + noise * rng.standard_normal(rows), "q": STEP * (np.cumsum(v) - 0.5 * v), "v": v}


def written(folder: Path, a: dict[str, np.ndarray], *more: str) -> tuple[object, str]:
    lines = strangers.rows(a, *(a[name] for name in ("t", "u", "q", "v")), form="{:.9g}")
    strangers.text(folder, "a.csv", ["t,torque_Nm,pos_rad,vel_rads", *lines])
    said = done("init", "a.csv", "--force", *more, cwd=folder).stderr
    return load_config(folder / "dsd.toml").signals, said


def findings(folder: Path) -> list[str]:
    answer = json.loads(done("check", "a.csv", "--format", "json", cwd=folder).stdout)
    return [one["what"] for one in answer["findings"] if one["severity"] == "warning"]


def test_stamps_that_are_noise_on_an_even_clock_are_not_written(tmp_path: Path) -> None:
    a = swung()
    a["t"] = a["t"] + 0.08 * STEP * np.random.default_rng(32).standard_normal(a["t"].size)
    signals, said = written(tmp_path, a)
    assert (signals.time, signals.sample_time) == (None, STEP)
    assert said.count("  time = ") == 1
    assert not any("stamps are irregular" in one for one in findings(tmp_path))
    assert written(tmp_path, a, "--time", "t")[0].time == "t"


def test_a_velocity_that_is_late_is_not_written(tmp_path: Path) -> None:
    a = swung()
    a["v"] = np.concatenate([np.full(7, a["v"][0]), a["v"][:-7]])
    signals, said = written(tmp_path, a)
    assert (signals.position, signals.velocity) == ("pos_rad", None)
    assert 'velocity = "": velocity is 14' in said
    assert "velocity_unit" not in said
    assert not any("later than the slope" in one for one in findings(tmp_path))
    assert written(tmp_path, a, "--velocity", "vel_rads")[0].velocity == "vel_rads"


def test_an_inertia_that_check_finds_is_found_by_init(tmp_path: Path) -> None:
    """More of u is noise than acceleration: the scan for an inertia is not clear, a fit of a model is."""
    _, said = written(tmp_path, swung(noise=0.3))
    told = re.search(r"nominal_inertia = (\S+): identified", said)
    assert told
    assert float(told[1]) == pytest.approx(0.01, rel=0.1)
    answer = json.loads(done("check", "a.csv", "--format", "json", cwd=tmp_path).stdout)
    inertia = next(one for one in answer["parameters"] if one["name"] == "inertia")
    assert inertia["identified"] != "not"


def test_of_stamps_since_1970_the_sample_time_is_the_shortest_number_that_they_allow() -> None:
    """Of 1.7e9 s a float64 has steps of 2.4e-7 s: one of 1 ms is not to be had more exactly."""
    stamps = (1715681234123.0 + np.arange(16)) * 1e-3
    assert settle_clock(stamps).sample_time == 1e-3
    assert settle_clock(np.arange(16) * 0.000999991).sample_time == 0.000999991
