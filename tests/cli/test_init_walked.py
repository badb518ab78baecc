"""`dsd init` on layouts met in logs that students, makers and labs published: columns and numbers are made up."""

import json
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.cli.init_log import Asked, Proposed, propose
from dsd_cli.cli.init_roles import Chosen, choose
from dsd_cli.files.recognise import recognise
from dsd_cli.files.sample import sample
from tests.files import strangers

AXIS = strangers.axis()
SHORT = {name: x[:600:2] for name, x in AXIS.items()}


def chosen(path: Path, **given: str) -> Chosen:
    return choose(path.name, sample(str(path), told=given.values()), given)


def roles(one: Chosen) -> dict[str, str]:
    return {role: found.column for role, found in one.found.items()}


def proposed(path: Path, **values: object) -> Proposed:
    return propose(str(path), Asked({}, {("signals", key): value for key, value in values.items()}))


def table(folder: Path, names: str, *columns: np.ndarray, by: str = ",") -> Path:
    lines = [names] * bool(names) + strangers.rows(AXIS, *columns, by=by)
    return strangers.text(folder, "log.csv", lines)


def test_what_an_instrument_was_set_to_stands_to_the_left_of_the_first_rows(tmp_path: Path) -> None:
    """The third line was taken as the header, and the rows above it were lost."""
    said = ["Record Length,3000,", "Sample Interval,2e-3,", ",,", "Vertical Units,A,", "Vertical Scale,20.0,"]
    said += [",,"] * (AXIS["t"].size - len(said))
    rows = zip(said, AXIS["t"] - 1.0, AXIS["u"], strict=True)
    path = strangers.text(tmp_path, "scope.csv", [f"{a},{t:09.4f},  {u:.5f}," for a, t, u in rows])
    (whole,) = sample(str(path)).tables
    values = {one.name: one.values for one in whole.channels}
    assert values["4"] == pytest.approx(AXIS["t"] - 1.0)
    assert values["5"] == pytest.approx(AXIS["u"], abs=1e-5)
    assert proposed(path).question == 'only "5" changes as a control input or a motion does: dsd needs one of each'


def test_a_log_in_which_nothing_moves_is_told_so(tmp_path: Path) -> None:
    jitter = SHORT["t"] + 1e-4 * np.random.default_rng(3).random(SHORT["t"].size)
    rest = 0.0 * jitter
    path = table(tmp_path, "host_time_s,frame,iq_mA,theta_mrad", jitter, np.arange(jitter.size), rest, rest)
    answer = proposed(path)
    assert answer.question == "no column changes as a control input or a motion does: dsd needs one of each"
    assert answer.command == ""


def test_what_is_current_beside_what_was_asked_for_is_no_current(tmp_path: Path) -> None:
    """Whatever was asked for stood still, and the place of the robot was its control input."""
    goal = np.full(SHORT["t"].size, 100.0)
    names = "time,target_y,current_y,error,step_length"
    found = chosen(table(tmp_path, names, SHORT["t"], goal, SHORT["q"], goal - SHORT["q"], SHORT["u"]))
    assert "current_y" not in (roles(found).get("u"), *found.candidates)
    assert recognise(["t", "motor1_current", "motor1_target"])["u"].column == "motor1_current"
    assert recognise(["t", "target_torque", "current_torque"])["u"].column == "current_torque"


@pytest.mark.parametrize("names", ["time,target_x,position_x,current_x", "time,target_q,position,current_q"])
def test_beside_a_motion_that_has_its_name_a_current_is_one(names: str, tmp_path: Path) -> None:
    """The current of the motor was taken for the position, and nothing was left that could be u."""
    found = roles(chosen(table(tmp_path, names, SHORT["t"], SHORT["r"], SHORT["q"], SHORT["u"])))
    assert [found["position"], found["u"]] == names.split(",")[2:]


def test_what_a_converter_counts_is_asked_for_and_no_encoder(tmp_path: Path) -> None:
    walk = np.cumsum(np.random.default_rng(4).standard_normal(SHORT["t"].size))
    found = chosen(table(tmp_path, "time [s],u [Nm],ADC [counts]", SHORT["t"], SHORT["u"], np.round(100.0 * walk)))
    assert (found.missing, found.candidates) == ("position", ("ADC [counts]",))


@pytest.mark.parametrize(("name", "role"), [("enconder(steps)", "position"), ("vfilt_cps", "velocity")])
def test_a_unit_of_an_encoder_says_what_a_name_does_not(name: str, role: str, tmp_path: Path) -> None:
    counts = np.round(1000.0 * np.random.default_rng(5).standard_normal(SHORT["t"].size))
    found = chosen(table(tmp_path, f"time(ms),{name},duty", 1e3 * SHORT["t"], counts, SHORT["u"]))
    assert roles(found) == {"time": "time(ms)", "u": "duty", role: name}


def test_a_target_beside_a_speed_alone_is_no_place_that_was_asked_for(tmp_path: Path) -> None:
    found = chosen(table(tmp_path, "t,iq,rpm,target", SHORT["t"], SHORT["u"], SHORT["v"], np.sign(SHORT["u"])))
    assert roles(found) == {"time": "t", "u": "iq", "velocity": "rpm"}


def test_electrical_turns_are_none_of_the_shaft_until_the_pole_pairs_are_said(tmp_path: Path) -> None:
    path = table(tmp_path, "t,iq,erpm", SHORT["t"], SHORT["u"], SHORT["v"])
    assert any("erpm" in line and "pole pairs" in line for line in proposed(path).said)
    answer = proposed(path, velocity_scale=0.015)
    assert "velocity_scale = 0.015" in answer.text
    assert not any("pole pairs" in line for line in answer.said)


def test_columns_without_names_are_no_joints(tmp_path: Path) -> None:
    """Its stamps, which begin anew with each run, were those of another joint than the columns that were named."""
    t = np.concatenate([SHORT["t"][:150], SHORT["t"][:150]]) + 1e-4 * np.random.default_rng(2).random(300)
    path = table(tmp_path, "", SHORT["u"], t, SHORT["v"], SHORT["q"], by=", ")
    assert roles(chosen(path, u="1", position="4")) | {"velocity": "3"} == {
        "time": "2",
        "u": "1",
        "position": "4",
        "velocity": "3",
    }


def test_a_row_that_names_the_columns_is_not_said_to_be_left_out(tmp_path: Path) -> None:
    named = "Parameter [0x2201/31],,Parameter [0x2201/93],,Bus [0x4C01/2],\nX,Y,X,Y,X,Y"
    at = np.arange(300.0)
    looked = sample(str(table(tmp_path, named, at, SHORT["u"], at, SHORT["q"], at, SHORT["v"])))
    assert "Bus [0x4C01/2]/Y" in [one.name for one in looked.tables[0].channels]
    assert not any("left out" in note for note in looked.notes)


def test_a_motion_that_is_missing_is_no_force_and_nothing_that_was_asked_for(tmp_path: Path) -> None:
    """A command and a current were offered as the motion of wheels that stood still."""
    rest = 0.0 * SHORT["t"]
    path = table(tmp_path, "time,cmdL,iqL_A,torque [Nm],rpmL", SHORT["t"], SHORT["v"], SHORT["u"], SHORT["r"], rest)
    assert proposed(path).question == 'this log has no motion that changes: "rpmL" is 0 in all rows; dsd needs one'


def test_a_speed_that_was_asked_for_is_no_control_input(tmp_path: Path) -> None:
    path = table(tmp_path, "time_s,commanded_deg_s,angle_deg", SHORT["t"], np.round(SHORT["u"]), SHORT["q"])
    found = chosen(path)
    assert "commanded_deg_s" not in (roles(found).get("u"), *found.candidates)


@pytest.mark.parametrize("without", [np.abs, lambda x: x * np.sign(SHORT["v"])], ids=["a size", "by power"])
def test_beside_a_current_without_the_direction_one_that_has_it_is_u_and_no_voltage(without, tmp_path: Path) -> None:
    """A scooter's drive: the voltage, which has the speed in it, was taken, and its friction with that."""
    names, volts = "ms;current_motor;d_axis_current;q_axis_current;erpm;q_axis_voltage", 0.3 * SHORT["u"] + SHORT["v"]
    still = 0.01 + 0.0 * SHORT["t"]
    columns = (1e3 * SHORT["t"], without(SHORT["u"]), still, SHORT["u"], 70.0 * SHORT["v"], volts)
    found = chosen(table(tmp_path, names, *columns, by=";"))
    assert roles(found) == {"time": "ms", "u": "q_axis_current", "velocity": "erpm"}


def test_a_speed_that_only_its_unit_names_is_the_motion(tmp_path: Path) -> None:
    """A drive's loops by their letters, without the position: `--u NAME --position NAME` was asked for."""
    names = "Time (ms);IL.CMD (Arms);IL.FB (Arms);VL.CMD (rpm);VL.FB (rpm)"
    noise = 0.02 * np.random.default_rng(7).standard_normal(SHORT["u"].size)
    currents = (SHORT["u"], SHORT["u"] + noise)
    found = chosen(table(tmp_path, names, 1e3 * SHORT["t"], *currents, np.roll(SHORT["v"], -4), SHORT["v"], by=";"))
    assert (roles(found).get("velocity"), roles(found).get("u") in names.split(";")[1:3]) == ("VL.FB (rpm)", True)


def test_matrices_beside_their_time_are_one_log(tmp_path: Path) -> None:
    """A simulator's rollout was "4 tests one after the other", four times as long."""
    columns = {name: [[x, 0.3] for x in SHORT[k].tolist()] for name, k in (("qpos", "q"), ("qvel", "v"), ("ctrl", "u"))}
    path = tmp_path / "rollout.json"
    path.write_text(json.dumps({"time": SHORT["t"].tolist(), **columns}))
    looked = sample(str(path))
    assert looked.notes == ()
    assert {one.name for table in looked.tables for one in table.channels}.isdisjoint({"1", "2"})
    found = roles(choose(path.name, looked, {}))
    assert found == {"time": "time", "u": "ctrl/1", "velocity": "qvel/1", "position": "qpos/1"}


@pytest.mark.parametrize(("step", "doubt"), [(0.004, False), (0.0004, True)])
def test_the_step_that_a_document_says_is_that_of_its_rows_unless_the_motion_says_another(
    step: float, doubt: bool, tmp_path: Path
) -> None:
    """Rows are 4 ms apart; a simulator's own step may be a tenth of that."""
    lists = zip(*(SHORT[k].tolist() for k in "quv"), strict=True)
    rows = [{"step": k, "dof_pos": [q], "dof_torque": [u], "dof_vel": [v]} for k, (q, u, v) in enumerate(lists)]
    path = tmp_path / "run.json"
    path.write_text(json.dumps({"metadata": {"dt": step, "robot": "arm"}, "data": rows}))
    answer = proposed(path)
    assert f"sample_time = {step}" in answer.text
    (line,) = (line for line in answer.said if line.startswith("sample_time"))
    assert ("0.004" in line.partition("the file says so")[2]) is doubt


def test_a_step_that_units_speak_against_is_none_of_the_rows(tmp_path: Path) -> None:
    """Position and speed name their units: the motion says the step, whatever a document does."""
    names = (("torque_nm", "u"), ("position_rad", "q"), ("velocity_rad_s", "v"))
    path = tmp_path / "run.json"
    path.write_text(json.dumps({"dt": 0.0004, **{name: SHORT[k].tolist() for name, k in names}}))
    (line,) = (line for line in proposed(path).said if line.startswith("sample_time"))
    assert "0.004" in line.partition("=")[2][:7]
    assert "the file says 0.0004" in line


def test_the_step_of_a_controller_is_none_of_the_rows(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    columns = {name: SHORT[k].tolist() for name, k in (("u", "u"), ("velocity", "v"))}
    path.write_text(json.dumps({**columns, "controller": {"dt": 0.0005, "kp": [1.0, 2.0]}}))
    assert sample(str(path)).sample_time is None


def test_what_the_user_calls_u_is_not_the_speed_as_well(tmp_path: Path) -> None:
    path = table(tmp_path, "time_s,input (rpm),y1", SHORT["t"], SHORT["u"], SHORT["v"])
    assert (
        "input (rpm)"
        not in {role: c for role, c in roles(chosen(path, u="input (rpm)")).items() if role != "u"}.values()
    )
