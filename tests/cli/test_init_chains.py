"""`dsd init` on boards that log more than a motion: accelerations beside it, and the voltages that drive it."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from dsd_cli.files.recognise import recognise
from tests.cli.rig import done, dsd
from tests.files import strangers

AXIS = strangers.axis()


def test_without_a_header_the_place_is_that_whose_slope_has_a_slope(tmp_path: Path) -> None:
    """Time, speed, place, acceleration, u: the speed was taken as the place, and a good answer was of another axis."""
    a = np.gradient(AXIS["v"], AXIS["t"])
    rows = strangers.rows(AXIS, AXIS["t"], AXIS["v"], AXIS["q"], a, AXIS["u"], by=" ")
    done("init", strangers.text(tmp_path, "rig.dat", rows).name, cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.position, signals.velocity, signals.u) == ("3", "2", "5")


@pytest.mark.parametrize("name", ["vq_mV", "Vq [V]"])
def test_a_voltage_is_no_speed_of_an_angle(name: str, tmp_path: Path) -> None:
    """It is most of it back-EMF: a slope of the angle but for what drives it."""
    vq = 20.0 * (0.003 * AXIS["u"] + AXIS["v"])
    header = f"t_s,iq_mA,{name},theta_mrad"
    rows = strangers.rows(AXIS, AXIS["t"], 1e3 * AXIS["u"], vq, np.round(1e3 * AXIS["q"]))
    done("init", strangers.text(tmp_path, "foc.csv", [header, *rows]).name, cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.position, signals.u) == ("theta_mrad", "iq_mA")
    assert signals.velocity != name


def test_a_motion_that_only_its_cause_tells_is_doubted_with_the_option_that_settles_it(tmp_path: Path) -> None:
    rows = strangers.rows(AXIS, AXIS["t"], AXIS["u"], AXIS["q"])
    path = strangers.text(tmp_path, "rig.csv", ["t_s,torque,sensor data", *rows])
    said = done("init", path.name, cwd=tmp_path).stderr
    found = next(line for line in said.splitlines() if '"sensor data"' in line)
    other = "velocity" if found.strip().startswith("position") else "position"
    assert f"if it is the {other}: --{other} 'sensor data'" in found


@pytest.mark.parametrize(
    ("columns", "found"),
    [
        (("times", "positions", "velocities", "torques"), "time position velocity u"),
        (("timestamps", "joint_positions", "joint_velocities", "joint_torques"), "time position velocity u"),
        (("t", "target_angles", "angles", "efforts"), "time reference position u"),
        (("t", "commanded_position", "position", "torque"), "time reference position u"),
        (("temps", "status", "position_limits", "errors"), "time"),
    ],
)
def test_arrays_are_named_in_the_plural(columns: tuple[str, ...], found: str) -> None:
    """`positions`, `velocities`, `torques` of a script's .npz or JSON were words of nothing."""
    named = {one.column: role for role, one in recognise(columns).items()}
    assert " ".join(named[column] for column in columns if column in named) == found


def test_a_config_that_waits_for_the_time_between_rows_says_so(tmp_path: Path) -> None:
    """Behind the question of `init` stood "must be a number of at least 1e-09"."""
    rows = strangers.rows(AXIS, AXIS["u"], AXIS["q"], AXIS["v"])
    path = strangers.text(tmp_path, "run.csv", ["torque,position,velocity", *rows])
    assert "how many s are its rows apart" in dsd("init", path.name, cwd=tmp_path).stderr
    said = dsd("check", path.name, cwd=tmp_path).stderr
    assert "the time between rows is not given: say it, for example --set signals.sample_time=" in said
