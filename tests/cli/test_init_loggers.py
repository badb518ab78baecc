"""`dsd init` on what loggers and recorders write: each of these was a dead end, or taken for another."""

import datetime
import json
import sqlite3
from contextlib import closing
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from dsd_cli.errors import DataError
from dsd_cli.files.sample import sample
from dsd_cli.files.tables_in import open_table
from tests.cli.test_init_walked import chosen, proposed, roles
from tests.files import strangers

AXIS = strangers.axis()


def test_what_warms_up_evenly_is_no_clock(tmp_path: Path) -> None:
    """Stamps jitter, a temperature that a driver filters rises evenly: it was the time, and J 400 times too small."""
    t = AXIS["t"] + np.random.default_rng(830201).normal(0.0, 2e-5, AXIS["t"].size)
    rows = zip(t, AXIS["q"], AXIS["v"], AXIS["u"], 41.0 + 0.01 * AXIS["t"], strict=True)
    said = [{"m": {"pos": q, "vel": v, "torque": u, "temp_c": warm}, "when": int(1e9 * s)} for s, q, v, u, warm in rows]
    path = strangers.text(tmp_path, "log.jsonl", [json.dumps(one) for one in said])
    assert roles(chosen(path))["time"] == "when"


def test_stamps_called_ts_are_the_time(tmp_path: Path) -> None:
    rows = strangers.rows(AXIS, AXIS["q"], AXIS["u"], 7.0 + AXIS["t"], 1e3 * AXIS["t"])
    path = strangers.text(tmp_path, "log.csv", ["pos,torque,odometer,ts", *rows])
    assert roles(chosen(path))["time"] == "ts"


@pytest.mark.parametrize("unit", ["", np.zeros((0, 0))])
def test_a_recorder_with_a_channel_without_a_unit(unit: object, tmp_path: Path) -> None:
    """The library makes an array of an empty text, which has no truth value."""

    def channel(name: str, x: np.ndarray, said: object) -> dict[str, object]:
        return {"Name": name, "Unit": said, "Data": x.reshape(1, -1), "XIndex": 1.0}

    stamps = np.array([channel("Time", AXIS["t"], "s")], dtype=object)
    signals = np.array([channel("tau", AXIS["u"], "Nm"), channel("phi", AXIS["q"], unit)], dtype=object)
    savemat(tmp_path / "rec.mat", {"rec": {"X": stamps, "Y": signals}})
    assert roles(chosen(tmp_path / "rec.mat")) == {"time": "rec/time", "u": "rec/tau", "position": "rec/phi"}


def _scope(folder: Path, *, cut: int = 0) -> Path:
    """Channels of 2 and 4 ms beside each other, each group with its stamps, as a PLC's scope exports them; `cut`: of
    that row one cell is lost."""
    ms, rows = 1e3 * AXIS["t"], AXIS["t"].size
    slow = [f"\t{strangers.german(2 * x)}\t{strangers.german(40 + 1e-4 * x)}" for x in ms[: rows // 2]]
    fast = ["\t".join(map(strangers.german, row)) for row in zip(ms, AXIS["q"], AXIS["u"], strict=True)]
    lines = [one + (slow[at] if at < len(slow) else "") for at, one in enumerate(fast)]
    lines = [one.rpartition("\t")[0] if at == cut > 0 else one for at, one in enumerate(lines)]
    head = ["Name\tScope", "", "Name\tActPos\tActTorque\tName\tTemp", "Unit\trad\tNm\tUnit\tC", ""]
    return strangers.text(folder, "scope.csv", [*head, *lines], "\r\n")


def test_channels_of_a_slower_task_end_before_the_others(tmp_path: Path) -> None:
    """3 of 5 fields from row 1501 on was an error in a file that is whole."""
    path = _scope(tmp_path)
    (table,) = sample(str(path)).tables
    values = {one.name: one.values for one in table.channels}
    assert values["ActTorque"] == pytest.approx(AXIS["u"], abs=1e-6)
    assert np.isfinite(values["Temp"]).sum() == AXIS["t"].size // 2
    log = open_table(str(path), {"u": "ActTorque", "position": "ActPos"})
    read = list(log.batches())
    assert np.concatenate([batch.columns["position"] for batch in read]) == pytest.approx(AXIS["q"], abs=1e-6)
    assert "columns end before the others: 4 to 5 in line 1505" in log.warnings


def test_a_cell_that_is_no_number_is_said_where_columns_end_early(tmp_path: Path) -> None:
    """The text with the cells that lack was made again for the same cell, a thousand times."""
    path = _scope(tmp_path)
    lines = path.read_bytes().split(b"\r\n")
    lines[700] = lines[700].replace(b",", b"\x08y,", 1)
    path.write_bytes(b"\r\n".join(lines))
    log = open_table(str(path), {"t": "time", "u": "ActTorque"})
    with pytest.raises(DataError, match="line 701"):
        list(log.batches())


def test_the_header_is_found_above_the_rows_of_all_groups(tmp_path: Path) -> None:
    """What a task of 20 ms wrote ends so early that its rows were a preamble: no names, and the clock of another."""
    lines = _scope(tmp_path).read_text("utf-8").splitlines()
    lines = [line.replace(",", ".").replace("\t", ",") for line in lines]
    head = {2: ",Name,State", 3: ",Unit,"}
    lines = [line + head.get(at, f",{20 * (at - 5)},3" if 5 <= at < 305 else "") for at, line in enumerate(lines)]
    path = strangers.text(tmp_path, "scope.csv", lines)
    (table,) = sample(str(path)).tables
    values = {one.name: one.values for one in table.channels}
    assert values["ActTorque"] == pytest.approx(AXIS["u"], abs=1e-6)
    assert roles(chosen(path)) == {"time": "time", "position": "ActPos", "u": "ActTorque"}
    said = open_table(str(path), {"u": "ActTorque"})
    assert sum(batch.rows for batch in said.batches()) == AXIS["t"].size
    assert "columns end before the others: 6 to 7 in line 305, 4 to 5 in line 1505" in said.warnings


@pytest.mark.parametrize("cut", [700, 2000])
def test_a_row_that_lost_a_cell_is_none_of_them(cut: int, tmp_path: Path) -> None:
    path = _scope(tmp_path, cut=cut)
    with pytest.raises(Exception, match="fields where the header has 5"):
        list(open_table(str(path), {"u": "ActTorque"}).batches())


NAMES = ["q", "dq", "tau"]


@pytest.mark.parametrize("kind", ["npz", "cells", "letters", "json"])
def test_a_list_beside_a_matrix_names_its_columns(kind: str, tmp_path: Path) -> None:
    """Which column is u was asked though the file says it."""
    data = np.column_stack([AXIS["q"], AXIS["v"], AXIS["u"]])
    path = tmp_path / ("run.npz" if kind == "npz" else "run.mat")
    if kind == "json":  # orient="split" of pandas
        path = tmp_path / "run.json"
        path.write_text(
            json.dumps({"columns": NAMES, "index": list(range(len(data))), "data": data.tolist(), "dt": 2e-3})
        )
    elif kind == "npz":
        np.savez(path, data=data.T, channels=np.array(NAMES), fs=500.0)
    else:
        savemat(path, {"data": data, "names": np.array(NAMES, dtype=object if kind == "cells" else "U"), "Ts": 2e-3})
    assert roles(chosen(path)) == {"position": "data/q", "velocity": "data/dq", "u": "data/tau"}


def test_units_in_brackets_of_such_names_are_those_of_the_columns(tmp_path: Path) -> None:
    """The slash of rad/s is none of a path; without the unit an angle in degrees is taken as one in rad."""
    names = ["joint angle (deg)", "joint speed (deg/s)", "motor torque (Nm)"]
    data = np.column_stack([np.degrees(AXIS["q"]), np.degrees(AXIS["v"]), AXIS["u"]])
    savemat(tmp_path / "run.mat", {"log": {"X": data, "labels": np.array(names, dtype=object), "Ts": 2e-3}})
    found = chosen(tmp_path / "run.mat").found
    assert {role: (one.column, one.unit) for role, one in found.items()} == {
        "position": ("log/X/joint angle", "deg"),
        "velocity": ("log/X/joint speed", "deg/s"),
        "u": ("log/X/motor torque", "Nm"),
    }


@pytest.mark.parametrize("names", [["q", "q", "tau"], ["q", "tau"], ["a/q", "dq", "tau"]])
def test_a_list_that_does_not_name_all_columns_names_none(names: list[str], tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    np.savez(path, data=np.column_stack([AXIS["q"], AXIS["v"], AXIS["u"]]), channels=np.array(names))
    (table,) = sample(str(path)).tables
    assert [one.name for one in table.channels] == ["data/1", "data/2", "data/3"]


def _database(path: Path, stamps: list[object]) -> Path:
    with closing(sqlite3.connect(path)) as base, base:
        base.execute("CREATE TABLE rig (name TEXT, mass REAL)")
        base.execute("INSERT INTO rig VALUES ('x', 2.0)")
        base.execute('CREATE TABLE "run 1" (id INTEGER PRIMARY KEY, at, pos_mm REAL, force_N REAL, state TEXT)')
        rows = zip(stamps, 1e3 * AXIS["q"], AXIS["u"], strict=True)
        base.executemany(
            "INSERT INTO \"run 1\" (at, pos_mm, force_N, state) VALUES (?, ?, ?, 'RUN')",
            [(one, float(q), float(u) if k else None) for k, (one, q, u) in enumerate(rows)],
        )
    return path


@pytest.mark.parametrize("words", [False, True])
def test_a_database_is_a_log(words: bool, tmp_path: Path) -> None:
    """It was refused: which table to write as CSV, and how, was left to the user."""
    begin = datetime.datetime(2024, 3, 1, 10)
    dates = [str(begin + datetime.timedelta(milliseconds=round(1e3 * t))) for t in AXIS["t"]]
    path = _database(tmp_path / "log.sqlite", dates if words else [float(t) for t in AXIS["t"]])
    tables = {one.channels[0].name.partition("/")[0]: one for one in sample(str(path)).tables}
    values = {one.name: one.values for one in tables["run 1"].channels}
    assert values.keys() == {f"run 1/{name}" for name in ("id", "at", "pos_mm", "force_N")}
    assert values["run 1/at"] - values["run 1/at"][0] == pytest.approx(AXIS["t"], abs=1e-3)
    assert np.isnan(values["run 1/force_N"][0])
    assert values["run 1/force_N"][1:] == pytest.approx(AXIS["u"][1:])
    found = roles(chosen(path))
    assert (found["u"], found["position"], found["time"]) == ("run 1/force_N", "run 1/pos_mm", "run 1/at")


def test_rows_that_a_logger_has_only_in_its_write_ahead_log_are_read(tmp_path: Path) -> None:
    """Of one that still ran 4,000 of 16,000 were; numbers in columns of TEXT were no channel, a bad note an error."""
    path = tmp_path / "run.sqlite"
    with closing(sqlite3.connect(path)) as base:
        base.execute("PRAGMA journal_mode=wal")
        base.execute("CREATE TABLE log (t REAL, u TEXT, position REAL, note TEXT)")
        base.execute("PRAGMA wal_checkpoint(truncate)")
        rows = zip(AXIS["t"], map(repr, AXIS["u"].tolist()), AXIS["q"], strict=True)
        base.executemany("INSERT INTO log VALUES (?, ?, ?, CAST(x'ff41' AS TEXT))", rows)
        base.commit()
        (table,) = sample(str(path)).tables
    values = {one.name: one.values for one in table.channels}
    assert values.keys() == {"log/t", "log/u", "log/position"}
    assert values["log/u"] == pytest.approx(AXIS["u"])


@pytest.mark.parametrize("told", ["", "data/demo_2/cmd_torque/3"])
def test_of_several_trials_with_several_joints_the_joint_is_none_of_the_trial(
    told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """demo_2 was taken for joint 2, which rests; and its place was one of its hand."""
    rest = np.random.default_rng(830202).normal(0.0, 1e-6, (3, AXIS["t"].size, 4))
    with h5py.File(tmp_path / "demos.hdf5", "w") as file:
        for at in range(3):
            rows = AXIS["t"].size - 50 * at
            for path, x, still in zip(("obs/qpos", "obs/qvel", "cmd_torque"), "qvu", rest, strict=True):
                joints = still.copy()
                joints[:, 2] = AXIS[x]
                file[f"data/demo_{at}/{path}"] = joints[:rows]
            file[f"data/demo_{at}/t"] = AXIS["t"][:rows]
            file[f"data/demo_{at}/obs/eef_pos"] = 0.4 + rest[0, :rows, :3]
    monkeypatch.chdir(tmp_path)
    found = chosen(tmp_path / "demos.hdf5", **({"u": told} if told else {}))
    trial = "data/demo_2" if told else "data/demo_0"
    said = {"time": "t", "u": "cmd_torque/3", "velocity": "obs/qvel/3", "position": "obs/qpos/3"}
    assert roles(found) == {role: f"{trial}/{name}" for role, name in said.items()}
    assert any(line.startswith(f"{trial} of 3 trials: ") for line in found.said)


def test_groups_of_motors_are_no_trials(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with h5py.File(tmp_path / "axes.hdf5", "w") as file:
        for at, gain in enumerate((1e-6, 1.0)):
            for name in "tquv":
                file[f"motor_{at}/{name}"] = AXIS[name] * (gain if name != "t" else 1.0)
    monkeypatch.chdir(tmp_path)
    assert roles(chosen(tmp_path / "axes.hdf5"))["u"] == "motor_1/u"


@pytest.mark.parametrize(
    ("names", "unit"),
    [
        ("t_s,torque_Nm,angle_deg", "in kg m^2"),
        ("t_s,voltage_V,angle_deg", "in V/(rad/s^2)"),
        ("t,tau,q", "per unit of u"),
    ],
)
def test_the_inertia_has_the_unit_that_the_log_says(names: str, unit: str, tmp_path: Path) -> None:
    """That of a torque in N m over an angle was "per unit of u", as of a drive whose gain is not known."""
    rows = strangers.rows(AXIS, AXIS["t"], AXIS["u"], np.degrees(AXIS["q"]))
    said = proposed(strangers.text(tmp_path, "log.csv", [names, *rows])).said
    (line,) = [line for line in said if "nominal_inertia" in line]
    assert line.endswith(f", {unit}"), line


def test_two_channels_that_the_user_names_are_no_choice_of_a_joint(tmp_path: Path) -> None:
    """The channels of an oscilloscope were "joint 1 and 2 of 2: as you say"."""
    rows = strangers.rows(AXIS, AXIS["t"], AXIS["u"], AXIS["q"])
    path = strangers.text(tmp_path, "scope.csv", ["time,CH1,CH2", *rows])
    said = chosen(path, u="CH1", position="CH2")
    assert roles(said) == {"time": "time", "u": "CH1", "position": "CH2"}
    assert not any("joint" in line for line in said.said)
