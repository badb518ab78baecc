"""A command forked from a process that has loaded the libraries does what one does that starts afresh."""

import os
import subprocess

import pytest

from tests import warm


@pytest.mark.parametrize(
    "arguments",
    [["--version"], ["effects"], ["detect", "none.csv"], ["no-such-command"], ["init", "-o", "a.toml"], ["schema"]],
    ids=" ".join,
)
def test_streams_exit_code_and_folder_are_the_same(arguments, tmp_path):
    answers, env = [], {**os.environ, "COLUMNS": "70", "NO_COLOR": "1"}
    for name, run in (
        ("warm", lambda cwd: warm.run(*arguments, cwd=cwd, env=env)),
        (
            "afresh",
            lambda cwd: subprocess.run([*warm.DSD, *arguments], cwd=cwd, env=env, capture_output=True, text=True),
        ),
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


def test_what_takes_too_long_is_ended(tmp_path):
    (tmp_path / "dsd.toml").write_text("[observer]\nnominal_inertia = 1.0\ntime_constant = 0.01\n")
    os.mkfifo(tmp_path / "log.csv")  # nobody writes
    with pytest.raises(subprocess.TimeoutExpired):
        warm.run("detect", "log.csv", cwd=tmp_path, timeout=0.5)
    assert warm.run("--version", cwd=tmp_path).returncode == 0
