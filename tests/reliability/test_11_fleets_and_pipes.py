"""Fleets, tuning and pipes in places where they were not expected."""

import csv
import os
import shlex
import subprocess
from pathlib import Path

import pytest

from tests.cli.rig import CONFIG, DSD, make_log, refused, write

MODEL = "\n[model]\ninertia = 1.0\ndelay = 0.005\n"


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "dsd.toml").write_text(CONFIG + MODEL)
    (tmp_path / "logs").mkdir()
    for k in range(3):
        write(tmp_path / "logs", f"{k}.csv", make_log(300, seed=k))
    return tmp_path


def shell(line: str, cwd: Path) -> subprocess.CompletedProcess:
    """`dsd` in the line is the command; in 3 GB."""
    line = line.replace("dsd ", shlex.join(map(str, DSD)) + " ", 1)
    line = f"ulimit -v 3000000; ulimit -t 60; {line}"
    return subprocess.run(["bash", "-c", line], cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


def test_a_config_without_end_is_no_config(rig):
    refused(shell("dsd compare logs/0.csv -c /dev/zero", rig), 2, "/dev/zero: is no config")


def test_a_config_out_of_a_pipe_is_read_once(rig):
    done = shell("dsd detect logs/0.csv -o out.csv -c <(cat dsd.toml)", rig)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "command",
    [
        "fleet detect logs/0.csv -o out.parquet",
        "tune logs/0.csv -o new.toml",
        "add logs/0.csv coulomb_friction -o new.toml",
    ],
)
def test_a_config_that_is_read_twice_is_a_file(rig, command):
    """The second time nothing is left in a pipe: that was a config without a single key."""
    refused(shell(f"dsd {command} -c <(cat dsd.toml)", rig), 2, "save it as a file")
    assert sorted(path.name for path in rig.iterdir()) == ["dsd.toml", "logs"]


def test_a_full_disk_behind_stdout_is_one_line(rig):
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full")
    for command in ("effects", "check logs/0.csv", "compare logs/0.csv"):
        refused(shell(f"dsd {command} > /dev/full", rig), 1, "No space left")


def test_a_fifo_among_the_logs_of_a_fleet_is_a_row_with_the_reason(rig):
    """Nobody writes into it; a fleet does not wait. Named, found by a pattern, or out of the shell."""
    os.mkfifo(rig / "logs" / "fifo.csv")
    done = shell("dsd fleet detect 'logs/*.csv' <(cat logs/0.csv) /dev/stdin -o out.csv < logs/1.csv", rig)
    assert done.returncode == 0, done.stderr
    with open(rig / "out.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    failed = {row["log"]: row["reason"] for row in rows if row["status"] == "failed"}
    assert len(rows) == 6
    assert len(failed) == 3
    assert failed.keys() >= {"logs/fifo.csv", "/dev/stdin"}
    for log, reason in failed.items():
        assert reason == f"{log}: is a FIFO or a device, which a fleet does not wait for: save it as a file"


@pytest.mark.parametrize(
    ("command", "code", "text"),
    [
        ("fleet summary fifo.csv", 1, "fifo.csv: is no file"),
        ("fleet detect --list fifo.csv", 2, "fifo.csv: is a FIFO or a device"),
        ("fleet detect logs/0.csv -o fifo.csv", 2, "results go into a file of their own"),
    ],
)
def test_no_table_of_a_fleet_is_a_fifo(rig, command, code, text):
    os.mkfifo(rig / "fifo.csv")
    refused(shell(f"dsd {command}", rig), code, text)


def test_the_list_of_a_fleet_may_come_out_of_a_pipe(rig):
    done = shell("dsd fleet detect --list <(ls -d $PWD/logs/*) -o out.csv", rig)
    assert done.returncode == 0, done.stderr
    assert len((rig / "out.csv").read_text().splitlines()) == 4
