"""Effects of the user reach every command: `--effects-from`, and `[effects] from` of a config, run only if allowed."""

from pathlib import Path

import pytest

from tests.cli.rig import dsd
from tests.cli.terminal import terminal

EFFECT = """\
from dsd_cli.effects import Effect, Parameter, Role

def columns(channels, shape):
    return (-channels.velocity * abs(channels.velocity),)

EFFECT = Effect(id="my_drag", role=Role.APPLIED, law="-c v abs(v)", summary="Drag of mine.", pattern="grows with speed",
                parameters=(Parameter("coefficient", "{u}/({v})^2", "force per speed squared"),), columns=columns,
                needs=("velocity",))
"""
ROOT = Path(__file__).parents[2]
BARE = (ROOT / "sample_logs/servo-bare.toml").read_text(encoding="utf-8")
CONFIG = BARE + "[model.effects.my_drag]\ncoefficient = 0.001\n"
NAMED = '[effects]\nfrom = ["my_effect.py"]\n'
COMMANDS = {
    "compare": ["compare", "a.csv"],
    "check": ["check", "a.csv"],
    "detect": ["detect", "a.csv"],
    "tune": ["tune", "a.csv"],
    "observe": ["observe", "a.csv", "-o", "d.csv"],
    "history": ["improve", "--history"],
    "fleet": ["fleet", "compare", "a.csv", "--workers", "1"],
}


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "my_effect.py").write_text(EFFECT)
    (tmp_path / "dsd.toml").write_text(CONFIG)
    lines = (ROOT / "sample_logs/servo-friction.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    (tmp_path / "a.csv").write_text("".join(lines[:1500]))
    return tmp_path


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_takes_them_from_the_config_when_trusted(rig: Path, name: str) -> None:
    (rig / "dsd.toml").write_text(CONFIG + NAMED)
    refused = dsd(*COMMANDS[name], cwd=rig)
    assert refused.returncode == 2
    assert "[effects] from: my_effect.py is Python that would be run: --trust runs it" in refused.stderr
    ran = dsd(*COMMANDS[name], "--trust", cwd=rig)
    assert ran.returncode == 0, ran.stderr
    assert ran.stderr.count("dsd: dsd.toml: ran my_effect.py for its effects") == 1


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_takes_them_from_the_command_line(rig: Path, name: str) -> None:
    unknown = dsd(*COMMANDS[name], cwd=rig)
    assert unknown.returncode == 2
    assert "unknown effect model.effects.my_drag: your own is read with --effects-from FILE.py" in unknown.stderr
    assert dsd(*COMMANDS[name], "--effects-from", "my_effect.py", cwd=rig).returncode == 0


def test_what_the_command_line_names_is_allowed_already(rig: Path) -> None:
    (rig / "dsd.toml").write_text(CONFIG + NAMED)
    done = dsd("compare", "a.csv", "--effects-from", "my_effect.py", cwd=rig)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    "written", ['[effects]\nfrom = ["my_effect.py"] # mine\n', 'effects = { from = ["my_effect.py"] }\n']
)
def test_a_config_written_to_another_folder_names_the_same_files(rig: Path, written: str) -> None:
    (rig / "out").mkdir()
    (rig / "dsd.toml").write_text(written + CONFIG if written[0] == "e" else CONFIG + written)
    done = dsd("tune", "a.csv", "--trust", "-o", "out/tuned.toml", cwd=rig)
    assert done.returncode == 0, done.stderr
    there = (rig / "out/tuned.toml").read_text(encoding="utf-8")
    assert 'from = ["../my_effect.py"]' in there
    assert ("# mine" in there) == ("# mine" in written)
    assert dsd("compare", "a.csv", "--trust", "-c", "out/tuned.toml", cwd=rig).returncode == 0
    beside = dsd("tune", "a.csv", "--trust", "-c", "out/tuned.toml", "-o", "back.toml", cwd=rig)
    assert beside.returncode == 0, beside.stderr
    assert 'from = ["my_effect.py"]' in (rig / "back.toml").read_text(encoding="utf-8")


def test_it_is_said_but_not_to_whom_wants_quiet(rig: Path) -> None:
    (rig / "dsd.toml").write_text(CONFIG + NAMED)
    done = dsd("compare", "a.csv", "--trust", "-q", cwd=rig)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("written", "said"), [('"x.py"', "must be a list of files"), ('["x.py"]', "x.py: no such file")]
)
def test_what_cannot_be_used_is_one_line(rig: Path, written: str, said: str) -> None:
    (rig / "dsd.toml").write_text(f"{CONFIG}[effects]\nfrom = {written}\n")
    done = dsd("compare", "a.csv", "--trust", cwd=rig)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(("answer", "code"), [("y\n", 0), ("n\n", 2)])
def test_on_a_terminal_it_is_asked(rig: Path, answer: str, code: int) -> None:
    (rig / "dsd.toml").write_text(CONFIG + NAMED)
    with terminal("compare", "a.csv", cwd=rig, columns=120) as shown:
        shown.until(lambda: "dsd.toml wants to run my_effect.py (Python). Run it?" in shown.text)
        shown.type(answer)
        assert shown.finish() == code
