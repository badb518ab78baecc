"""A motion whose unit nothing says: asked for, and no verdict that depends on it is sure."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from tests.cli.rig import FEW, done

STEP, INERTIA, GRAVITY = 0.002, 0.002, 0.4


def swung(folder: Path, columns: str = "t,torque,pos,vel", per_slope: float = 1.0) -> Path:
    """A weight on an arm, in degrees and degrees per second (times `per_slope`) that no name says, by plain sums."""
    t = np.arange(6000) * STEP
    r = 0.9 * np.sin(1.9 * t) + 0.5 * np.sin(4.7 * t)
    q, v, u = np.zeros(t.size), np.zeros(t.size), np.zeros(t.size)
    for k in range(t.size - 1):
        u[k] = 2.0 * (r[k] - q[k]) - 0.05 * v[k]
        v[k + 1] = v[k] + STEP * (u[k] - GRAVITY * np.sin(q[k])) / INERTIA
        q[k + 1] = q[k] + STEP * 0.5 * (v[k] + v[k + 1])
    channels = {"t": t, "torque": u, "pos": np.degrees(q), "vel": per_slope * np.degrees(v)}
    rows = np.column_stack([channels[name] for name in columns.split(",")])
    np.savetxt(folder / "log.csv", rows, "%.7g", ",", header=columns, comments="")
    return folder / "log.csv"


def checked(folder: Path, *more: str) -> dict:
    return json.loads(done("check", "log.csv", "--format", "json", *more, cwd=folder).stdout)


def diagnosed(folder: Path) -> dict:
    rivals = (*FEW, "gravity", "stiffness", "cogging")
    return json.loads(done("diagnose", "log.csv", "--format", "json", cwd=folder, effects=rivals).stdout)


def test_a_verdict_that_depends_on_the_unit_says_so_until_it_is_given(tmp_path: Path) -> None:
    swung(tmp_path)
    said = done("init", "log.csv", cwd=tmp_path).stderr
    assert 'the unit of "pos" is not said; it is taken as rad or m; if it is another: --set' in said
    assert load_config(tmp_path / "dsd.toml").signals.position_unit == "unknown"
    assert any("signals.position_unit" in one["remedy"] for one in checked(tmp_path)["findings"])
    found = diagnosed(tmp_path)
    assert found["verdict"] != "gravity"
    assert f"{found['verdict']} is missing" in found["verdict_text"]
    assert "so called with the position in rad or m, which nothing says" in found["verdict_text"]
    done("init", "log.csv", "--force", "--set", "signals.position_unit=deg", cwd=tmp_path)
    config = load_config(tmp_path / "dsd.toml")
    assert (config.signals.velocity_unit, config.signals.units.assumed) == ("deg/s", False)
    found = diagnosed(tmp_path)
    assert found["verdict"] == "gravity"
    assert "which nothing says" not in found["verdict_text"]
    (gravity,) = [one for one in found["ranking"] if one["effect"] == "gravity"]
    assert abs(gravity["parameters"]["amplitude"]["value"] / GRAVITY - 1.0) < 0.01


@pytest.mark.parametrize("per_slope", [1.0, 3.7])
def test_the_unit_may_be_given_to_any_command_and_the_velocity_follows(per_slope: float, tmp_path: Path) -> None:
    swung(tmp_path, per_slope=per_slope)
    done("init", "log.csv", cwd=tmp_path)
    found = checked(tmp_path, "--set", "signals.position_unit=deg")["findings"]
    assert not [one for one in found if one["severity"] == "error" or "position_unit" in one["remedy"]]
    factors = load_config(tmp_path / "dsd.toml", ["signals.position_unit=deg"]).signals.factors()
    assert factors["velocity"] * per_slope == pytest.approx(factors["position"], rel=1e-3) == np.radians(1.0)


@pytest.mark.parametrize("answer", ["velocity_unit=deg/s", "position_unit=deg"])
def test_of_a_velocity_alone_its_own_unit_is_asked_for(answer: str, tmp_path: Path) -> None:
    swung(tmp_path, "t,torque,vel")
    done("init", "log.csv", cwd=tmp_path)
    assert any('signals.velocity_unit = "rad/s", "deg/s"' in one["remedy"] for one in checked(tmp_path)["findings"])
    config = load_config(tmp_path / "dsd.toml", [f"signals.{answer}"])
    assert config.signals.factors()["velocity"] == pytest.approx(np.radians(1.0))


def test_what_observe_writes_of_it_is_as_open(tmp_path: Path) -> None:
    swung(tmp_path)
    done("init", "log.csv", cwd=tmp_path)
    done("observe", "log.csv", "-o", "own.csv", cwd=tmp_path)
    found = json.loads(done("check", "own.csv", "--format", "json", cwd=tmp_path).stdout)["findings"]
    assert any("unit of the motion is unknown" in one["what"] for one in found)


def test_a_log_of_our_own_is_in_si(tmp_path: Path) -> None:
    done("simulate", "--template", "servo", "--duration", "2", "-o", "log.csv", cwd=tmp_path)
    said = done("init", "log.csv", cwd=tmp_path).stderr
    assert "is not said; it is taken" not in said
    assert not load_config(tmp_path / "dsd.toml").says("signals.position_unit")


def test_a_velocity_in_counts_of_its_own_follows_the_counts_that_are_given_of_the_position(tmp_path: Path) -> None:
    """A servo of 4096 counts per turn whose velocity is in 0.229 rpm per count, as its manual says."""
    rows = np.loadtxt(swung(tmp_path), delimiter=",", skiprows=1)
    rows[:, 2], rows[:, 3] = np.round(rows[:, 2] / 360.0 * 4096.0), np.round(rows[:, 3] / 6.0 / 0.229)
    np.savetxt(tmp_path / "log.csv", rows, "%.7g", ",", header="t,torque,pos,vel", comments="")
    said = done(
        "init",
        "log.csv",
        "--set",
        "signals.position_unit=counts",
        "--set",
        "signals.counts_per_turn=4096",
        cwd=tmp_path,
    )
    assert "leave out" not in said.stderr
    factors = load_config(tmp_path / "dsd.toml").signals.factors()
    assert factors["velocity"] == pytest.approx(0.229 * 2.0 * np.pi / 60.0, rel=0.01)
    found = checked(tmp_path)["findings"]
    assert not [one for one in found if "times the slope" in one["what"] or "_unit" in one["remedy"]]
