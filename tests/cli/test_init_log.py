"""`dsd init LOG`, the real command: what it recognises, what it proposes, and that it says what it guessed."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from dsd_cli.files.joints import joints_of
from dsd_cli.files.names_in import unit_in
from dsd_cli.files.recognise import recognise
from tests.cli.rig import csv_text, done, dsd, refused
from tests.files.formats import makers

OURS = ["t", "u", "d_hat", "velocity", "position", "reference"]
DSPACE = ["Time [ms]", "i_q [A]", "i_d [A]", "pos_rad", "n_act [rpm]", "Temp_Motor"]


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        (OURS, OURS),
        (DSPACE, ["Time [ms]", "i_q [A]", None, None, "pos_rad", None]),
        (["timestamp_us", "motor_torque", "joint_velocity_deg_s", "joint_position_deg"],
         ["timestamp_us", "motor_torque", None, "joint_velocity_deg_s", "joint_position_deg", None]),
        (["t", "q_ref", "q_meas", "dq", "tau", "tau_limit"], ["t", "tau", None, "dq", "q_meas", "q_ref"]),
        (["Zeit", "Strom", "Drehzahl", "Lage", "Lage_soll"], ["Zeit", "Strom", None, "Drehzahl", "Lage", "Lage_soll"]),
        (["t", "iq_ref", "iq_act", "speed_ref", "speed"], ["t", "iq_act", None, "speed", None, None]),
        (["joint_states/effort/elbow", "joint_states/velocity/elbow", "joint_states/position/elbow"],
         [None, "joint_states/effort/elbow", None, "joint_states/velocity/elbow", "joint_states/position/elbow", None]),
        (["iq/Time", "iq/Data", "speed/Time", "speed/Data"], ["iq/Time", "iq/Data", None, "speed/Data", None, None]),
        (["input_pos", "pos_estimate", "vel_estimate"],
         [None, None, None, "vel_estimate", "pos_estimate", "input_pos"]),
        (["input_pos", "input_vel", "control_angle", "pos"], [None, None, None, None, "pos", "input_pos"]),
        (["ms", "current_motor", "duty_cycle", "erpm"], ["ms", "current_motor", None, "erpm", None, None]),
        (["a", "b", "c"], [None] * 6),
    ],
)  # fmt: skip
def test_names_that_rigs_use(columns: list[str], expected: list[str | None]) -> None:
    channels = ("time", "u", "d_hat", "velocity", "position", "reference")
    found = recognise(columns)
    assert [found[c].column if c in found else None for c in channels] == expected


def test_units_in_names() -> None:
    found = recognise(["time_us", "current [mA]", "speed (1/min)", "angle_deg"])
    assert found["time"].time_unit == "us"
    assert (found["u"].factor, found["velocity"].factor) == (1e-3, pytest.approx(2 * math.pi / 60))
    assert found["position"].factor == pytest.approx(math.pi / 180)
    assert recognise(["t", "i", "position [counts]"])["position"].factor is None
    assert unit_in("axs/x/values/actual/vel/mm-per-min", "velocity") == "mm/min"
    assert (unit_in("axs/x/values/actual/pos/mm", "position"), unit_in("axs/x/m", "velocity")) == ("mm", "")
    assert recognise(["speed [mm/min]"])["velocity"].factor == pytest.approx(1e-3 / 60.0)
    spoken = {column: recognise([column])["u"].spoken for column in ("Torque_Nm", "force_N", "current [mA]", "u")}
    assert recognise(["Torque mNm"])["u"].factor == 1e-3
    axis = recognise(["t_x", "u_x", "v_x", "x"])
    assert {name: one.column for name, one in axis.items()} == {
        "time": "t_x",
        "u": "u_x",
        "velocity": "v_x",
        "position": "x",
    }
    assert (recognise(["torque_cmd_mNm"])["u"].factor, recognise(["current_mA"])["u"].factor) == (1e-3, 1e-3)
    assert spoken == {"Torque_Nm": "N m", "force_N": "N", "current [mA]": "0.001 A", "u": ""}


def axis(rows: int = 6000, step: float = 0.001) -> dict[str, np.ndarray]:
    """A mass of 0.02 under a sum of sines, with u as it was 3 ms before: by plain sums, not by our simulator."""
    t = np.arange(rows) * step
    u = np.sin(8.1 * t) + 0.7 * np.sin(27.0 * t + 1.0) + 0.4 * np.sin(61.0 * t)
    late = np.concatenate([np.zeros(3), u[:-3]])
    velocity = np.concatenate([[0.0], np.cumsum(late[:-1] * step / 0.02)])
    position = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * step)])
    return {"t": t, "u": u, "velocity": velocity, "position": position}


def test_a_log_with_other_names_and_units_becomes_a_config_that_is_right(tmp_path: Path) -> None:
    data = axis()
    table = {
        "Time [ms]": np.round(data["t"] * 1e3, 6),
        "i_q": data["u"],
        "n [rpm]": data["velocity"] * 60 / (2 * np.pi),
        "pos_rad": data["position"],
        "speed [rpm]": data["velocity"] * 60 / (2 * np.pi),
    }
    (tmp_path / "rig.csv").write_text(csv_text(table))
    result = done("init", "rig.csv", cwd=tmp_path)
    config = load_config(tmp_path / "dsd.toml")
    signals = config.signals
    assert (signals.time, signals.time_unit, signals.u) == ("Time [ms]", "ms", "i_q")
    assert (signals.velocity, signals.position) == ("speed [rpm]", "pos_rad")
    assert (signals.velocity_unit, signals.velocity_scale) == ("rpm", 1.0)
    assert signals.factors() == {"velocity": pytest.approx(2 * math.pi / 60)}
    assert config.model.inertia == pytest.approx(0.02, rel=0.03)
    assert config.model.delay == pytest.approx(0.003, abs=0.0006)
    assert config.detector.window == 100
    for text in (
        '"Time [ms]": by its name, in ms',
        "sample time 0.001 s",
        "rho = ",
        "window = 100",
        "identified from this log",
    ):
        assert text in result.stderr
    label = dsd("detect", "rig.csv", cwd=tmp_path)
    assert label.returncode == 0, label.stderr
    state = f"delay {config.states.delays[1]:g} s, inertia {config.states.inertias[1]:g} "
    assert re.search(rf"final: {state}\S+ \(confident\)", label.stdout)


@pytest.mark.parametrize("motion", [("velocity",), ("position",), ("velocity", "position")])
def test_a_delay_may_be_of_the_only_motion_channel(motion: tuple[str, ...], tmp_path: Path) -> None:
    data = axis(3000)
    (tmp_path / "a.csv").write_text(csv_text({name: data[name] for name in ("t", "u", *motion)}))
    said = done("init", "a.csv", cwd=tmp_path).stderr
    (line,) = [line for line in said.splitlines() if line.strip().startswith("delays = ")]
    assert "identified from this log" in line
    late = f"if it is u that is late and not the measured {motion[0]}: one motion channel cannot show which"
    assert (late in line) is (len(motion) == 1)


def test_a_delay_beside_a_force_that_lacks_is_not_written_and_the_file_says_so(tmp_path: Path) -> None:
    """Dry friction, and a u that acts 10 ms later, by plain sums: the model that is written has no friction."""
    step, rows = 0.001, 8000
    t = np.arange(rows) * step
    path = np.sin(3.0 * t) + 0.4 * np.sin(7.7 * t + 1.0)
    u, q, v = np.zeros(rows), np.zeros(rows), np.zeros(rows)
    for k in range(rows - 1):
        u[k] = 8.0 * (path[k] - q[k]) - 0.6 * v[k]
        v[k + 1] = v[k]
        for _ in range(10):
            v[k + 1] += step / 10 / 0.02 * (u[max(k - 10, 0)] - 0.5 * np.tanh(v[k + 1] / 0.02))
        q[k + 1] = q[k] + step * 0.5 * (v[k] + v[k + 1])
    (tmp_path / "a.csv").write_text(csv_text({"t": t, "u": u, "position": np.round(q, 4)}))
    said = done("init", "a.csv", cwd=tmp_path).stderr
    assert load_config(tmp_path / "dsd.toml").model.delay == 0.0
    text = (tmp_path / "dsd.toml").read_text("utf-8")
    (line,) = [line for line in text.splitlines() if line.startswith("delay = ")]
    assert "would fit, but as much may be made by a force that [model] lacks" in line
    assert "would fit" in said


@pytest.mark.parametrize(
    ("u", "position", "velocity", "named", "factors"),
    [
        ("A", "turn", "turn/s", ("A", "turn", "turn/s"), {"position": 2 * math.pi, "velocity": 2 * math.pi}),
        ("mNm", "deg", "rpm", ("N m", "deg", "rpm"), {"u": 1e-3, "position": math.pi / 180, "velocity": math.pi / 30}),
        ("N", "mm", "m/s", ("N", "mm", "m/s"), {"position": 1e-3}),
        ("V", "rad", "rad/s", ("V", "rad", "rad/s"), {}),
        ("Nm", "mrad", "mrad/s", ("N m", "mrad", "mrad/s"), {"position": 1e-3, "velocity": 1e-3}),
        ("N", "cm", "cm/s", ("N", "cm", "cm/s"), {"position": 1e-2, "velocity": 1e-2}),
        ("A", "deg", "m/s", ("A", "", "m/s"), {}),  # a belt: the place is read in what the speed is the slope of
        ("A", "furlong", "rpm", ("A", "", "rpm"), {"velocity": math.pi / 30, "position": math.pi / 30}),
    ],
)
def test_units_of_the_log_are_named_in_the_config(u, position, velocity, named, factors, tmp_path: Path) -> None:
    """So that every table and picture has them; the factors are those of a table of units."""
    data = axis(1500)
    table = {f"iq [{u}]": data["u"], f"pos [{position}]": data["position"], f"vel [{velocity}]": data["velocity"]}
    (tmp_path / "a.csv").write_text(csv_text({"t": data["t"], **table}))
    said = done("init", "a.csv", cwd=tmp_path).stderr
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u_unit, signals.position_unit, signals.velocity_unit) == named
    scales = {name: value for name, value in signals.factors().items() if name not in ("d_hat", "reference")}
    assert scales == {name: pytest.approx(value, rel=1e-5) for name, value in factors.items()}
    assert ("which makes this its factor" in said) == ((position, velocity) in (("furlong", "rpm"), ("deg", "m/s")))
    assert "it is taken as" not in said  # a unit that nobody knows has its factor by the other one: nothing is open


@pytest.mark.parametrize("position", ["pos [cnt]", "pos_cnt", "pos [inc]"])
def test_counts_are_said_to_be_counts_with_the_keys_that_they_need(position, tmp_path: Path) -> None:
    data = axis(1500)
    table = {"t": data["t"], "iq [A]": data["u"], position: data["position"]}
    (tmp_path / "a.csv").write_text(csv_text(table))
    said = done("init", "a.csv", cwd=tmp_path).stderr
    assert f'position: the unit of "{position}" is counts: position_unit = "counts" and counts_per_turn' in said
    answer = ("--set", "signals.position_unit=counts", "--set", "signals.counts_per_turn=4096")
    assert "it is taken as" not in done("init", "a.csv", "--force", *answer, cwd=tmp_path).stderr


@pytest.mark.parametrize(
    ("name", "kind", "u"),
    [
        ("current", "signed", "current"),
        ("current", "size", "applied_volts"),
        ("current", "held", "current"),
        ("current", "one way", "current"),
        ("current", "another's", "current"),
        ("torque", "size", "applied_volts"),
    ],
)
def test_a_current_without_a_direction_is_not_u_where_a_voltage_has_one(name, kind, u, tmp_path: Path) -> None:
    """A supply's current is at least 0, and near it whenever u turns. One that holds a weight is never near it, that of
    an axis that turns one way is right, and a voltage that it does not follow is another's business. Of a torque only
    how little of it the motion explains is said.
    """
    data, other = axis(1500), np.random.default_rng(6).standard_normal(1500)
    way = abs(data["u"]) if kind == "one way" else data["u"]
    position = data["position"] - data["velocity"].mean() * data["t"]
    position = np.cumsum(np.cumsum(way)) * 1e-6 / 0.02 if kind == "one way" else position
    found = {"signed": way, "held": 2.0 * abs(way).max() + way}.get(kind, abs(way))
    volts = other if kind == "another's" else 5.0 * data["u"]
    table = {"t": data["t"], name: found, "applied_volts": volts, "position": position}
    (tmp_path / "a.csv").write_text(csv_text(table))
    said = done("init", "a.csv", cwd=tmp_path).stderr
    assert load_config(tmp_path / "dsd.toml").signals.u == u
    assert ("has no direction though the axis turns" in said) == (u == "applied_volts" and name == "current")


@pytest.mark.parametrize("fed", ["battery_volts", "bus_volts", "supply_volts", "vbus [V]"])
def test_the_voltage_of_a_supply_is_no_u(fed: str, tmp_path: Path) -> None:
    data = axis(1500)
    sag = 12.0 - 0.1 * data["u"] ** 2
    table = {"t": data["t"], fed: sag, "duty": data["u"], "position": data["position"], "velocity": data["velocity"]}
    (tmp_path / "a.csv").write_text(csv_text(table))
    done("init", "a.csv", cwd=tmp_path)
    assert load_config(tmp_path / "dsd.toml").signals.u == "duty"


def test_units_of_a_scopes_symbols_are_read(tmp_path: Path) -> None:
    """TwinCAT: a preamble that repeats what a row is before every value."""
    data = axis(1500)
    said = {"Name": ("iq", "pos"), "SymbolUnit": ("A", "deg")}
    rows = [f"{row}\t{u}\t{row}\t{q}" for row, (u, q) in said.items()]
    columns = zip(*(data[name] for name in ("t", "u", "position")), strict=True)
    rows += [f"{1e3 * t:.6g}\t{u:.9g}\t{1e3 * t:.6g}\t{q:.9g}" for t, u, q in columns]
    (tmp_path / "a.csv").write_text("\n".join(["Name\tScope", "", *rows]) + "\n")
    done("init", "a.csv", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u_unit, signals.position_unit) == ("A", "deg")


@pytest.mark.parametrize("kind", ["mdf", "tdms", "mat5", "mcap_json"])
def test_logs_of_other_tools(kind: str, tmp_path: Path) -> None:
    made = getattr(makers, kind)(tmp_path, {name: axis(2000)[name] for name in ("t", "u", "velocity")})
    done("init", made.path, cwd=tmp_path)
    config = load_config(tmp_path / "dsd.toml")
    assert config.signals.u.endswith(made.names["u"].rpartition("/")[2])
    assert config.signals.velocity.endswith(made.names["velocity"].rpartition("/")[2])
    done("detect", made.path, cwd=tmp_path)


JOINTS = ("shoulder_pan_joint", "wrist_1_joint", "wrist_2_joint")


@pytest.mark.parametrize("moving", JOINTS)
def test_of_many_joints_the_one_that_moves_is_chosen(moving: str, tmp_path: Path) -> None:
    data, rng = axis(2000), np.random.default_rng(4)
    drive = {}
    for joint in JOINTS:
        share = 1.0 if joint == moving else 0.0
        drive |= {
            f"effort_{joint}": share * data["u"] + 3.0 * (1.0 - share) + 0.01 * rng.standard_normal(2000),
            f"velocity_{joint}": share * data["velocity"] + 0.001 * rng.standard_normal(2000),
            f"temp_{joint}": 40.0 + np.arange(2000),
        }
    np.savez(tmp_path / "arm.npz", time=data["t"], **drive)
    said = done("init", "arm.npz", cwd=tmp_path).stderr
    config = load_config(tmp_path / "dsd.toml")
    assert (config.signals.u, config.signals.velocity) == (f"effort_{moving}", f"velocity_{moving}")
    assert config.signals.time == "time"
    assert config.model.inertia == pytest.approx(0.02, rel=0.1)
    label = moving.removesuffix("_joint")
    assert f"joint {label} of 3: it moves most (standard deviation of velocity: shoulder_pan " in said


def test_the_joint_that_moves_in_messages_and_in_groups(tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")
    made = makers.mcap_ros2(tmp_path, {name: axis(1500)[name] for name in ("t", "u", "velocity")})
    said = done("init", made.path, cwd=tmp_path).stderr
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u, signals.velocity) == (made.names["u"], made.names["velocity"])
    assert "joint elbow of 2" in said


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        (["t", "iq_1", "iq_2", "speed_1", "speed_2"], {"1": {"iq_1", "speed_1"}, "2": {"iq_2", "speed_2"}}),
        (["axis1/t", "axis1/iq", "axis1/pos", "axis2/t", "axis2/iq", "axis2/pos"],
         {"1": {"axis1/t", "axis1/iq", "axis1/pos"}, "2": {"axis2/t", "axis2/iq", "axis2/pos"}}),
        (["t", "voltage_a", "voltage_b", "voltage_c", "speed"], {}),  # three phases of one motor
        (["t", "torque_motor", "torque_load", "speed_motor", "speed_load"], {}),  # two ends of one axis
        (["t", "u", "velocity"], {}),
    ],
)  # fmt: skip
def test_which_columns_belong_to_one_joint(columns: list[str], expected: dict[str, set[str]]) -> None:
    assert joints_of(columns, recognise(columns)) == expected


def test_without_a_time_or_units_it_says_what_it_took(tmp_path: Path) -> None:
    data = axis(3000)
    (tmp_path / "a.csv").write_text(csv_text({"torque": data["u"], "speed": data["velocity"]}))
    asked = dsd("init", "a.csv", cwd=tmp_path)
    assert (asked.returncode, "how many s are its rows apart?" in asked.stderr) == (1, True)
    assert "sample_time = 0.0 " in (tmp_path / "dsd.toml").read_text()
    said = done("init", "a.csv", "--force", "--set", "signals.sample_time=0.001", cwd=tmp_path).stderr
    assert 'the unit of "speed" is not said; it is taken as rad/s or m/s' in said
    assert load_config(tmp_path / "dsd.toml").signals.sample_time == 0.001
    (tmp_path / "b.csv").write_text(csv_text({"t": data["t"] * 1e6, "torque": data["u"], "speed": data["velocity"]}))
    said = done("init", "b.csv", "--force", cwd=tmp_path).stderr
    assert "time_unit: not said; steps of 1000 are taken as us" in said
    assert "which?" not in said


@pytest.mark.parametrize(("units", "code"), [((" [rad]", " [rad/s]"), 0), (("", ""), 1)])
def test_without_a_time_the_slope_says_how_far_rows_are_apart(
    units: tuple[str, str], code: int, tmp_path: Path
) -> None:
    """Only where both units are said: else it may be one of the units that is another, and it asks."""
    data = axis(3000, 0.005)
    table = {"torque": data["u"], f"angle{units[0]}": data["position"], f"speed{units[1]}": data["velocity"]}
    (tmp_path / "a.csv").write_text(csv_text(table))
    answer = dsd("init", "a.csv", cwd=tmp_path)
    assert answer.returncode == code, answer.stderr
    if code == 0:
        assert load_config(tmp_path / "dsd.toml").signals.sample_time == pytest.approx(0.005, rel=1e-3)
    else:
        assert answer.stderr.splitlines()[-1].endswith("--set signals.sample_time=0.005")


@pytest.mark.parametrize(("unit", "scale", "doubted"), [("ms", 1.0, True), ("s", 1e3, True), ("ms", 1e3, False)])
def test_a_unit_in_the_name_that_cannot_be_is_doubted(unit: str, scale: float, doubted: bool, tmp_path: Path) -> None:
    data = axis(1000)
    (tmp_path / "a.csv").write_text(
        csv_text({f"Time [{unit}]": data["t"] * scale, "torque": data["u"], "speed": data["velocity"]})
    )
    said = done("init", "a.csv", cwd=tmp_path).stderr
    assert ("they would be 0.001 s: which?" in said) == doubted


def test_refused_in_one_line(tmp_path: Path) -> None:
    refused(dsd("init", "none.csv", cwd=tmp_path), 1, "none.csv: no such file")
    refused(dsd("init", "a.csv", "--template", "servo", cwd=tmp_path), 2, "give a log or --template")
    (tmp_path / "b.csv").write_text(csv_text(axis(300)))
    refused(dsd("init", "b.csv", "-o", "b.csv", "--force", cwd=tmp_path), 2, "b.csv: is the input")
    assert not (tmp_path / "dsd.toml").exists()
