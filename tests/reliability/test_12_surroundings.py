"""A disk that fills up half way, a terminal of no width, folders that cannot be written, a log whose end was lost."""

import os
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from dsd_cli.roles.control_input import cause_of
from tests.cli.rig import CONFIG, DSD, done, dsd, make_log, refused, write

MODEL = "\n[model]\ninertia = 1.0\ndelay = 0.005\n"


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "dsd.toml").write_text(CONFIG + MODEL)
    write(tmp_path, "log.csv", make_log(300, seed=1))
    return tmp_path


def with_room_for_a_kilobyte(line: str, cwd: Path, unbuffered: str) -> subprocess.CompletedProcess:
    """`dsd` in the line is the command; no file grows beyond 1024 bytes."""
    line = line.replace("dsd ", shlex.join(map(str, DSD)) + " ", 1)
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    command = ["bash", "-c", f"ulimit -f 1; {line}"]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, check=False, env=environment)


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize(
    "command", ["effects", "compare log.csv --format json", "detect log.csv --format jsonl --quiet"]
)
def test_a_disk_that_fills_up_behind_stdout_is_one_line(rig, command, unbuffered):
    """Without a buffer Python drops what one write does not take: half a JSON and exit code 0."""
    refused(with_room_for_a_kilobyte(f"dsd {command} > out", rig, unbuffered), 1, "File too large")
    assert (rig / "out").stat().st_size <= 1024


def test_a_full_disk_behind_both_streams_is_an_exit_code(rig):
    result = with_room_for_a_kilobyte("dsd effects > out 2>> out", rig, "")
    assert (result.returncode, result.stderr) == (1, "")
    assert "Traceback" not in (rig / "out").read_text()


@pytest.mark.parametrize("columns", ["0", "1"])
def test_a_table_on_a_terminal_of_no_width_has_its_numbers(rig, columns):
    text = done("detect", "log.csv", cwd=rig, COLUMNS=columns).stdout
    assert "inertia" in text
    assert "0.005" in text
    assert "log.csv" in done("check", "log.csv", cwd=rig, COLUMNS=columns).stdout


def test_a_picture_where_no_folder_can_be_written(rig):
    nowhere = {"HOME": "/nonexistent", "XDG_CACHE_HOME": "/proc", "XDG_CONFIG_HOME": "/proc"}
    result = done("compare", "log.csv", "--plot", "p.png", "--format", "json", cwd=rig, **nowhere)
    assert result.stderr in ("", "p.png: drawn\n")
    assert (rig / "p.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("rows", [300, 3000])
def test_the_zeros_that_a_power_cut_leaves_are_called_so(rig, rows):
    path = write(rig, "cut.csv", make_log(rows, seed=1))
    with open(path, "ab") as file:
        file.write(bytes(4096))
    refused(dsd("detect", "cut.csv", cwd=rig), 1, f"cut.csv, line {rows + 2}", "zero bytes", "power cut")


def test_a_table_without_columns_has_none(rig):
    pq.write_table(pa.table({}), rig / "none.parquet")
    for command in ("detect", "init", "columns"):
        refused(dsd(command, "none.parquet", cwd=rig), 1, "none.parquet: has no columns")


def test_a_config_cannot_be_proposed_from_an_empty_stdin(rig):
    for command in ("init", "columns"):
        refused(dsd(command, "-", cwd=rig, stdin=""), 1, "dsd: error: <stdin>: is empty")
        refused(dsd(command, "-", cwd=rig, stdin="a,b\n"), 1, "dsd: error: <stdin>: has a header but no rows")


def test_what_init_found_stands_before_its_question_and_nowhere_else(rig):
    """A question that can be answered needs what was found; where nothing can be, one line is all that is said."""
    (rig / "dsd.toml").unlink()
    result = dsd("init", "-", cwd=rig, stdin="t,u,a\n" + "".join(f"{k}e-3,{k % 7},3\n" for k in range(50)))
    assert (result.returncode, result.stdout) == (1, "")
    *found, question = result.stderr.splitlines()
    assert found == ['  time = "t": by its name', '  u = "u": by its name']
    assert question.startswith("dsd: error: <stdin>: which column is the motion?")
    assert question.endswith("say it: dsd init - --force --u u --position NAME")
    assert "/tmp" not in (rig / "dsd.toml").read_text()


@pytest.mark.parametrize("stamp", ["0000-13-45T25:00:00", "2016-12-31T23:59:60.000"])
def test_a_time_that_is_none_is_named(rig, stamp):
    (rig / "times.csv").write_text("t,u,d_hat\n" + "".join(f"{stamp},{k},0\n" for k in range(40)))
    refused(dsd("detect", "times.csv", cwd=rig), 1, f'times.csv, line 2, column "t": "{stamp}" is not a number')


@pytest.mark.parametrize("name", ["out.csv", "out.parquet"])
def test_a_file_for_which_there_is_no_room_leaves_nothing(rig, name):
    result = with_room_for_a_kilobyte(f"dsd detect log.csv -o {name} --quiet", rig, "")
    refused(result, 1, f"{name}: cannot be written (File too large)")
    assert sorted(path.name for path in rig.iterdir()) == ["dsd.toml", "log.csv"]


def test_a_fleet_without_a_command_is_one_line(rig):
    refused(dsd("fleet", cwd=rig), 2, "Missing command", "dsd fleet --help")


@pytest.mark.parametrize(("spoiled", "size"), [(1, 4.9e307), (2, 1e200)])
@pytest.mark.parametrize("command", ["columns log.csv", "init log.csv -o -", "check log.csv -c axis.toml"])
@pytest.mark.parametrize("names", ["t,velocity,u", "a,b,c"])
def test_numbers_of_which_a_spoiled_file_is_full_have_no_powers(tmp_path, names, command, spoiled, size):
    t = np.arange(3000) * 0.002
    columns = np.column_stack([t, np.sin(7.0 * t), np.cos(7.0 * t)])
    columns[1500, spoiled] = size
    np.savetxt(tmp_path / "log.csv", columns, "%.17g", ",", header=names, comments="")
    (tmp_path / "axis.toml").write_text(
        f'[signals]\ntime = "{names[0]}"\nu = "{names[-1]}"\nvelocity = "{names[2:-2]}"\n\n[model]\ninertia = 0.1\n'
    )
    result = dsd(*command.split(), cwd=tmp_path)
    assert result.returncode in (0, 1), result.stderr
    assert "unexpected" not in result.stderr


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_a_channel_with_one_number_beyond_all_others_is_nobodys_cause(kind):
    t = np.arange(3000) * 0.002
    clean, spoiled = np.sin(7.0 * t), np.where(t == t[1500], 4.9e307, np.sin(7.0 * t))
    for motion, u in ((clean, spoiled), (spoiled, clean)):
        assert cause_of(0.002, motion, kind, u).share == 0.0
