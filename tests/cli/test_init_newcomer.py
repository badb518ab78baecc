"""`dsd init` on what hobby boards and consoles write: spelt-out units of time, no control input, bursts of rows."""

import json
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.config import load_config
from tests.cli.rig import done, dsd
from tests.files import strangers

AXIS = strangers.axis()


def write(folder: Path, names: str, *columns: object) -> None:
    strangers.text(folder, "a.csv", [names, *strangers.rows(AXIS, *columns)])


@pytest.mark.parametrize(
    ("unit", "scale"),
    [("millisec", 1e-3), ("millisecond", 1e-3), ("milliseconds", 1e-3), ("secs", 1.0), ("microseconds", 1e-6)],
)
def test_a_unit_of_time_spelt_out_is_that_unit(unit: str, scale: float, tmp_path: Path) -> None:
    write(tmp_path, f"time ({unit}),torque,position (deg)", AXIS["t"] / scale, AXIS["u"], AXIS["q"])
    said = done("init", "a.csv", cwd=tmp_path).stderr
    assert "time_unit: not said" not in said
    assert load_config(tmp_path / "dsd.toml").signals.time_unit == {1e-3: "ms", 1.0: "s", 1e-6: "us"}[scale]


def test_the_unit_of_stamps_that_are_dates_of_our_days_is_no_guess(tmp_path: Path) -> None:
    columns = (np.round(1.7e12 + 1e3 * AXIS["t"]), AXIS["u"], AXIS["q"])
    rows = strangers.rows(AXIS, *columns, form="{:.15g}")
    strangers.text(tmp_path, "a.csv", ["stamp,torque,position (deg)", *rows])
    said = done("init", "a.csv", cwd=tmp_path).stderr
    assert 'time_unit: "ms", in which the first stamp is of 2023; if it is another: --set' in said
    assert "not said" not in said


def test_cells_that_say_sec_are_seconds_however_slow(tmp_path: Path) -> None:
    """Rows 0.5 s apart: of bare numbers they would be milliseconds."""
    rows = [f"{0.5 * k:g} sec,{u:.6g},{q:.6g}" for k, (u, q) in enumerate(zip(AXIS["u"], AXIS["q"], strict=True))]
    strangers.text(tmp_path, "a.csv", ["Time,torque,position (rad)", *rows])
    said = done("init", "a.csv", cwd=tmp_path).stderr
    assert 'time = "Time": by its name, in s' in said
    assert load_config(tmp_path / "dsd.toml").signals.time_unit == "s"


def test_a_log_without_a_control_input_is_told_so_and_its_config_has_the_unit_of_time(tmp_path: Path) -> None:
    write(tmp_path, "time,position (deg)", np.round(1e3 * AXIS["t"]), AXIS["q"])
    result = dsd("init", "a.csv", cwd=tmp_path)
    assert result.returncode == 1
    last = result.stderr.splitlines()[-1]
    assert "this log has no control input; dsd needs one" in last
    assert "--u" not in last
    assert 'time_unit = "ms"' in (tmp_path / "dsd.toml").read_text("utf-8")


def test_a_question_leaves_the_unit_of_time_in_the_config(tmp_path: Path) -> None:
    foo = np.arange(AXIS["t"].size) * 7919 % 101  # nothing that moves the axis
    write(tmp_path, "time,foo,position (deg)", np.round(1e3 * AXIS["t"]), foo, AXIS["q"])
    result = dsd("init", "a.csv", cwd=tmp_path)
    assert "--u NAME" in result.stderr.splitlines()[-1]
    assert 'time_unit = "ms"' in (tmp_path / "dsd.toml").read_text("utf-8")


def test_rows_that_come_in_bursts_are_as_far_apart_for_init_as_for_check(tmp_path: Path) -> None:
    """Of eight rows five are 2 ms after the one before, and one 3, 6 and 13 ms: 4 ms from row to row."""
    steps = np.random.default_rng(1).permuted(np.tile([2, 2, 2, 2, 2, 3, 6, 13], (100, 1)), axis=1)
    stamps = np.cumsum(steps)
    u, q = (np.interp(1e-3 * stamps, AXIS["t"], AXIS[name]) for name in "uq")
    write(tmp_path, "time (ms),torque,position (rad)", stamps, u, q)
    said = done("init", "a.csv", cwd=tmp_path).stderr
    assert "(irregular stamps)" in said
    step = float(said.partition("sample time ")[2].split()[0])
    assert step == pytest.approx(0.004, rel=1e-2)
    answer = json.loads(done("check", "a.csv", "--format", "json", cwd=tmp_path).stdout)["by_log"][0]
    assert answer["seconds"] / answer["samples"] == pytest.approx(step, rel=1e-3)


def test_a_u_of_the_other_sign_is_turned_by_init_and_said_first_by_diagnose(tmp_path: Path) -> None:
    """The key was printed as if done, but stood commented out; and diagnose named what no effect explains (90 %)."""
    write(tmp_path, "time (s),torque,position (rad)", AXIS["t"], -AXIS["u"], AXIS["q"])
    done("init", "a.csv", cwd=tmp_path)
    assert load_config(tmp_path / "dsd.toml").signals.u_sign == -1
    text = (tmp_path / "dsd.toml").read_text("utf-8")
    assert "# <- u has the other sign than the motion" in text
    assert done("check", "a.csv", cwd=tmp_path).stdout.startswith("a.csv: can answer")
    (tmp_path / "dsd.toml").write_text(text.replace("u_sign = -1 ", "# "), "utf-8")
    said = done("diagnose", "a.csv", cwd=tmp_path).stdout
    assert said.startswith("u has the other sign than the motion it causes: signals.u_sign = -1 (probability ")


@pytest.mark.parametrize("force", [True, False])
def test_a_rho_that_a_missing_force_makes_wide_is_said_to_be_so(force: bool, tmp_path: Path) -> None:
    """Straight from init, detect was "0.0 % confident" and "100.0 % within 2 rho", without a word why."""
    noise = np.random.default_rng(7).standard_normal(AXIS["t"].size)
    bare = AXIS["u"] - 3.0 * AXIS["v"] - np.tanh(AXIS["v"] / 0.01)
    u = AXIS["u"] if force else bare + 0.4 * bare.std() * noise
    write(tmp_path, "time (s),torque,velocity (rad/s)", AXIS["t"], u, AXIS["v"])
    said = next(line for line in done("init", "a.csv", cwd=tmp_path).stderr.splitlines() if line.startswith("  rho = "))
    assert ("[model] lacks a force" in said) == force
    wide = done("detect", "a.csv", "--set", "detector.rho=1000", "-o", "l.csv", cwd=tmp_path).stdout
    assert "no label is confident: within so wide a rho the candidates are alike. If the model lacks a force" in wide


def test_a_channel_that_rests_at_another_value_than_0_is_asked_for_its_zero(tmp_path: Path) -> None:
    """Of voltages about 1.65 V: "moves in one direction only", and then a friction that was none (64 %)."""
    rest = np.zeros(30)
    t = np.arange(AXIS["t"].size + 30) * (AXIS["t"][1] - AXIS["t"][0])
    u, v = (np.concatenate([rest, AXIS[one]]) for one in ("u", "v"))
    write(tmp_path, "time (s),torque,velocity (rad/s)", t, u, 1.65 + v / (3.0 * np.abs(v).max()))
    asked = "velocity never comes to 0, begins at 1.65 and goes to both sides of it"
    assert asked in done("init", "a.csv", cwd=tmp_path).stderr
    assert asked in done("check", "a.csv", cwd=tmp_path).stdout
    write(tmp_path, "time (s),torque,velocity (rad/s)", t, u, v)
    assert "never comes to 0" not in done("check", "a.csv", cwd=tmp_path).stdout


def test_tables_that_no_terminal_shows_end_without_blanks(tmp_path: Path) -> None:
    write(tmp_path, "time (s),torque,velocity (rad/s)", AXIS["t"], AXIS["u"], AXIS["v"])
    done("init", "a.csv", cwd=tmp_path)
    for command in ("check", "detect", "diagnose"):
        assert [line for line in done(command, "a.csv", cwd=tmp_path).stdout.splitlines() if line.endswith(" ")] == []


def test_a_value_of_u_that_stands_alone_is_said_by_check(tmp_path: Path) -> None:
    u = AXIS["u"].copy()
    u[700] = 1e3
    write(tmp_path, "time (s),torque,velocity (rad/s)", AXIS["t"], u, AXIS["v"])
    done("init", "a.csv", cwd=tmp_path)
    said = done("check", "a.csv", cwd=tmp_path).stdout
    assert "1 value(s) of u stand alone, up to 1000, first in sample 700" in said
    assert "signals.u_range" in said
    assert "stand alone" not in done("check", "a.csv", "--set", "signals.u_range=[-100, 100]", cwd=tmp_path).stdout
