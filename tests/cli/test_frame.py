"""The frame of `dsd`: help, version, exit codes, one line per failure, pipes, and what start-up imports."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import pytest
import typer

from dsd_cli import __version__
from dsd_cli.cli import main as frame
from dsd_cli.cli.coercion import use_plain_coercion
from dsd_cli.cli.lazy import COMMANDS
from dsd_cli.errors import CheckFailed, DataError, UsageError

DSD = [sys.executable, "-m", "dsd_cli"]


def dsd(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*DSD, *arguments], capture_output=True, text=True, check=False, env={**os.environ, **environment}
    )


def test_help_lists_the_commands_of_this_release() -> None:
    done = dsd("--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert all(f"\n  {name} " in done.stdout for name in COMMANDS)
    assert "\x1b" not in done.stdout


@pytest.mark.parametrize("command", ["init", "fleet detect", "fleet merge"])
def test_every_command_has_a_short_help(command: str) -> None:
    short, whole = (dsd(*command.split(), option) for option in ("-h", "--help"))
    assert (short.returncode, short.stdout) == (0, whole.stdout)


def test_no_command_shows_the_help_as_an_error() -> None:
    done = dsd()
    assert (done.returncode, done.stdout) == (2, "")
    assert "Commands:" in done.stderr


def test_version_names_the_kernel() -> None:
    done = dsd("--version")
    assert done.returncode == 0
    assert done.stdout.startswith(f"dsd {__version__} (detector kernel: ")


@pytest.mark.parametrize("arguments", [["--help"], ["init", "-o", "-"], ["init", "--help"]])
def test_start_up_imports_nothing_heavy(arguments: list[str]) -> None:
    code = f"import sys; from dsd_cli.cli.main import run; assert run({arguments}) == 0; "
    code += "sys.stderr.write(repr(set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"numpy", "pyarrow", "pydantic", "tomlkit", "scipy", "matplotlib", "rich.console", "asyncio"}
    assert not heavy & eval(done.stderr)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["detec"], "No such command 'detec'. Did you mean 'detect'?: see 'dsd --help'"),
        (["--foo"], "No such option: --foo: see 'dsd --help'"),
        (["effects", "--format", "xml"], "'xml' is not one of"),
        (["effects", "--frmat", "json"], "see 'dsd effects --help'"),
        (["effects", "rust"], "no effect 'rust': known effects are"),
    ],
)
def test_a_bad_command_line_is_one_line_and_2(arguments: list[str], line: str) -> None:
    done = dsd(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("dsd: error: ")
    assert line in done.stderr


@pytest.mark.parametrize(
    ("failure", "code", "line"),
    [
        (DataError("log.csv: row 3", "mend it"), 1, "dsd: error: log.csv: row 3: mend it\n"),
        (UsageError("dsd.toml: x"), 2, "dsd: error: dsd.toml: x\n"),
        (CheckFailed("share 0.5"), 3, "dsd: error: share 0.5\n"),
        (
            FileNotFoundError(2, "No such file or directory", "x.csv"),
            1,
            "dsd: error: x.csv: No such file or directory\n",
        ),
        (KeyboardInterrupt(), 130, ""),
        (ValueError("a\nb"), 1, "dsd: error: unexpected ValueError: a b: please report this"),
    ],
)
def test_every_failure_ends_in_one_place(
    failure: BaseException, code: int, line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(_: str) -> None:
        raise failure

    monkeypatch.delenv("DSD_DEBUG", raising=False)
    monkeypatch.setattr("dsd_cli.files.template.template_text", fail)
    assert frame.run(["init", "-o", "-"]) == code
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith(line)
    assert len(said.err.splitlines()) == (1 if line else 0)


def test_the_traceback_is_there_for_debugging(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DSD_DEBUG", "1")
    monkeypatch.setattr("dsd_cli.files.template.template_text", lambda _: 1 / 0)
    assert frame.run(["init"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_a_closed_pipe_ends_quietly() -> None:
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([*DSD, "effects"], stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


def test_effects_as_json() -> None:
    result = json.loads(dsd("effects", "viscous_friction", "--format", "json").stdout)
    assert (result["schema_version"], result["command"], result["log"]) == (1, "effects", None)
    (effect,) = result["effects"]
    assert (effect["id"], effect["law"], effect["needs"]) == ("viscous_friction", "-B v", ["velocity"])
    assert effect["parameters"][0]["unit"] == "u/v"
    assert (effect["parameters"][0]["lower"], effect["parameters"][0]["upper"]) == (0.0, None)


@pytest.mark.parametrize("arguments", [["effects"], ["effects", "coulomb_friction"]])
def test_effects_for_the_eye(arguments: list[str]) -> None:
    done = dsd(*arguments, NO_COLOR="1", COLUMNS="120")
    assert done.returncode == 0
    assert "coulomb_friction" in done.stdout
    assert "\x1b" not in done.stdout


def test_plain_values_are_coerced_without_typers_own_machinery() -> None:
    app = typer.Typer()
    got: list[object] = []

    @app.command()
    def command(
        count: int,
        rate: Annotated[float, typer.Option()] = 1.0,
        names: Annotated[list[str] | None, typer.Option("--name")] = None,
        where: Path = Path("here"),
        flag: bool = False,
    ) -> None:
        got.append((count, rate, names, where, flag))

    built = typer.main.get_command(app)
    use_plain_coercion(built)
    with built.make_context(
        "x", ["3", "--rate", "1e-3", "--name", "a", "--name", "b", "--where", "w", "--flag"]
    ) as ctx:
        built.invoke(ctx)
    with built.make_context("x", ["3"]) as ctx:
        built.invoke(ctx)
    assert got[0] == (3, 1e-3, ["a", "b"], Path("w"), True)
    assert got[1][:2] == (3, 1.0)
    assert not got[1][2]
    with pytest.raises(typer.BadParameter, match=r"'3\.5' is not a(n| valid) integer"):
        built.make_context("x", ["3.5"])


def test_the_end_is_short_but_in_order(tmp_path: Path) -> None:
    """What was registered for the exit is done, what was printed is out, and the exit code stands."""
    effect = tmp_path / "mine.py"
    effect.write_text("import atexit\natexit.register(lambda: print('registered'))\n")
    done = dsd("effects", "--effects-from", str(effect))
    assert done.returncode == 2
    assert "defines no EFFECT" in done.stderr
    assert done.stdout == "registered\n"


def test_garbage_is_looked_for_as_ever_once_the_start_is_over() -> None:
    code = """
import gc
from dsd_cli.__main__ import KEPT, _spare_the_start
usual, callbacks = gc.get_threshold(), list(gc.callbacks)
_spare_the_start()
assert gc.get_threshold()[0] == KEPT
kept = [[] for _ in range(KEPT + 1)]
assert (gc.get_threshold(), gc.callbacks) == (usual, callbacks)
"""
    subprocess.run([sys.executable, "-c", code], check=True)
