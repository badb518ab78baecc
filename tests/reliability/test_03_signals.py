"""A signal at any time leaves no temporary file, no half of one and no crash; a few tries of `bench fuzz`."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bench import fuzz_kills
from tests.cli.rig import CONFIG, DSD, interruptible, make_log, write


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    here = tmp_path_factory.mktemp("kills")
    fuzz_kills.prepare(here)
    return here


@pytest.mark.parametrize("name", ["labels.csv", "labels.parquet"])
@pytest.mark.parametrize("number", fuzz_kills.ANSWERED, ids=lambda n: signal.Signals(n).name)
def test_while_it_writes(folder, name, number):
    for after in (-0.0005, -0.02):
        assert fuzz_kills.kill(folder, name, number, after).finding == ""


def test_what_a_killed_run_left_the_next_one_removes(folder):
    found = fuzz_kills.kill(folder, "labels.csv", signal.SIGKILL, -0.001)
    assert found.code == -signal.SIGKILL
    assert any(path.name.endswith(".tmp") for path in (folder / "out").iterdir())
    assert fuzz_kills.cleaned(folder, "labels.csv", found).finding == ""


def test_a_few_of_a_thousand():
    """`python -m bench kills --runs 1000`, the first five."""
    command = [sys.executable, "-m", "bench", "kills", "--runs", "5"]
    result = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "5 kills, exit codes" in result.stdout


def test_what_a_running_one_writes_is_left_alone(tmp_path):
    import fcntl

    (tmp_path / "dsd.toml").write_text(CONFIG)
    write(tmp_path, "log.csv", make_log())
    for name in (".labels.csv.123.tmp", ".labels.csv.124.tmp", ".labels.csv.x.tmp"):
        (tmp_path / name).write_text("t")
    with open(tmp_path / ".labels.csv.123.tmp") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        subprocess.run([*DSD, "detect", "log.csv", "-o", "labels.csv", "--quiet"], cwd=tmp_path, check=True)
    assert sorted(p.name for p in tmp_path.iterdir() if p.name.endswith(".tmp")) == [
        ".labels.csv.123.tmp", ".labels.csv.x.tmp",
    ]  # fmt: skip


def test_a_link_in_the_way_is_not_written_through(tmp_path):
    from dsd_cli.files.whole import write_whole

    (tmp_path / "victim").write_text("old")
    (tmp_path / f".out.toml.{os.getpid()}.tmp").symlink_to(tmp_path / "victim")
    write_whole(tmp_path / "out.toml", b"new")
    assert (tmp_path / "victim").read_text() == "old"
    assert (tmp_path / "out.toml").read_text() == "new"


def test_modes_stay(tmp_path):
    from dsd_cli.files.whole import write_whole

    (tmp_path / "out.csv").write_text("old")
    (tmp_path / "out.csv").chmod(0o600)
    write_whole(tmp_path / "out.csv", b"new")
    write_whole(tmp_path / "fresh.csv", b"new")
    assert (tmp_path / "out.csv").stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "fresh.csv").stat().st_mode & 0o777 == 0o666 & ~_umask()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


@pytest.mark.parametrize("after", [0.0, 0.05, 0.1, 0.2])
def test_ctrl_c_while_starting_says_nothing(tmp_path, after):
    code = (  # from when the handler is set: before that the interpreter itself is starting
        "import dsd_cli.__main__ as dsd; opened = dsd._open_standard_streams; "
        "dsd._open_standard_streams = lambda: (opened(), print('begun', flush=True)); dsd.main()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, "effects"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=Path(__file__).parents[2],
        preexec_fn=interruptible,
    )
    assert process.stdout.readline() == b"begun\n"
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=300)
    assert said == b""


def test_a_library_that_fails_because_it_was_interrupted_is_no_failure_of_its_own(monkeypatch, capsys):
    from dsd_cli.cli import main
    from dsd_cli.cli.ending import Ended

    def interrupted(_: object) -> int:
        try:
            raise Ended(signal.SIGTERM)
        finally:
            raise RuntimeError("release unlocked lock")

    monkeypatch.setattr(main, "_invoke", interrupted)
    assert main.run([]) == 128 + signal.SIGTERM
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("number", fuzz_kills.ANSWERED, ids=lambda n: signal.Signals(n).name)
@pytest.mark.parametrize("where", ["weak reference", "finalizer"])
def test_a_signal_in_a_callback_of_the_interpreter_is_not_lost(number, where):
    code = f"""
import os, sys, time, weakref
import dsd_cli.cli.main as main

def work(arguments):
    class Thing:
        if {where!r} == "finalizer":
            def __del__(self):
                os.kill(os.getpid(), {int(number)})
                len("until the handler has run")
    thing = Thing()
    watch = weakref.ref(thing, lambda _: {where!r} == "finalizer" or os.kill(os.getpid(), {int(number)}))
    del thing
    os.write(1, b"goes on\\n")  # at once: `print` writes the end of the line by itself, and may be ended before it
    for _ in range(3000):
        time.sleep(0.01)
    return 0

main._invoke = work
main.main()
"""
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, preexec_fn=interruptible)
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "goes on\n", "")
