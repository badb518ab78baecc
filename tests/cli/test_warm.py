"""A command forked from a process that has loaded the libraries does what one does that starts afresh."""

import json
import os
import subprocess
from pathlib import Path

import pytest

from tests import warm


@pytest.mark.parametrize(
    "arguments",
    [["--version"], ["effects"], ["detect", "none.csv"], ["no-such-command"], ["init", "-o", "a.toml"], ["schema"]],
    ids=" ".join,
)
def test_streams_exit_code_and_folder_are_the_same(arguments, tmp_path):
    as_afresh(arguments, tmp_path)


@pytest.mark.parametrize("stdin", ["t,u\n0,1\n0.001,2\n", b"t,u\r\n0,1\r\n", ""], ids=["text", "bytes", "nothing"])
def test_what_is_piped_in_is_read(stdin, tmp_path):
    as_afresh(["columns", "-"], tmp_path, stdin)


def test_what_is_piped_in_need_not_be_read():
    assert warm.run("--version", cwd=Path(), stdin=b"x" * (1 << 20)).returncode == 0  # more than a pipe holds


def as_afresh(arguments, tmp_path, stdin=None):
    """The command warm, as it is in a process of its own."""
    answers, env = [], {**os.environ, "COLUMNS": "70", "NO_COLOR": "1"}
    how = {"stdin": subprocess.DEVNULL} if stdin is None else {"input": stdin}
    how |= {"text": not isinstance(stdin, bytes), "capture_output": True, "env": env}
    for name, run in (
        ("warm", lambda cwd: warm.run(*arguments, cwd=cwd, env=env, stdin=stdin)),
        ("afresh", lambda cwd: subprocess.run([*warm.DSD, *arguments], cwd=cwd, **how)),
    ):
        (tmp_path / name).mkdir()
        done = run(tmp_path / name)
        written = {path.name: path.read_text() for path in (tmp_path / name).iterdir()}
        answers.append((done.returncode, done.stdout, done.stderr, written))
    assert answers[0] == answers[1]


def test_another_environment_starts_afresh():
    here = dict(os.environ)
    assert warm._SERVER.serves({**here, "COLUMNS": "40"})
    assert not warm._SERVER.serves({**here, "DSD_DEBUG": "1"})


def test_what_a_library_of_the_tests_sets_starts_no_command_afresh():
    pytest.importorskip("hmmlearn.hmm", reason="hmmlearn is not installed")
    assert warm._SERVER.serves(dict(os.environ))


def test_a_command_looks_for_the_effects_that_it_is_told():
    words = ("diagnose", "servo-friction.csv", "-c", "servo-bare.toml", "--to", "1", "--format", "json")
    found = json.loads(warm.run(*words, cwd=warm.ROOT / "sample_logs", effects=warm.FEW).stdout)
    assert {one["effect"] for one in found["ranking"]} - {"inertia", "delay"} == set(warm.FEW)


def test_what_takes_too_long_is_ended(tmp_path):
    (tmp_path / "dsd.toml").write_text("[observer]\nnominal_inertia = 1.0\ntime_constant = 0.01\n")
    os.mkfifo(tmp_path / "log.csv")  # nobody writes
    with pytest.raises(subprocess.TimeoutExpired):
        warm.run("detect", "log.csv", cwd=tmp_path, timeout=0.5)
    assert warm.run("--version", cwd=tmp_path).returncode == 0
