"""Logs of several joints, legs or sides, and of several forces: u and its motion are of one axis, or it is asked."""

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from dsd_cli.files.first_look import time_unit_of
from dsd_cli.files.formats.long_form import form_by_texts
from dsd_cli.files.joints import apart, joints_of
from dsd_cli.files.recognise import is_neither, recognise
from tests.cli.rig import done, dsd
from tests.files import strangers

AXIS = strangers.axis()
SIZE = AXIS["t"].size


def written(folder: Path, columns: dict[str, np.ndarray], *options: str) -> tuple[str, str, dict[str, Any]]:
    """What `init` says of that log, its last line, and what [signals] has."""
    np.savetxt(
        folder / "log.csv", np.column_stack([*columns.values()]), "%.7g", ",", header=",".join(columns), comments=""
    )
    said = dsd("init", "log.csv", "--force", *options, cwd=folder).stderr
    return said, said.splitlines()[-1], tomllib.loads((folder / "dsd.toml").read_text(encoding="utf-8"))["signals"]


def robot(moving: int, torques: int = 4) -> dict[str, np.ndarray]:
    """Families of columns as a robot's controller writes them; one joint moves, the drive of another holds a weight."""
    rng = np.random.default_rng(7)
    of_joint = {
        "Position": lambda k: AXIS["q"] if k == moving else np.full(SIZE, -1e-5 * k),
        "Velocity": lambda k: AXIS["v"] if k == moving else 1e-6 * rng.standard_normal(SIZE),
        "Torque": lambda k: AXIS["u"] if k == moving else 5.0 * (k == 2) + 0.02 * rng.standard_normal(SIZE),
        "TorqueSm": lambda _: np.zeros(SIZE),
        "TorqueCur": lambda k: 3.0 * (k == 2) + 0.5 * (k == moving) * AXIS["u"] + 0.1 * rng.standard_normal(SIZE),
        "PositionCmptd": lambda k: AXIS["r"] if k == moving else np.zeros(SIZE),
    }
    table = {"Time": 1e3 * AXIS["t"]}
    for family, values in of_joint.items():
        many = torques if family.startswith("Torque") else 4
        table |= {f"{family}{k}": values(k) for k in range(1, many + 1)}
    return table


@pytest.mark.parametrize("moving", [3, 4])
def test_of_a_table_of_joints_all_columns_are_those_of_one(moving: int, tmp_path: Path) -> None:
    said, _, found = written(tmp_path, robot(moving))
    names = [found[role] for role in ("u", "position", "velocity")]
    assert names == [f"Torque{moving}", f"Position{moving}", f"Velocity{moving}"]
    assert f"joint {moving} of 4: it moves most" in said
    options = re.findall(r"for another one: (.*)", said)[0].split()
    done("init", "log.csv", *options, cwd=tmp_path)
    other = load_config(tmp_path / "dsd.toml").signals
    assert (other.u[-1], other.velocity[-1]) == (options[-1][-1], options[-1][-1])
    assert other.u[-1] != str(moving)


def test_a_joint_without_a_u_of_its_own_takes_that_of_no_other(tmp_path: Path) -> None:
    _, last, found = written(tmp_path, robot(4, torques=3))
    assert "which column is the control input" in last
    assert (found["position"], found["u"]) == ("Position4", "")


@pytest.mark.parametrize("named", ["u", "position", "velocity"])
def test_a_column_that_the_user_names_says_of_which_joint_the_others_are(named: str, tmp_path: Path) -> None:
    table = {"time": AXIS["t"]}
    for at in range(3):
        mine = {"position": AXIS["q"], "velocity": AXIS["v"], "effort": AXIS["u"]}
        table |= {f"field.{role}{at}": (3.0 - at) * x for role, x in mine.items()}
    expected = {"u": "field.effort1", "position": "field.position1", "velocity": "field.velocity1"}
    said, _, found = written(tmp_path, table, f"--{named}", expected[named])
    assert {role: found[role] for role in expected} == expected
    assert "joint 1 of 3: as you say; for another one: --force --u field.effort0" in said


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        (["LeftVolts", "RightVolts", "LeftSpeed", "RightSpeed"], ["Left", "Right"]),
        (["FL_torque", "FR_torque", "FL_pos", "FR_pos"], ["FL", "FR"]),
        (["Torque1", "Torque2", "TorqueSm1", "TorqueSm2", "Position1", "Position2", "PositionSm1"], ["1", "2"]),
        (["torque_1", "torque_3", "q_1", "q_2"], ["1", "3", "2"]),
        (["axisTorque_a1", "axisTorque_a2", "axisTorqueExt_a1", "axisQMsr_a1", "axisQMsr_a2"], ["1", "2"]),
    ],
)
def test_what_joints_are_called(columns: list[str], expected: list[str]) -> None:
    assert [*joints_of(columns, recognise(columns))] == expected


@pytest.mark.parametrize(
    ("u", "motion", "other"),
    [("m2", "enc4", "m4"), ("m4", "enc4", ""), ("left_m", "right_enc", "right_m"), ("m_act", "enc_des", "")],
)
def test_names_that_are_of_two_joints(u: str, motion: str, other: str) -> None:
    columns = ["m2", "m4", "enc2", "enc4"]
    columns += [f"{side}_{one}" for side in ("left", "right") for one in ("m", "enc")]
    columns += [f"{one}_{said}" for one in ("m", "enc") for said in ("act", "des")]
    assert apart(columns, u, motion) == other


def test_u_and_motion_that_only_their_doings_find_are_of_one_joint_or_it_asks(tmp_path: Path) -> None:
    """What the second drive does explains the first axis, as where wires are swapped: its owner has to say so."""
    rng = np.random.default_rng(5)
    table = {"t": AXIS["t"], "m1": rng.standard_normal(SIZE), "m2": AXIS["u"], "pos1": AXIS["q"]}
    table |= {"pos2": 0.01 * rng.standard_normal(SIZE)}
    _, last, found = written(tmp_path, table)
    assert "which column is the control input (torque, force, current, voltage)? m1, m2;" in last
    assert found["position"] == "pos1"
    _, _, found = written(tmp_path, table, "--u", "m2", "--position", "pos1")
    assert (found["u"], found["position"]) == ("m2", "pos1")


def noisy(loud: float, seed: int) -> np.ndarray:
    """u with noise of that many times its own size: its share of blocks of five rows is 1 / (1 + loud^2 / 5)."""
    return AXIS["u"] + loud * AXIS["u"].std() * np.random.default_rng(seed).standard_normal(SIZE)


@pytest.mark.parametrize(("amps", "volts", "u"), [(3.0, 0.1, "volts"), (0.1, 3.0, "amps"), (0.8, 0.1, "amps")])
def test_of_two_forces_with_good_names_what_the_motion_explains_decides(
    amps: float, volts: float, u: str, tmp_path: Path
) -> None:
    table = {"t": AXIS["t"], "pos": AXIS["q"], "vel": AXIS["v"]}
    names = {"amps": "stator_current_amps", "volts": "applied_volts"}
    said, _, found = written(tmp_path, {**table, names["amps"]: noisy(amps, 1), names["volts"]: noisy(volts, 2)})
    assert found["u"] == names[u], said


def test_without_a_clear_margin_it_asks(tmp_path: Path) -> None:
    """55 % of the one, 75 % of the other. A command beside what was measured makes no such doubt."""
    table = {"t": AXIS["t"], "pos": AXIS["q"], "vel": AXIS["v"], "current": noisy(2.0, 1)}
    said, last, _ = written(tmp_path, {**table, "applied_volts": noisy(1.3, 2)})
    assert "which column is the control input (torque, force, current, voltage)? applied_volts, current;" in last
    assert re.search(r"the motion explains 7\d % of applied_volts, 5\d % of current: none clearly best", said)
    assert written(tmp_path, {**table, "current_cmd": noisy(1.3, 2)})[2]["u"] == "current"


def test_a_voltage_that_is_the_speed_itself_is_no_u(tmp_path: Path) -> None:
    table = {"t": AXIS["t"], "pos": AXIS["q"], "vel": AXIS["v"], "current": noisy(3.0, 1), "tacho_volts": AXIS["v"] / 7}
    assert written(tmp_path, table)[2]["u"] == "current"


def legs(folder: Path, step: float) -> Path:
    """Rows of four legs at each stamp, and the phase of the walk that they are in; its currents are of whole mA."""
    lines = ["time,phase,leg,theta1_setpoint_deg,theta1_actual_deg,current_A_mA"]
    for k in range(80):
        for at, leg in enumerate(("FR", "FL", "RR", "RL")):
            size = 9.0 if leg == "RR" else 3.0
            q, r = (size * np.sin(0.4 * (k - lag) + at) for lag in (0.5, 0.0))
            lines.append(
                f"{step * (k + 1):.4f},{'MARCH' if k < 20 else 'WALK'},{leg},{r:.3f},{q:.3f},{900 + 37 * q:.0f}"
            )
    return strangers.text(folder, "walk.csv", lines)


def test_of_rows_of_legs_one_leg_is_taken_over_all_phases(tmp_path: Path) -> None:
    legs(tmp_path, 0.2045)
    said = done("init", "walk.csv", cwd=tmp_path).stderr
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u, signals.position) == ("RR/current_A_mA", "RR/theta1_actual_deg")
    assert "it has a row for each value, named by leg" in said
    assert "from the first 80 rows" in said
    assert "joint RR of 4: " in said
    done("init", "walk.csv", "--force", "--u", "FL/current_A_mA", cwd=tmp_path)
    assert load_config(tmp_path / "dsd.toml").signals.position == "FL/theta1_actual_deg"


def test_a_name_of_a_device_that_alternates_names_channels() -> None:
    """Two devices have stamps of their own: all rows of a stamp have the same device, and each stamp has a new one."""
    t = np.repeat(0.01 * np.arange(200), 2)
    texts = {"device": ["a", "a", "b", "b"] * 100, "signal": ["i", "n"] * 200}
    numbers = {"time": t, "value": np.sin(t)}
    assert form_by_texts(numbers, texts).names == ("device", "signal")
    texts["device"] = ["a"] * 200 + ["b"] * 200
    assert form_by_texts(numbers, texts).names == ("signal",)


def test_what_is_called_a_position_is_no_velocity_of_another(tmp_path: Path) -> None:
    table = {"t": AXIS["t"], "torque": AXIS["u"], "theta1": AXIS["q"], "theta2": AXIS["v"]}
    assert "velocity =" not in written(tmp_path, table)[0]


def test_rows_of_a_fifth_of_a_second_are_none_of_a_fifth_of_a_millisecond(tmp_path: Path) -> None:
    legs(tmp_path, 0.2045)
    said = done("init", "walk.csv", cwd=tmp_path).stderr
    assert "steps of 0.2045 are taken as s; if it is another: --set signals.time_unit=UNIT" in said
    said = done("init", "walk.csv", "--force", "--set", "signals.time_unit=s", cwd=tmp_path).stderr
    assert "time_unit" not in said
    assert load_config(tmp_path / "dsd.toml").signals.time_unit == "s"


@pytest.mark.parametrize(
    ("step", "rows", "unit"), [(0.25, 100, "s"), (0.25, 8000, "ms"), (1.0, 50, "ms"), (5.0, 50, "ms"), (0.01, 50, "s")]
)
def test_the_unit_of_stamps_of_which_nothing_is_said(step: float, rows: int, unit: str) -> None:
    assert time_unit_of(step, 0.0, step * rows) == unit


@pytest.mark.parametrize("name", ["accelAct", "AccX (g)", "acc_z", "qdd [rad/s^2]", "a1 [m/s²]"])
def test_no_acceleration_is_asked_for_as_u(name: str, tmp_path: Path) -> None:
    assert is_neither(name, "")
    rng = np.random.default_rng(3)
    table = {"t": AXIS["t"], "posAct": AXIS["q"], "velAct": AXIS["v"], name: np.gradient(AXIS["v"], AXIS["t"])}
    _, last, _ = written(tmp_path, {**table, "xx": rng.standard_normal(SIZE), "yy": rng.standard_normal(SIZE)})
    listed = last.partition("voltage)? ")[2].partition(";")[0]
    assert sorted(listed.split(", ")) == ["xx", "yy"]
    assert not is_neither("acc_torque", "")


def test_of_many_joints_few_are_listed(tmp_path: Path) -> None:
    table = {"t": AXIS["t"]}
    for k in range(12):
        size = 1.0 + 0.1 * k
        table |= {f"torque{k}": size * AXIS["u"], f"position{k}": size * AXIS["q"]}
    said, _, found = written(tmp_path, table)
    (line,) = [line for line in said.splitlines() if "it moves most" in line]
    assert (found["position"], line.count("position"), line.count(", ...")) == ("position11", 1, 1)
    assert " 11 " in line
    assert " 3 " not in line  # the eight that move most
