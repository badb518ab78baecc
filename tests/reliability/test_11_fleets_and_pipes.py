"""Fleets, tuning and pipes in places where they were not expected."""

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
    return subprocess.run(["bash", "-c", line], cwd=cwd, capture_output=True, text=True, timeout=120, check=False)


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
