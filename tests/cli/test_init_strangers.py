"""`dsd init` and `dsd check` on files as other tools write them: roles, units and clock that nobody named."""

import datetime
import json
import math
import os
import pty
import shlex
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dsd_cli.cli.init_roles import by_names, choose, roles_of
from dsd_cli.cli.init_units import units_of
from dsd_cli.files.config import load_config
from dsd_cli.files.recognise import Recognised, is_force, is_neither, recognise, role_of_unit, unit_in
from dsd_cli.files.sample import Sample, Table, sample
from dsd_cli.roles import Channel, guess_roles, slope_of
from tests.cli.rig import DSD, done, dsd, refused
from tests.files import strangers
from tests.recordings import recording

AXIS = strangers.axis()
JOINTS = {"position": "q", "velocity": "v", "effort": "u"}


@pytest.mark.parametrize("name", strangers.MADE)
def test_a_strangers_file_ends_in_a_config_that_check_takes(name: str, tmp_path: Path) -> None:
    make, u, motion = strangers.MADE[name]
    path = make(tmp_path, AXIS)
    done("init", path.name, cwd=tmp_path)
    config = load_config(tmp_path / "dsd.toml")
    assert (config.signals.u, motion in (config.signals.position, config.signals.velocity)) == (u, True)
    answer = json.loads(done("check", path.name, "--format", "json", cwd=tmp_path).stdout)
    assert [one["what"] for one in answer["findings"] if one["severity"] == "error"] == []
    assert answer["by_log"][0]["seconds"] == pytest.approx(strangers.ROWS * strangers.STEP, rel=0.03)
    factors = {"trace": 1e-3, "spreadsheet": 1e-3, "twincat": 1e-3, "recorder": np.pi / 180, "degrees": np.pi / 180}
    factors |= {"two_levels": 1e-6, "printed": np.pi / 180, "packed": np.pi / 180, "thousands": 1e-6}
    factors |= {"slashed": np.pi / 180, "counts": np.pi / 180}
    if motion == config.signals.position:
        assert config.signals.factors().get("position", 1.0) == pytest.approx(factors.get(name, 1.0))


@pytest.mark.parametrize(
    ("name", "findings"), [("a3MR.csv", 0), ("kuka_A.mat", 0), ("frc_sysid.json", 0), ("hsm_idf_pos_0.06_1.mat", None)]
)
def test_files_of_real_machines(name: str, findings: int | None, tmp_path: Path) -> None:
    path = recording(f"foreign_files/{name}")
    result = dsd("init", str(path), cwd=tmp_path)
    if findings is None:
        refused_with_a_question(result, tmp_path)
        return
    assert result.returncode == 0, result.stderr
    answer = json.loads(done("check", str(path), "--format", "json", cwd=tmp_path).stdout)
    assert len([one for one in answer["findings"] if one["severity"] == "error"]) == findings


def refused_with_a_question(result: subprocess.CompletedProcess, folder: Path) -> str:
    """The command that the last line says, and the rest of the config is there with one line marked."""
    assert result.returncode == 1
    last = result.stderr.splitlines()[-1]
    assert "which column is" in last
    assert "<- MISSING" in (folder / "dsd.toml").read_text()
    return last.partition("say it: ")[2]


def ambiguous(folder: Path) -> Path:
    """Noise that nothing explains, beside a position."""
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((2, strangers.ROWS))
    lines = ["stamp,alpha,beta,q", *strangers.rows(AXIS, AXIS["t"], a, b, AXIS["q"])]
    return strangers.text(folder, "what.csv", lines)


def test_what_is_missing_is_asked_with_the_command_that_says_it(tmp_path: Path) -> None:
    path = ambiguous(tmp_path)
    command = refused_with_a_question(dsd("init", path.name, cwd=tmp_path), tmp_path)
    assert command == "dsd init what.csv --force --u NAME"
    done(*shlex.split(command.replace("NAME", "beta"))[1:], cwd=tmp_path)
    assert load_config(tmp_path / "dsd.toml").signals.u == "beta"
    refused(dsd("init", path.name, "--force", "--u", "gamma", cwd=tmp_path), 2, 'no column "gamma"', "alpha, beta")


def test_stamps_that_are_coarser_than_the_rows_are_no_clock(tmp_path: Path) -> None:
    """At 10 ms one row of five was left, and the rest said to be left out by `check` alone."""
    lines = strangers.rows(AXIS, np.floor(100.0 * AXIS["t"] + 1e-6) / 100.0, AXIS["u"], AXIS["q"])
    strangers.text(tmp_path, "log.csv", ["time,torque,pos", *lines])
    last = dsd("init", "log.csv", cwd=tmp_path).stderr.splitlines()[-1]
    assert '"time" stands still in 80 % of them; 0.002 if they are even' in last
    done(*shlex.split(last.partition("say it: ")[2])[1:], cwd=tmp_path)
    answer = json.loads(done("check", "log.csv", "--format", "json", cwd=tmp_path).stdout)
    assert answer["by_log"][0]["seconds"] == pytest.approx(strangers.ROWS * strangers.STEP)


def test_on_a_terminal_it_is_asked(tmp_path: Path) -> None:
    ambiguous(tmp_path)
    master, slave = pty.openpty()
    process = subprocess.Popen(
        [*map(str, DSD), "init", "what.csv"], cwd=tmp_path, stdin=slave, stderr=slave, stdout=subprocess.PIPE
    )
    os.close(slave)
    os.write(master, b"beta\nfurlong\ndeg\n")
    assert process.wait(timeout=120) == 0
    os.close(master)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u, signals.position_unit) == ("beta", "deg")


def test_a_time_between_rows_is_asked_and_a_slip_of_the_hand_is_asked_again(tmp_path: Path) -> None:
    """A missing sample time was left to a second command, and a name that is no column ended init."""
    odd = np.round(5.0 * np.random.default_rng(2).standard_normal(AXIS["u"].size))
    lines = strangers.rows(AXIS, AXIS["u"] + odd, AXIS["u"] - odd, AXIS["q"])
    strangers.text(tmp_path, "what.csv", ["alpha,beta,pos", *lines])
    master, slave = pty.openpty()
    process = subprocess.Popen(
        [*map(str, DSD), "init", "what.csv"], cwd=tmp_path, stdin=slave, stderr=slave, stdout=subprocess.PIPE
    )
    os.close(slave)
    os.write(master, f"gamma\nbeta\nsoon\n-1\n{strangers.STEP}\ndeg\n".encode())
    assert process.wait(timeout=120) == 0, os.read(master, 4000).decode()
    os.close(master)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u, signals.sample_time, signals.time) == ("beta", strangers.STEP, None)
    assert signals.position_unit == "deg"


def test_columns_by_hand_by_number_and_values_that_are_set(tmp_path: Path) -> None:
    path = strangers.liveplotter(tmp_path, AXIS)
    done("init", path.name, "--u", "4", "--velocity", "2", "--set", "signals.u_sign=-1", "-o", "a.toml", cwd=tmp_path)
    signals = load_config(tmp_path / "a.toml").signals
    assert (signals.u, signals.velocity, signals.u_sign, signals.time) == ("4", "2", -1, "1")


def test_a_log_from_a_pipe(tmp_path: Path) -> None:
    content = strangers.short_names(tmp_path, AXIS).read_bytes()
    done("init", "-", stdin=content, cwd=tmp_path)
    assert load_config(tmp_path / "dsd.toml").signals.u == "vir"
    done("detect", "-", stdin=content, cwd=tmp_path)


def test_where_the_rows_are_can_be_said(tmp_path: Path) -> None:
    """Two rows above the numbers could be the header: [csv] says which, in files and in pipes."""
    head = ["a title, of two", "first,second,third", "moment,place,force"]
    path = strangers.text(tmp_path, "odd.csv", head + strangers.rows(AXIS, AXIS["t"], AXIS["q"], AXIS["u"]))
    where = ["--set", "csv.header=2", "--set", "csv.units_row=3"]
    done("init", path.name, *where, "--u", "third", "--position", "second", "--time", "first", cwd=tmp_path)
    assert load_config(tmp_path / "dsd.toml").csv.header == 2
    whole = done("detect", path.name, "--format", "json", cwd=tmp_path).stdout
    piped = done("detect", "-", "--format", "json", stdin=path.read_bytes(), cwd=tmp_path).stdout
    assert json.loads(whole)["segments"] == json.loads(piped)["segments"]
    refused(dsd("check", path.name, "--set", "csv.header=900000", cwd=tmp_path), 1, "[csv] names a line")


def test_a_pointer_of_git_lfs_is_named(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3\n")
    refused(dsd("init", "log.csv", cwd=tmp_path), 1, "log.csv: is a pointer of Git LFS", "git lfs pull")


@pytest.mark.parametrize(
    ("name", "channel", "unit"),
    [
        ("rec/pos_deg/1", "position", "deg"),
        ("vel_deg_per_s[2]", "velocity", "deg/s"),
        ("vel [deg/s] (3)", "velocity", "deg/s"),
        ("torque_abs_nm/6", "u", "nm"),
        ("drive/velocity/1", "velocity", ""),
        ("/Arm/VelocityRadPerSec", "velocity", "rad/s"),
        ("dwell [ms]/time", "time", ""),
        ("Torque [% of rated torque]", "u", "% of rated torque"),
        ("Time (relative) in ms", "time", "ms"),
        ("Position in [mm]", "position", "mm"),
        ("Torque in (Nm)", "u", "Nm"),
        ("r63[0]: Speed smoothed in rpm", "velocity", "rpm"),
        ("RECPROBE1(Time)", "time", ""),
        ("dwell [ms]/time [s]", "time", "s"),
        ("('motor', 'iq_A')", "u", "A"),  # two levels of columns, as pandas writes them to Parquet
        ("('motor', 'iq', '')", "u", ""),
    ],
)
def test_the_number_of_a_matrix_column_hides_no_unit(name: str, channel: str, unit: str) -> None:
    assert unit_in(name, channel) == unit


def test_a_part_of_a_unit_is_of_what_the_unit_is_of() -> None:
    """A case in tenths of a degree was proposed as u, and tenths of a turn a minute were taken as turns."""
    assert is_neither("Case [0.1 °C]", "")
    assert is_neither("Case", "0.1 °C")
    assert is_force("x", "0.1 Nm")
    assert role_of_unit("0.1 rpm") == "velocity"
    assert recognise(["Speed (1/10 rpm)"])["velocity"].factor == pytest.approx(math.pi / 300.0)
    assert recognise(["Torque [1/1000 of rated]"])["u"].factor == 0.1


@pytest.mark.parametrize(
    ("names", "roles"),
    [
        (["timestamp", "q_current", "rotor"], {"time": "timestamp", "u": "q_current"}),
        (["t", "x_velocity", "tau"], {"time": "t", "velocity": "x_velocity", "u": "tau"}),
        (["time", "V(torque)", "V(theta)"], {"time": "time", "u": "V(torque)", "position": "V(theta)"}),
        (["time", "V(out)", "I(R1)"], {"time": "time"}),
        (["t", "Position Deviation", "iq"], {"time": "t", "u": "iq"}),
        (["t", "target_q_1", "actual_q_1"], {"time": "t", "position": "actual_q_1", "reference": "target_q_1"}),
        (["t", "axisTorqueExt", "axisTorque", "axisQMsr"], {"time": "t", "u": "axisTorque", "position": "axisQMsr"}),
        (["('motor', 'tau')", "('link', 'q')"], {"u": "('motor', 'tau')", "position": "('link', 'q')"}),
        (["Time", "MotTrq[Nm]", "PackCurrent[A]", "BMS::Current"], {"time": "Time", "u": "MotTrq[Nm]"}),
    ],
)
def test_a_letter_is_a_name_only_where_no_word_beside_it_is(names: list[str], roles: dict[str, str]) -> None:
    assert {role: one.column for role, one in recognise(names).items()} == roles
    assert recognise(["torque", "q", "q_current"])["position"].others == ()


def test_the_voltage_of_a_bus_is_no_u_though_the_motion_explains_it() -> None:
    t = 1e-3 * np.arange(4000)
    place = np.sin(2.0 * np.pi * 1.3 * t) + 0.3 * np.sin(2.0 * np.pi * 3.7 * t)
    force = np.gradient(np.gradient(place, 1e-3), 1e-3) + 5.0 * np.gradient(place, 1e-3)
    for name, role in (("r_vbus", None), ("r_x1", "r_x1")):
        table = {"t": t, "position": place, name: 24.0 + 1e-3 * force}
        rows = Table("", tuple(Channel(column, x[50:-50]) for column, x in table.items()), 3900)
        found = roles_of(by_names(rows, {}), rows, {}).found.get("u")
        assert (found and found.column) == role


@pytest.mark.parametrize(("of_arrival", "time"), [(True, "header.stamp"), (False, "time")])
def test_of_two_stamps_of_a_message_the_even_ones_are_the_time(of_arrival: bool, time: str) -> None:
    late = np.random.default_rng(4).uniform(0.0, 0.9 * strangers.STEP, strangers.ROWS)
    stamps = {"time": AXIS["t"] + late * of_arrival, "header.stamp": AXIS["t"] + late * (not of_arrival)}
    columns = stamps | {"effort": AXIS["u"], "position": AXIS["q"]}
    rows = Table("", tuple(Channel(name, x) for name, x in columns.items()), strangers.ROWS)
    assert choose("log.csv", Sample((rows,)), {}).found["time"].column == time
    assert choose("log.csv", Sample((rows,)), {"time": "time"}).found["time"].column == "time"


def test_the_name_of_a_matrix_with_a_clock_is_that_of_none_of_its_columns() -> None:
    names = ["X/1", "X/2", "X/3", "X/4"]
    data = [AXIS["t"], AXIS["q"], AXIS["v"], AXIS["u"]]
    rows = Table("", tuple(Channel(name, x) for name, x in zip(names, data, strict=True)), strangers.ROWS)
    found = choose("log.mat", Sample((rows,)), {}).found
    roles = ("time", "position", "velocity", "u")
    assert {role: found[role].column for role in roles} == dict(zip(roles, names, strict=True))


@pytest.mark.parametrize(
    ("position", "velocity"), [("turn", "rad/s"), ("rad", "turn/s"), ("deg", "rpm"), ("rad", "rpm")]
)
def test_units_that_nobody_says_are_those_whose_ratio_the_channels_have(position: str, velocity: str) -> None:
    """Factors written out: what one unit is in rad."""
    of = {"rad": 1.0, "deg": np.pi / 180, "turn": 2 * np.pi, "rad/s": 1.0, "turn/s": 2 * np.pi, "rpm": np.pi / 30}
    channels = {"t": AXIS["t"], "a": AXIS["q"] / of[position], "b": AXIS["v"] / of[velocity]}
    table = Table("", tuple(Channel(name, x) for name, x in channels.items()), strangers.ROWS)
    found = {role: Recognised(role, name) for role, name in (("time", "t"), ("position", "a"), ("velocity", "b"))}
    assert units_of(table, found, 1.0, None).keys == {"position_unit": position, "velocity_unit": velocity}


def test_german_units_are_known(tmp_path: Path) -> None:
    turns = 60.0 / (2.0 * np.pi)
    lines = ["Zeit [s];Winkel [Grad];Drehzahl [U/min];Drehmoment [Nm]"]
    lines += strangers.rows(AXIS, AXIS["t"], np.degrees(AXIS["q"]), AXIS["v"] * turns, AXIS["u"], by=";")
    path = strangers.text(tmp_path, "a.csv", lines)
    said = done("init", path.name, cwd=tmp_path).stderr
    assert "not known" not in said
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.position_unit, signals.velocity_unit) == ("deg", "rpm")
    assert signals.factors()["position"] == pytest.approx(math.pi / 180.0)


def test_a_robots_matrices_in_degrees(tmp_path: Path) -> None:
    """Units before /1; the motor's measured angle is no reference; no rho where there is no inertia.

    Its velocity is filtered, 22 ms late, and so left out."""
    said = done("init", str(recording("foreign_files/kuka_A.mat")), cwd=tmp_path).stderr
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u_unit, signals.position_unit, signals.velocity) == ("N m", "deg", None)
    assert "later than the slope of position" in said
    assert "taken as rad" not in said
    assert "reference = " not in said
    assert "rho = " not in said
    assert "rho are the template's" in said


@pytest.mark.parametrize("earlier", [0, 5])
def test_only_what_is_earlier_is_a_reference(earlier: int) -> None:
    """Two sensors of one angle, of which one has less noise, are none of them asked for."""
    rng = np.random.default_rng(2)
    t = 1e-3 * np.arange(4000)
    place = np.sin(2.0 * np.pi * 1.3 * t) + 0.3 * np.sin(2.0 * np.pi * 3.7 * t)
    noisy, smooth = place + 1e-3 * rng.standard_normal(t.size), np.roll(place, -earlier)
    channels = [Channel(name, x[50:-50]) for name, x in (("t", t), ("a", noisy), ("b", smooth))]
    found = guess_roles(channels, {"time": "t", "position": "a"}).found
    assert ("reference" in found) == (earlier > 0)


def test_of_two_that_a_motion_explains_as_well_none_is_u() -> None:
    """Neither the motion nor u has a name: parts of a rotation, say. With a name for the motion, one of them is."""
    t = 1e-3 * np.arange(4000)
    place = np.sin(2.0 * np.pi * 1.3 * t) + 0.3 * np.sin(2.0 * np.pi * 3.7 * t)
    force = np.gradient(np.gradient(place, 1e-3), 1e-3) + 5.0 * np.gradient(place, 1e-3)
    table = {"t": t, "1": place, "2": force, "3": force + 9.0 * place}
    channels = [Channel(name, x[50:-50]) for name, x in table.items()]
    assert "u" not in guess_roles(channels, {"time": "t"}).found
    assert guess_roles(channels, {"time": "t", "position": "1"}).found["u"].column in ("2", "3")
    assert guess_roles(channels[:3], {"time": "t"}).found["u"].column == "2"


def test_places_and_orientations_of_a_robot_are_no_u(tmp_path: Path) -> None:
    """A log of poses holds nothing that makes an axis move: w is no speed, z no torque."""
    turn = 0.2 * AXIS["q"]
    names = ["t", *(f"base/pose/position/{c}" for c in "xy"), *(f"base/pose/orientation/{c}" for c in "zw")]
    rows = strangers.rows(AXIS, AXIS["t"], AXIS["q"], 0.1 * AXIS["u"], np.sin(turn), np.cos(turn))
    strangers.text(tmp_path, "a.csv", [",".join(names), *rows])
    result = dsd("init", "a.csv", cwd=tmp_path)
    refused_with_a_question(result, tmp_path)
    assert "? none looks like it; dsd.toml has the rest" in result.stderr.splitlines()[-1]


def test_shares_of_rated_torque_are_units_of_u_and_a_temperature_is_never_u(tmp_path: Path) -> None:
    """In what Windows writes, whose per mille sign is a control character to Latin."""
    for unit, scale in (("% of rated", 1.0), ("‰ of rated torque", 0.1), ("0.1 %", 0.1), ("‰", 0.1)):
        names = f"t [s],M [{unit}],q [rad],Winding temp,Case [°C]"
        rows = strangers.rows(AXIS, AXIS["t"], AXIS["u"] / scale, AXIS["q"], 20.0 + AXIS["t"], 30.0 + AXIS["u"])
        (tmp_path / "log.csv").write_bytes("\n".join([names, *rows]).encode("cp1252"))
        found = choose("log.csv", looked := sample(str(tmp_path / "log.csv")), {"u": f"M [{unit}]"}).found["u"]
        assert (found.named, found.factor) == ("%", scale)
    assert choose("log.csv", looked, {"position": "q [rad]"}).found["u"].column == "M [‰]"
    without = replace(looked.tables[0], channels=tuple(c for c in looked.tables[0].channels if c.name[0] != "M"))
    asked = choose("log.csv", Sample((without,)), {})
    assert (asked.missing, asked.candidates) == ("u", ())


def test_a_u_that_is_missing_is_named_with_set(tmp_path: Path) -> None:
    """The way out that the message of `check` says is one."""
    path = ambiguous(tmp_path)
    dsd("init", path.name, cwd=tmp_path)
    refused(dsd("check", path.name, cwd=tmp_path), 2, 'signals.u = "": no column given', "--set signals.u=NAME")
    done("check", path.name, "--set", "signals.u=beta", cwd=tmp_path)


@pytest.mark.parametrize("stamp", ["-1e7", "1e9", "-1e300"])
def test_one_stamp_that_is_wrong_does_not_end_init(stamp: str, tmp_path: Path) -> None:
    lines = ["t,torque,position", *strangers.rows(AXIS, AXIS["t"], AXIS["u"], AXIS["q"])]
    lines[1500] = f"{stamp},{lines[1500].partition(',')[2]}"
    path = strangers.text(tmp_path, "a.csv", lines)
    done("init", path.name, cwd=tmp_path)
    assert load_config(tmp_path / "dsd.toml").model.inertia == pytest.approx(2.0, rel=0.1)


def test_a_corrupt_u_of_a_log_of_d_hat_makes_no_endless_rho(tmp_path: Path) -> None:
    """Its square is no number: the config had `rho = inf`, with which nothing is judged."""
    u, d_hat = AXIS["u"].copy(), 0.1 * np.random.default_rng(4).standard_normal(AXIS["u"].size)
    u[1000] = 1e300
    lines = ["t,u,d_hat", *strangers.rows(AXIS, AXIS["t"], u, d_hat)]
    strangers.text(tmp_path, "a.csv", lines)
    done("init", "a.csv", cwd=tmp_path)
    assert np.isfinite(load_config(tmp_path / "dsd.toml").detector.rho)


def test_a_part_of_an_orientation_that_is_asked_for_is_taken(tmp_path: Path) -> None:
    """And qx alone, beside a torque about x, may be a joint: only all four are an orientation."""
    turn = 0.2 * AXIS["q"]
    whole = ["t", "taux", "qx", "qy", "qz", "qw"]
    rows = strangers.rows(AXIS, AXIS["t"], AXIS["u"], AXIS["q"], np.sin(turn), 0.1 * np.cos(turn), np.cos(turn))
    strangers.text(tmp_path, "whole.csv", [",".join(whole), *rows])
    done("init", "whole.csv", "--u", "taux", "--position", "qx", cwd=tmp_path)
    assert load_config(tmp_path / "dsd.toml").signals.position == "qx"
    strangers.text(tmp_path, "one.csv", ["t,taux,qx", *strangers.rows(AXIS, AXIS["t"], AXIS["u"], AXIS["q"])])
    done("init", "one.csv", "--u", "taux", "--force", cwd=tmp_path)
    assert load_config(tmp_path / "dsd.toml").signals.position == "qx"


def test_a_text_without_a_column_of_numbers_is_no_question_which_it_is(tmp_path: Path) -> None:
    (tmp_path / "plotter.txt").write_text("".join(f"u:0x{k % 7:x},pos:0x{k:x}\n" for k in range(200)))
    refused(dsd("init", "plotter.txt", cwd=tmp_path), 1, "plotter.txt: no column holds numbers", "`dsd columns` shows")


def robot(folder: Path) -> Path:
    """What a name says of each is wrong: `q_d` is no velocity, but asked for, and `tau_side` drives nothing."""
    a, rng = AXIS, np.random.default_rng(4)
    names = "duration,q_d,q,dq,tau_side_filtered,tau_J"
    columns = (a["t"], a["r"], a["q"], a["v"], 0.05 * rng.standard_normal(strangers.ROWS), a["u"])
    return strangers.text(folder, "robot.csv", [names, *strangers.rows(a, *columns)])


def test_what_channels_do_counts_more_than_names_that_they_contradict(tmp_path: Path) -> None:
    said = done("init", robot(tmp_path).name, cwd=tmp_path).stderr
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u, signals.position, signals.velocity) == ("tau_J", "q", "dq")
    assert 'u = "tau_J": the motion explains' in said
    assert 'velocity = "dq": it is the slope of q, and q_d is not' in said
    done("init", "robot.csv", "--force", "--u", "tau_side_filtered", "--velocity", "q_d", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u, signals.velocity) == ("tau_side_filtered", "q_d")


@pytest.mark.parametrize(("unit", "turn"), [("deg", 360.0), ("rad", 2.0 * np.pi)])
@pytest.mark.parametrize("beside", [True, False])
def test_a_position_that_wraps_says_its_unit(unit: str, turn: float, beside: bool, tmp_path: Path) -> None:
    a = AXIS
    wrapped = (30.0 * a["q"] * turn / (2.0 * np.pi)) % turn
    columns, names = [a["t"], a["u"], wrapped], "time,current_motor,encoder_position"
    if beside:  # electrical turns per minute of seven pole pairs: what the slope says
        columns, names = [*columns, 30.0 * a["v"] * 7 * 30.0 / np.pi], f"{names},erpm"
    path = strangers.text(tmp_path, "wraps.csv", [names, *strangers.rows(a, *columns, form="{:.9g}")])
    said = done("init", path.name, cwd=tmp_path).stderr
    signals = load_config(tmp_path / "dsd.toml").signals
    assert signals.position_unit == unit
    assert f'"encoder_position" jumps by a turn of {turn:g}' in said
    if beside:
        assert signals.factors()["velocity"] == pytest.approx(np.pi / 30.0 / 7.0, rel=0.01)


def test_a_cell_that_is_no_number_is_named_with_its_line(tmp_path: Path) -> None:
    lines = ["t,u,q", *strangers.rows(AXIS, AXIS["t"], AXIS["u"], AXIS["q"])]
    lines[700] = lines[700].replace(lines[700].split(",")[1], "#DIV/0!")
    strangers.text(tmp_path, "sheet.csv", lines)
    result = dsd("init", "sheet.csv", cwd=tmp_path)
    said = result.stderr
    assert (result.returncode, load_config(tmp_path / "dsd.toml").signals.u) == (1, "u")
    assert "next: dsd check" not in said
    assert (tmp_path / "dsd.toml").read_text().startswith("# <- MISSING: its rows could not be read")
    assert 'sheet.csv: its rows could not be read: line 701, column "u": "#DIV/0!" is not a number' in said
    assert "the numbers in dsd.toml are the template's: mend it" in said


def test_a_velocity_is_the_slope_of_counts_though_the_axis_rests_most_of_the_time() -> None:
    t = np.arange(6000) * 1e-3
    q = np.interp(t % 2.0, [0.0, 1.4, 1.7, 2.0], [0.0, 0.0, 1.0, 1.0]) + np.floor(t / 2.0)
    counts, rpm = np.round(4096 * q), 60.0 * np.gradient(q, t)
    found = slope_of(t, counts, rpm)
    assert found.share > 0.98
    assert found.scale == pytest.approx(60.0 / 4096, rel=1e-2)
    wrapped = slope_of(t, counts % 4096, rpm)
    assert wrapped.scale == pytest.approx(60.0 / 4096, rel=1e-2)


def test_the_stamps_of_a_serial_monitor_are_split_as_its_rows_are(tmp_path: Path) -> None:
    """Whatever the lines say that the sketch printed first."""
    t = strangers.STEP * np.arange(strangers.ROWS)
    stamped = [
        f"10:00:{1 + s:06.3f} -> {1000 * s:.0f},{100 * u:.3f},{1000 * q:.2f}"
        for s, u, q in zip(t, AXIS["u"], AXIS["q"], strict=True)
    ]
    lines = ["10:00:00.500 -> Motor test v3", "10:00:00.600 -> ms,pwm,enc", *stamped]
    strangers.text(tmp_path, "monitor.txt", lines)
    done("init", "monitor.txt", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.time, signals.time_unit, signals.u, signals.position) == ("ms", "ms", "pwm", "enc")


def test_of_channels_with_clocks_of_their_own_units_say_what_names_do_not(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    t, half = AXIS["t"], AXIS["t"][::2]
    made = asammdf.MDF(version="4.10")
    made.append([asammdf.Signal(AXIS["u"], t, unit="Nm", name="M_act")], acq_name="1 ms")
    turned = [(AXIS["q"][::2], "°", "p_act"), (AXIS["v"][::2], "°/s", "n_act")]
    made.append([asammdf.Signal(x, half, unit=unit, name=name) for x, unit, name in turned], acq_name="2 ms")
    made.save(tmp_path / "log.mf4", overwrite=True)
    made.close()
    done("init", "log.mf4", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u, signals.position, signals.velocity) == ("1 ms/M_act", "2 ms/p_act", "2 ms/n_act")


def test_the_units_of_a_preamble_hold_for_the_columns_below(tmp_path: Path) -> None:
    head = ["Separator\tTab", "Channels\t3", "Y_Unit_Label\tNm\tdeg\tdeg/s", "Delta_X\t2E-3\t2E-3\t2E-3", "***End***"]
    head += ["X_Value\tCouple\tAngle codeur\tVitesse\tComment"]
    deg = 180.0 / np.pi
    body = strangers.rows(AXIS, AXIS["t"], AXIS["u"], deg * AXIS["q"], deg * AXIS["v"], by="\t")
    strangers.text(tmp_path, "log.lvm", head + body)
    done("init", "log.lvm", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.u_unit, signals.position_unit, signals.velocity_unit) == ("N m", "deg", "deg/s")


def test_check_says_how_the_file_was_read(tmp_path: Path) -> None:
    strangers.twincat(tmp_path, AXIS)
    done("init", "scope.csv", cwd=tmp_path)
    assert "names the channels, the" in done("check", "scope.csv", cwd=tmp_path).stderr


def test_matrices_that_have_their_time_in_the_first_column(tmp_path: Path) -> None:
    """As Simulink's To Workspace writes them, in a file whose groups are their names."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, channel in (("rt_u", "u"), ("rt_q", "q"), ("rt_qd", "v")):
            file[name] = np.column_stack([AXIS["t"], AXIS[channel]])
    done("init", "log.h5", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    found = (signals.time, signals.u, signals.position, signals.velocity)
    assert found == ("rt_u/1", "rt_u/2", "rt_q/2", "rt_qd/2")


def test_a_velocity_beside_the_clock_of_a_file_is_no_slope_per_row(tmp_path: Path) -> None:
    """Per second it is that of the position, and has no factor."""
    writer = pytest.importorskip("mcap.writer")
    with (tmp_path / "log.mcap").open("wb") as file:
        made = writer.Writer(file)
        made.start()
        channel = made.register_channel("/motor", "json", made.register_schema("s", "jsonschema", b"{}"))
        for t, *row in zip(*(AXIS[one] for one in ("t", "q", "v", "u")), strict=True):
            stamp = 1_764_060_000_000_000_000 + round(1e9 * t)
            content = json.dumps(dict(zip(("q", "dq", "tau"), map(float, row), strict=True)))
            made.add_message(channel, stamp, content.encode(), stamp)
        made.finish()
    done("init", "log.mcap", cwd=tmp_path)
    config = load_config(tmp_path / "dsd.toml")
    assert (config.signals.position, config.signals.velocity) == ("motor/q", "motor/dq")
    assert config.signals.factors() == {}


def test_the_joint_that_moves_keeps_the_time_that_all_joints_share(tmp_path: Path) -> None:
    rest = np.zeros(strangers.ROWS)
    lists = {f"joint_{name}": np.column_stack([AXIS[one], rest]).tolist() for name, one in JOINTS.items()}
    pq.write_table(pa.table({"timestamp_us": np.round(1e6 * AXIS["t"]).astype(int), **lists}), tmp_path / "log.parquet")
    done("init", "log.parquet", cwd=tmp_path)
    signals = load_config(tmp_path / "dsd.toml").signals
    assert (signals.time, signals.time_unit) == ("timestamp_us", "us")
    assert (signals.u, signals.position) == ("joint_effort/1", "joint_position/1")


@pytest.mark.parametrize("stamp", ["%Y-%m-%d %H:%M:%S,{ms:03d}", "%Y-%m-%dT%H:%M:%S.{ms:03d}"])
def test_lines_of_a_logger_keep_the_fractions_of_their_stamps(stamp: str, tmp_path: Path) -> None:
    """Python's logging has a comma before them."""
    begin = datetime.datetime(2025, 11, 25, 10)
    lines = []
    for k, (u, q) in enumerate(zip(AXIS["u"], AXIS["q"], strict=True)):
        at = begin + datetime.timedelta(seconds=strangers.STEP * k)
        said = at.strftime(stamp).format(ms=at.microsecond // 1000)
        lines.append(f"{said} DEBUG axis: pos={q:.6f} torque={u:.5f}")
    strangers.text(tmp_path, "controller.log", lines)
    said = done("init", "controller.log", cwd=tmp_path).stderr
    assert f"sample time {strangers.STEP:g} s" in said


def step_response(folder: Path, levels: tuple[float, float], name: str) -> Path:
    """An open-loop step: a control input of two levels."""
    t = 0.01 * np.arange(300)
    u = np.where(t < 0.5, *levels)
    v = 20.0 * np.where(t < 0.5, 0.0, 1.0 - np.exp(-(t - 0.5) / 0.2))
    rows = "\n".join(f"{a:.2f},{b:g},{c:.4f}" for a, b, c in zip(t, u, v, strict=True))
    (folder / "step.csv").write_text(f"Tiempo (s),{name},Velocidad (rad/s)\n{rows}\n", encoding="utf-8")
    return folder / "step.csv"


@pytest.mark.parametrize("option", [("--u", "Mando"), ("--u", "2"), ("--set", "signals.u=Mando")])
def test_a_control_input_of_two_levels_is_taken_as_you_say(option: tuple[str, str], tmp_path: Path) -> None:
    """It was asked for, by the very command that had named it."""
    done("init", step_response(tmp_path, (0.0, 1.0), "Mando"), *option, "-o", "new.toml", cwd=tmp_path)
    assert load_config(tmp_path / "new.toml").signals.u == "Mando"


def test_two_levels_that_are_no_yes_or_no_are_a_step_by_their_name(tmp_path: Path) -> None:
    done("init", step_response(tmp_path, (0.0, 5.0), "Voltaje (V)"), "-o", "new.toml", cwd=tmp_path)
    assert load_config(tmp_path / "new.toml").signals.u == "Voltaje (V)"


def test_the_voltage_of_a_supply_is_no_control_input(tmp_path: Path) -> None:
    """A servo's `input_volts` of 11.4 to 12.8 V: nothing in the file moves the axis, and that is asked."""
    t = 0.01 * np.arange(300)
    rows = "\n".join(f"{a:.2f},{12.1 + 0.7 * math.sin(9.0 * a):.2f},{math.sin(3.0 * a):.4f}" for a in t)
    (tmp_path / "servo.csv").write_text(f"t,input_volts,position\n{rows}\n", encoding="utf-8")
    result = dsd("init", tmp_path / "servo.csv", cwd=tmp_path)
    assert result.returncode == 1
    assert "this log has no control input" in result.stderr


def test_the_unit_of_the_time_is_in_a_config_that_lacks_something_else(tmp_path: Path) -> None:
    t = np.arange(300)
    rows = "\n".join(f"{a},{math.sin(0.03 * a):.4f},{a % 2}" for a in t)
    (tmp_path / "ms.csv").write_text(f"Timestamp(ms),speed (rpm),flag\n{rows}\n", encoding="utf-8")
    assert dsd("init", tmp_path / "ms.csv", "-o", "new.toml", cwd=tmp_path).returncode == 1
    assert 'time_unit = "ms"' in (tmp_path / "new.toml").read_text(encoding="utf-8")


def test_the_command_that_answers_has_what_was_on_the_command_line(tmp_path: Path) -> None:
    """It wrote another file, in another unit, over what was there."""
    log, more = ambiguous(tmp_path), ("-o", "new.toml", "--set", "signals.position_unit=mm")
    asked = dsd("init", log, *more, cwd=tmp_path).stderr
    assert "--set signals.position_unit=mm" in asked
    assert "-o new.toml" in asked
