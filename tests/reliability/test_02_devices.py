"""An output that is a device or a FIFO is written into, never replaced; an input is never written over."""

import os
import shutil
import stat
import subprocess
from pathlib import Path

import pytest

from tests.cli.rig import CONFIG, DSD, done, dsd, make_log, refused, write

SAMPLES = Path(__file__).parents[2] / "sample_logs"


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "dsd.toml").write_text(CONFIG + "\n[model]\ninertia = 1.0\ndelay = 0.005\n")
    write(tmp_path, "log.csv", make_log(600))
    return tmp_path


def fed(fifo: Path, *arguments: object, cwd: Path) -> tuple[subprocess.CompletedProcess, bytes]:
    """What the command says, and what came out of the FIFO."""
    os.mkfifo(fifo)
    reader = subprocess.Popen(["cat", str(fifo)], stdout=subprocess.PIPE)
    result = dsd(*arguments, cwd=cwd)
    return result, reader.communicate(timeout=300)[0]


def test_labels_into_a_fifo(rig):
    done("detect", "log.csv", "-o", "labels.csv", cwd=rig)
    result, got = fed(rig / "fifo.csv", "detect", "log.csv", "-o", "fifo.csv", cwd=rig)
    assert result.returncode == 0
    assert got == (rig / "labels.csv").read_bytes()
    assert stat.S_ISFIFO((rig / "fifo.csv").stat().st_mode)


def test_parquet_cannot_go_into_a_fifo(rig):
    os.mkfifo(rig / "fifo.parquet")
    refused(dsd("detect", "log.csv", "-o", "fifo.parquet", cwd=rig), 2, "FIFO", ".csv")


@pytest.mark.parametrize("command", ["detect", "observe"])
def test_a_fifo_in_the_place_of_the_metadata_stays_one(rig, command):
    beside = rig / "labels.csv.meta.json"
    os.mkfifo(beside)
    refused(dsd(command, "log.csv", "-o", "labels.csv", cwd=rig), 2, "labels.csv.meta.json: is no file")
    assert stat.S_ISFIFO(beside.stat().st_mode)


@pytest.mark.parametrize("name", ["dev.csv", "dev.toml", "dev.png"])
def test_a_device_stays_one(rig, name):
    """The link has a name that the commands take; in its place a file would be found if the device were replaced."""
    (rig / name).symlink_to("/dev/null")
    before = os.stat("/dev/null")
    commands = {
        "dev.csv": ("detect", "log.csv", "-o", name),
        "dev.toml": ("init", "-o", name),
        "dev.png": ("compare", "log.csv", "--plot", name),
    }
    done(*commands[name], cwd=rig)
    after = os.stat("/dev/null")
    assert stat.S_ISCHR(after.st_mode)
    assert (after.st_ino, after.st_rdev) == (before.st_ino, before.st_rdev)
    assert (rig / name).is_symlink()


def test_a_device_that_is_full_is_one_line(rig):
    (rig / "full.csv").symlink_to("/dev/full")
    refused(dsd("detect", "log.csv", "-o", "full.csv", cwd=rig), 1, "full.csv", "cannot be written")


def test_no_output_over_an_input(tmp_path):
    """Reference, transition, effect file, sidecar, the log: each under its name and through a link."""
    for name in ("servo-friction.csv", "servo-friction.csv.meta.json", "servo-friction.toml", "my_effect.py"):
        shutil.copy(SAMPLES / name, tmp_path)
    shutil.copy(tmp_path / "servo-friction.csv", tmp_path / "ref.csv")
    (tmp_path / "A.csv").write_text("\n".join([",".join(["0.1"] * 9)] * 9).replace("0.1", str(1 / 9)) + "\n")
    (tmp_path / "link.csv").symlink_to("ref.csv")
    shutil.copy(tmp_path / "my_effect.py", tmp_path / "my.png")
    config = ("-c", "servo-friction.toml")
    column = "--set", 'simulate.reference={kind="column", file="ref.csv", column="reference"}'
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    for arguments in (
        ("simulate", *config, *column, "-o", "ref.csv"),
        ("simulate", *config, *column, "-o", "link.csv"),
        ("detect", "servo-friction.csv", *config, "--set", 'detector.transition={file="A.csv"}', "-o", "A.csv"),
        ("detect", "servo-friction.csv", *config, "-o", "servo-friction.csv"),
        ("add", "servo-friction.csv", "gravity", *config, "-o", "my_effect.py", "--effects-from", "my_effect.py"),
        ("improve", "servo-friction.csv", "--auto", *config, "-o", "servo-friction.csv"),
        ("add", "servo-friction.csv", "gravity", *config, "-o", "servo-friction.csv.meta.json"),
        ("improve", "servo-friction.csv", "--auto", *config, "-o", "servo-friction.csv.meta.json"),
        ("improve", "servo-friction.csv", "--auto", *config, "-o", "new.png", "--plot", "new.png"),
        ("diagnose", "servo-friction.csv", *config, "--effects-from", "my.png", "--plot", "my.png"),
    ):
        refused(dsd(*arguments, cwd=tmp_path), 2, "is the input")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_stream_is_a_log(rig):
    """<(command), a FIFO and /dev/stdin give what the file gives."""
    done("detect", "log.csv", "-o", "labels.csv", cwd=rig)
    expected = (rig / "labels.csv").read_bytes()
    run = " ".join([*DSD, "detect", "{}", "-o", "out.csv", "--quiet"])
    os.mkfifo(rig / "fifo")
    for script in (
        run.format("<(cat log.csv)"),
        f"cat log.csv > fifo & {run.format('fifo')}; wait",
        f"cat log.csv | {run.format('/dev/stdin')}",
        f"{run.format('/dev/stdin')} < log.csv",
    ):
        (rig / "out.csv").unlink(missing_ok=True)
        subprocess.run(["bash", "-c", script], cwd=rig, check=True, capture_output=True, timeout=300)
        assert (rig / "out.csv").read_bytes() == expected, script


def test_closed_streams_mix_nothing(rig):
    run = " ".join([*DSD, "detect", "log.csv"])
    done("detect", "log.csv", "-o", "labels.csv", cwd=rig)
    expected = (rig / "labels.csv").read_text()
    for script, out in ((f"{run} --format csv 2>&-", expected), (f"{run} -o out.csv >&-", ""),
                        (f"{run} -o out.csv >&- 2>&- <&-", ""), (f"{run} --format csv <&-", expected)):  # fmt: skip
        (rig / "out.csv").unlink(missing_ok=True)
        result = subprocess.run(
            ["bash", "-c", script], cwd=rig, capture_output=True, text=True, timeout=300, check=True
        )
        assert result.stdout == out, script
        assert "Traceback" not in result.stderr
        if "out.csv" in script:
            assert (rig / "out.csv").read_text() == expected
    failed = subprocess.run(["bash", "-c", f"{run} -c none.toml 2>&-"], cwd=rig, capture_output=True, timeout=300)
    assert (failed.returncode, failed.stdout) == (2, b"")
