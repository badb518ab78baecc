"""A motion whose unit nothing says: asked for, and no verdict that depends on it is sure."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from dsd_cli.files.config import load_config
from tests.cli.rig import done

STEP, INERTIA, GRAVITY = 0.002, 0.002, 0.4


def swung(folder: Path) -> Path:
    """A weight on an arm, in degrees and degrees per second that no name says, by plain sums."""
    t = np.arange(6000) * STEP
    r = 0.9 * np.sin(1.9 * t) + 0.5 * np.sin(4.7 * t)
    q, v, u = np.zeros(t.size), np.zeros(t.size), np.zeros(t.size)
    for k in range(t.size - 1):
        u[k] = 2.0 * (r[k] - q[k]) - 0.05 * v[k]
        v[k + 1] = v[k] + STEP * (u[k] - GRAVITY * np.sin(q[k])) / INERTIA
        q[k + 1] = q[k] + STEP * 0.5 * (v[k] + v[k + 1])
    rows = np.column_stack([t, u, np.degrees(q), np.degrees(v)])
    np.savetxt(folder / "log.csv", rows, "%.7g", ",", header="t,torque,pos,vel", comments="")
    return folder / "log.csv"


def diagnosed(folder: Path) -> dict:
    return json.loads(done("diagnose", "log.csv", "--format", "json", cwd=folder).stdout)


def test_a_verdict_that_depends_on_the_unit_says_so_until_it_is_given(tmp_path: Path) -> None:
    swung(tmp_path)
    said = done("init", "log.csv", cwd=tmp_path).stderr
    assert 'the unit of "pos" is not said; it is taken as rad or m; if it is another: --set' in said
    assert load_config(tmp_path / "dsd.toml").signals.position_unit == "unknown"
    checked = json.loads(done("check", "log.csv", "--format", "json", cwd=tmp_path).stdout)
    assert any("signals.position_unit" in one["remedy"] for one in checked["findings"])
    found = diagnosed(tmp_path)
    assert found["verdict"] != "gravity"
    assert f"{found['verdict']} may be missing" in found["verdict_text"]
    assert "so called with the position in rad or m, which nothing says" in found["verdict_text"]
    done("init", "log.csv", "--force", "--set", "signals.position_unit=deg", cwd=tmp_path)
    config = load_config(tmp_path / "dsd.toml")
    assert (config.signals.velocity_unit, config.signals.units.assumed) == ("deg/s", False)
    found = diagnosed(tmp_path)
    assert found["verdict"] == "gravity"
    assert "which nothing says" not in found["verdict_text"]
    (gravity,) = [one for one in found["ranking"] if one["effect"] == "gravity"]
    assert abs(gravity["parameters"]["amplitude"]["value"] / GRAVITY - 1.0) < 0.01


def test_a_log_of_our_own_is_in_si(tmp_path: Path) -> None:
    done("simulate", "--template", "servo", "--duration", "2", "-o", "log.csv", cwd=tmp_path)
    said = done("init", "log.csv", cwd=tmp_path).stderr
    assert "is not said; it is taken" not in said
    assert not load_config(tmp_path / "dsd.toml").says("signals.position_unit")
