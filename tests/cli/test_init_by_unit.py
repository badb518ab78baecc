"""`dsd init` on columns whose names are no known word: the unit at their end says what they are."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from tests.cli.rig import done, dsd
from tests.files import strangers

AXIS = strangers.axis()


def write(folder: Path, names: str, *columns: object) -> None:
    strangers.text(folder, "a.csv", [names, *strangers.rows(AXIS, *columns)])


def spring() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(t, u, place) of a stiff spring with much friction and little mass: u is as well that of a speed by itself."""
    t = np.arange(4000) * 0.002
    q = 0.8 * np.sin(1.3 * t) + 0.3 * np.sin(3.1 * t)
    v = 0.8 * 1.3 * np.cos(1.3 * t) + 0.3 * 3.1 * np.cos(3.1 * t)
    return t, 2.0 * q + 0.3 * v, q


@pytest.mark.parametrize(
    ("name", "unit"), [("pan_rad", "rad"), ("carriage_mm", "mm"), ("wrist (deg)", "deg"), ("pan", "unknown")]
)
def test_a_place_is_no_speed_whatever_the_forces_would_allow(name: str, unit: str, tmp_path: Path) -> None:
    write(tmp_path, f"t,torque,{name}", *spring())
    done("init", "a.csv", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.position, signals.position_unit) == (name, unit)


@pytest.mark.parametrize(
    ("name", "unit"), [("gyro_deg_s", "deg/s"), ("plunger_mm_s", "mm/s"), ("gyro_rad_per_s", "rad/s")]
)
def test_a_speed_by_its_unit(name: str, unit: str, tmp_path: Path) -> None:
    noise = np.random.default_rng(5).normal(0.0, 1.0, AXIS["t"].size)  # nothing that it does says what it is
    write(tmp_path, f"t,torque,{name}", AXIS["t"], AXIS["u"], noise)
    done("init", "a.csv", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.velocity, signals.velocity_unit) == (name, unit)


@pytest.mark.parametrize("name", ["volt", "drive_amps"])
def test_one_column_left_in_volts_or_amperes_is_u(name: str, tmp_path: Path) -> None:
    noise = np.random.default_rng(6).normal(0.0, 1.0, AXIS["t"].size)
    write(tmp_path, f"t,{name},omega", AXIS["t"], noise, AXIS["v"])
    said = done("init", "a.csv", cwd=tmp_path).stderr
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u, signals.u_unit) == (name, {"volt": "V", "drive_amps": "A"}[name])
    assert f'u = "{name}": by its ' in said


def test_the_command_that_answers_names_the_option_of_the_unit(tmp_path: Path) -> None:
    noise = np.random.default_rng(7).normal(0.0, 1.0, (2, AXIS["t"].size))
    write(tmp_path, "t,torque,gyro_x_deg_s,gyro_y_deg_s", AXIS["t"], AXIS["u"], *noise)
    result = dsd("init", "a.csv", cwd=tmp_path)
    last = result.stderr.splitlines()[-1]
    assert result.returncode == 1
    assert "--velocity NAME" in last.partition("say it:")[2]
    assert "--position NAME, if it is a place" in last


def test_the_current_of_a_motor_is_no_place_in_metres(tmp_path: Path) -> None:
    write(tmp_path, "t,i_m,theta_dot", AXIS["t"], AXIS["u"], AXIS["v"])
    done("init", "a.csv", cwd=tmp_path)
    assert load_config(tmp_path / "dsd.toml").signals.u == "i_m"
