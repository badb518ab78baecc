"""`dsd init` and `dsd check` on what drives and laboratories export: roles, units, factors, and the inertia in SI."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from dsd_cli.files.config import load_config
from dsd_cli.files.recognise import is_force, is_motion, recognise, unit_in
from tests.cli.rig import done, dsd
from tests.files import drives
from tests.files.strangers import ROWS, STEP, axis, german, rows, text

AXIS = axis()


@pytest.mark.parametrize("name", drives.MADE)
def test_an_export_ends_in_a_config_with_the_inertia_of_the_axis(name: str, tmp_path: Path) -> None:
    """The axis has a mass of 2, whatever its units."""
    make, u, position, factor, unit = drives.MADE[name]
    path = make(tmp_path, AXIS)
    done("init", path.name, cwd=tmp_path)
    config = load_config(tmp_path / "dsd.toml")
    assert (config.signals.u, config.signals.position) == (u, position)
    assert config.signals.factors().get("position", 1.0) == pytest.approx(factor, rel=1e-3)
    assert config.observer is not None
    assert config.observer.nominal_inertia * unit == pytest.approx(2.0, rel=0.02)
    answer = json.loads(done("check", path.name, "--format", "json", cwd=tmp_path).stdout)
    assert [one["what"] for one in answer["findings"] if one["severity"] == "error"] == []
    assert ROWS - answer["by_log"][0]["samples"] in (0, 1)  # the last stamps of two clocks differ
    assert answer["by_log"][0]["seconds"] == pytest.approx(ROWS * STEP, rel=0.01)


def test_a_speed_per_second_is_no_time_and_a_word_in_brackets_no_unit() -> None:
    found = recognise(["Timestamp", "VelocityRadPerSec", "r80 (Torque)", "r62 (Drehzahlsollwert)", "r482 (Position)"])
    assert (found["time"].column, found["time"].others) == ("Timestamp", ())
    assert (found["u"].column, found["velocity"].column) == ("r80 (Torque)", "VelocityRadPerSec")
    assert (found["position"].column, found["position"].unit, found["velocity"].others) == ("r482 (Position)", "", ())


def test_a_name_of_an_object_is_no_unit() -> None:
    """Nor is an address of a controller, or the number of a servo ahead of what it does."""
    assert unit_in("Motor[1].IqCmd.a", "u") == ""
    assert unit_in("[ID:001] Present Position", "position") == ""
    assert unit_in("Velocity actual value [0x606C]", "velocity") == ""
    assert unit_in("Position Feedback [X] (mm)", "position") == "mm"
    assert recognise(["Current Feedback [X] (Amperes)"])["u"].named == "A"


def test_a_unit_in_brackets_says_what_a_column_is() -> None:
    assert is_motion("VL.FB (rpm)", "")
    assert is_force("IL.FB (Arms)", "")
    assert not is_force("VL.FB (rpm)", "")
    assert not is_motion("[rpm] Torque", "")


def test_a_motor_that_turns_and_its_slide_that_moves_have_a_screw_between_them(tmp_path: Path) -> None:
    """5 mm to a radian: the speed is the motor's, and the place of the slide is read as the motor's, too."""
    columns = (AXIS, AXIS["t"], 100.0 * AXIS["u"], 5.0 * AXIS["q"], 30.0 / np.pi * AXIS["v"])
    text(tmp_path, "cnc.csv", ["Time(s),TCMD1(% In),POSF1(mm),SPEED1(1/min)", *rows(*columns)])
    said = done("init", "cnc.csv", cwd=tmp_path).stderr
    assert said.count("position_scale = ") == 1
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u, signals.u_unit) == ("TCMD1(% In)", "%")
    assert signals.factors()["position"] == pytest.approx(0.2, rel=1e-3)
    answer = json.loads(done("check", "cnc.csv", "--format", "json", cwd=tmp_path).stdout)
    assert [one["what"] for one in answer["findings"] if one["severity"] == "error"] == []


@pytest.mark.parametrize(("later", "packets"), [(0.0, 6), (0.0005, 1)])
def test_the_x_left_of_a_channel_of_labview_is_its_time(later: float, packets: int, tmp_path: Path) -> None:
    """An X for each channel, that of the second `later`, in s, and its header again above each packet."""
    head = ["LabVIEW Measurement\t", "Separator\tTab", "Decimal_Separator\t,", "X_Columns\tMulti"]
    packet = ["***End_of_Header***\t", "Channels\t2\t\t\t", "Y_Unit_Label\tNm\t\tdeg\t", "X_Dimension\tTime\t\tTime\t"]
    packet += ["***End_of_Header***\t\t\t\t", "X_Value\tTorque\tX_Value\tAngle\tComment"]
    columns = zip(AXIS["t"], AXIS["u"], AXIS["t"] + later, np.degrees(AXIS["q"]), strict=True)
    body = ["\t".join(map(german, row)) + "\t" for row in columns]
    each = ROWS // packets
    lines = [line for at in range(0, ROWS, each) for line in ["", *packet, *body[at : at + each]]]
    text(tmp_path, "log.lvm", head + lines, "\r\n")
    done("init", "log.lvm", cwd=tmp_path)
    observer = load_config(tmp_path / "dsd.toml").observer
    assert observer is not None
    assert observer.nominal_inertia == pytest.approx(2.0, rel=0.02)


def test_a_column_whose_name_others_have_is_taken_by_its_number(tmp_path: Path) -> None:
    columns = (AXIS["t"], 0.3 * AXIS["t"], AXIS["t"] + 7.0, AXIS["u"], AXIS["q"])
    text(tmp_path, "log.csv", ["n,x,x,torque,angle", *rows(AXIS, *columns)])
    for number in ("2", "3"):
        said = ("--set", f"signals.time={number}", "--set", "signals.time_unit=s", "--position", "5")
        done("init", "log.csv", "--force", *said, cwd=tmp_path)
        signals = load_config(tmp_path / "dsd.toml").signals
        assert (signals.time, signals.position) == (number, "angle")


def test_a_control_input_of_another_time_base_is_asked_for_and_joined(tmp_path: Path) -> None:
    """Structs that Simulink logged at two rates, whose names say nothing of a force."""
    cmd, pos = ({"Time": AXIS["t"][::each], "Data": AXIS[key][::each]} for key, each in (("u", 1), ("q", 2)))
    savemat(tmp_path / "log.mat", {"log": {"pos": pos, "cmd": cmd}})
    asked = dsd("init", "log.mat", cwd=tmp_path)
    assert (asked.returncode, "log/cmd/Data (of another time base: both are joined)" in asked.stderr) == (1, True)
    assert "--force --u NAME" in asked.stderr
    said = done("init", "log.mat", "--force", "--u", "log/cmd/Data", cwd=tmp_path).stderr
    assert "joined to the stamps of log/pos/Time" in done("check", "log.mat", cwd=tmp_path).stderr
    observer = load_config(tmp_path / "dsd.toml").observer
    assert observer is not None, said
    assert observer.nominal_inertia == pytest.approx(2.0, rel=0.02)
