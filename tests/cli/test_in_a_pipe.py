"""What goes to a pipe is for a program: no line is folded there; and what a shell completes."""

import os
import re
import subprocess
from pathlib import Path

import pytest

from tests.cli.rig import DSD, FEW, done
from tests.cli.terminal import terminal

ROOT = Path(__file__).parents[2]
NAME = "a-log-of-an-axis-whose-name-is-longer-than-what-a-narrow-terminal-has-in-one-line-measured-on-monday.csv"


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    here = tmp_path_factory.mktemp("pipe")
    (here / NAME).write_bytes((ROOT / "sample_logs/servo-friction.csv").read_bytes())
    (here / "dsd.toml").write_bytes((ROOT / "sample_logs/servo-bare.toml").read_bytes())
    return here


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("check", NAME), rf"^{NAME}: can answer$"),
        (("check", NAME, "--set", "signals.u_sign=-1"), rf"^{NAME}: cannot answer: u has the other sign than the "),
        (("diagnose", NAME, "--to", "1.5"), r"^  coulomb_friction +\S+ +\S+ % +yes, 9\d %$"),
        (("detect", NAME), rf"^{NAME}: 3,000 samples, 1 ms apart; 2,970 judged"),
    ],
)
def test_nothing_is_folded(rig: Path, arguments: tuple[str, ...], line: str) -> None:
    out = done(*arguments, cwd=rig, effects=FEW).stdout
    assert re.search(line, out, flags=re.MULTILINE), out
    assert NAME in out or arguments[0] == "diagnose"


@pytest.mark.parametrize("command", [(), ("improve",), ("fleet",), ("fleet", "detect")])
def test_help_is_one_line_each_where_a_program_reads_it(rig: Path, command: tuple[str, ...]) -> None:
    out = done(*command, "--help", cwd=rig).stdout
    lines = out[out.index("Options:") :].splitlines()[1:]
    assert all(re.match(r"  (-|[a-z])|$|Commands:$", line) for line in lines), out  # none goes on from the one before
    assert ("for --from-prior." in out) == (command == ("improve",))


@pytest.mark.parametrize("columns", [50, 64, 80])
def test_help_on_a_terminal_cuts_no_name(rig: Path, columns: int) -> None:
    with terminal("improve", "--help", cwd=rig, columns=columns, lines=140) as shown:
        shown.finish()
        lines = [line.rstrip() for line in shown.text.splitlines()]
        assert max(map(len, lines)) <= columns
        assert not [line for line in lines if line.endswith("-")]
        assert any(re.search(r"--from-prior\b", line) and "--from-prior   " not in line for line in lines)


def test_a_terminal_folds_between_words(rig: Path) -> None:
    with terminal("check", NAME, "--set", "signals.u_sign=-1", cwd=rig, columns=70) as shown:
        shown.finish()
        assert not re.search("cannot answer: u has the other sign than the motion it causes", shown.text)


def completed(words: str, cwd: Path) -> list[str]:
    asked = {"_DSD_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(len(words.split()) - 1)}
    made = subprocess.run(DSD, cwd=cwd, env={**os.environ, **asked}, capture_output=True, text=True, check=False)
    return made.stdout.split()


def test_a_shell_completes_the_keys_of_the_config(rig: Path) -> None:
    assert {"model.inertia=", "model.delay=", "model.effects.viscous_friction.coefficient="} <= set(
        completed("dsd detect x.csv --set model.", rig)
    )
    assert completed("dsd detect x.csv --set observer.tim", rig) == ["observer.time_constant="]


def test_tune_knows_how_short_a_window_of_the_profile_may_be(rig: Path) -> None:
    done("tune", NAME, "--from", "0.5", "--to", "0.9", "--set", "detector.method='profile'", "-o", "t.toml", cwd=rig)
    (window,) = re.findall(r"^window = (\d+)", (rig / "t.toml").read_text(), flags=re.MULTILINE)
    assert int(window) >= 10
