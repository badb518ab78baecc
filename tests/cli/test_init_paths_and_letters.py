"""`dsd init` on names that are paths with dots, and on letters that may be two things: no guess goes unsaid."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from dsd_cli.files.recognise import recognise
from dsd_cli.roles import Channel, guess_roles
from tests.cli.rig import done
from tests.files import strangers

AXIS = strangers.axis()


def proposed(folder: Path, names: str, *columns: np.ndarray) -> tuple[dict[str, str], str]:
    """(the columns that init writes, what it says)."""
    strangers.text(folder, "a.csv", [names, *strangers.rows(AXIS, *columns)])
    said = done("init", "a.csv", cwd=folder).stderr
    signals = load_config(folder / "dsd.toml").signals
    return {role: getattr(signals, role) for role in ("u", "position", "velocity")}, said


def test_a_dot_separates_as_a_slash_does() -> None:
    names = ["axis.pos_vel_mapper.pos_rel", "axis.vel_estimate", "axis.motor.iq_measured", "axis.loop.input_pos"]
    found = {role: one.column for role, one in recognise(names).items()}
    assert found == dict(zip(("position", "velocity", "u", "reference"), names, strict=True))


def test_an_end_that_says_nothing_is_no_name_by_itself() -> None:
    assert recognise(["t", "IqFb.a", "Pos.Set", "Pos.1"])["position"].column == "Pos.1"
    assert recognise(["t", "IqFb.a"])["u"].column == "IqFb.a"


def test_what_is_called_a_speed_and_has_another_one_as_its_slope_is_the_position() -> None:
    columns = {"t": AXIS["t"], "torque": AXIS["u"], "vel_map": AXIS["q"], "vel_est": AXIS["v"]}
    named = {role: one.column for role, one in recognise([*columns]).items()}
    assert named == {"time": "t", "u": "torque", "velocity": "vel_map"}
    channels = [Channel(*one) for one in columns.items()]
    found = guess_roles(channels, named, rivals={"velocity": ("vel_est",)}).found
    assert (found["position"].column, found["velocity"].column) == ("vel_map", "vel_est")
    assert guess_roles(channels, named).found["velocity"].column == "vel_map"  # nothing else is called a speed


@pytest.mark.parametrize("current", ["i", "current"])
def test_of_two_letters_the_one_that_what_moves_it_goes_with_is_the_speed(current: str, tmp_path: Path) -> None:
    volts = 3.0 * AXIS["u"] + 0.5 * AXIS["v"]  # resistance and back-EMF
    found, said = proposed(tmp_path, f"time,v,{current},w", AXIS["t"], volts, AXIS["u"], AXIS["v"])
    assert (found["u"], found["velocity"]) == (current, "w")
    assert "better than v does" in said


def test_the_current_of_a_motor_is_named_and_its_voltage_a_rival(tmp_path: Path) -> None:
    volts = 3.0 * AXIS["u"] + 0.5 * AXIS["v"]
    found, said = proposed(tmp_path, "time,volts,amps,w", AXIS["t"], volts, AXIS["u"], AXIS["v"])
    assert found["u"] == "amps"
    assert "it could be volts as well" in said


def test_what_is_another_channel_already_is_no_rival(tmp_path: Path) -> None:
    columns = (AXIS["t"], AXIS["q"], AXIS["v"], AXIS["r"], AXIS["u"])
    _, said = proposed(tmp_path, "t,current_position,current_velocity,target_position,motor_current", *columns)
    assert "as well" not in said


@pytest.mark.parametrize(("said", "time"), [("2.5,ms", ""), ("1,ms", "time")])
def test_a_count_of_rows_is_no_clock_where_the_file_says_how_far_they_are_apart(
    said: str, time: str, tmp_path: Path
) -> None:
    """A row that begins with `Name` is of labels, and what stands below that cell rises."""
    head = [f"Sampling time,{said}", "Name,Torque,Speed", "Unit,Nm,rad/s"]
    count = np.arange(AXIS["t"].size)
    strangers.text(tmp_path, "a.csv", [*head, *strangers.rows(AXIS, count, AXIS["u"], AXIS["v"])])
    done("init", "a.csv", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.time, signals.sample_time) == ((time, None) if time else (None, 0.0025))
    done("init", "a.csv", "--time", "time", "--force", cwd=tmp_path)
    assert load_config(tmp_path / "dsd.toml").signals.time == "time"
