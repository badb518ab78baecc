"""--plot of every command that has something to show, by the real command."""

import shutil
from pathlib import Path

import pytest

from tests.cli.rig import done, dsd, refused

SAMPLES = Path(__file__).parents[2] / "sample_logs"
KNOWN = ("servo-friction.csv", "-c", "servo-friction.toml")
COMMANDS = {
    "simulate": ("simulate", "-c", "servo-friction.toml", "--duration", "1", "-o", "new.csv"),
    "adapt": ("simulate", "-c", "paper-step.toml", "--duration", "1", "-o", "new.csv", "--adapt"),
    "observe": ("observe", *KNOWN, "-o", "new.csv"),
    "detect": ("detect", *KNOWN),
    "profile": ("detect", *KNOWN, "--method", "profile"),
    "viterbi": ("detect", *KNOWN, "--to", "1", "--method", "viterbi"),
    "check": ("check", *KNOWN, "--set", "signals.u_sign=-1"),
    "compare": ("compare", *KNOWN),
    "holdout": (
        "compare",
        "servo-friction.csv",
        "-c",
        "servo-bare.toml",
        "--to",
        "1",
        "--holdout",
        "servo-friction.csv",
    ),
    "simulation": ("compare", *KNOWN, "--horizon", "simulation"),
    "horizon": ("compare", *KNOWN, "--to", "1", "--horizon", "0.1s"),
    "tune": ("tune", *KNOWN, "--to", "1"),
    "add": ("add", "servo-friction.csv", "coulomb_friction", "-c", "servo-bare.toml", "--to", "1", "-o", "new.toml"),
    "versus": ("compare", *KNOWN, "--to", "1", "-c", "servo-bare.toml"),
}
MAGIC = {"png": b"\x89PNG\r\n", "svg": b"<?xml", "pdf": b"%PDF-"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for pattern in ("servo-*", "paper-step.toml"):
        for path in SAMPLES.glob(pattern):
            shutil.copy(path, tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_draws_what_the_ending_says(folder: Path, name: str) -> None:
    form = {"observe": "svg", "horizon": "pdf"}.get(name, "png")
    result = done(*COMMANDS[name], "--plot", f"out.{form}", cwd=folder)
    assert f"out.{form}: drawn" in result.stderr
    content = (folder / f"out.{form}").read_bytes()
    assert content.startswith(MAGIC[form])
    assert len(content) > 20_000


def test_a_fleet_is_drawn(folder: Path) -> None:
    done("fleet", "detect", "servo-friction.csv", "servo-load-change.parquet", "-c", "servo-friction.toml", cwd=folder)
    summary = ("fleet", "summary", "results.parquet")
    drawn = done(*summary, "--plot", "out.svg", cwd=folder)
    assert "out.svg: drawn" in drawn.stderr
    assert (folder / "out.svg").read_bytes().startswith(MAGIC["svg"])
    assert drawn.stdout == done(*summary, cwd=folder).stdout
    refused(dsd(*summary, "--plot", "results.parquet", cwd=folder), 2, "not known what to")
    refused(dsd(*summary, "--plot", "out.jpg", cwd=folder), 2, ".svg")


def test_a_failing_picture_keeps_the_result_and_the_exit_code(folder: Path) -> None:
    (folder / "full.png").symlink_to("/dev/full")
    for arguments, code in ((COMMANDS["detect"], 0), ((*COMMANDS["compare"], "--max-rmse", "1e-9"), 3)):
        plain = dsd(*arguments, cwd=folder)
        drawn = dsd(*arguments, "--plot", "full.png", "--quiet", cwd=folder)
        assert (drawn.returncode, drawn.stdout) == (code, plain.stdout)
        assert "dsd: warning: full.png: cannot be written" in drawn.stderr
        assert "Traceback" not in drawn.stderr


@pytest.mark.parametrize("command", ["simulate", "observe", "detect", "check", "compare", "tune", "add"])
def test_what_cannot_be_drawn_is_said_before_anything_is_done(folder: Path, command: str) -> None:
    for plot, code, text in (
        ("out.jpg", 2, ".svg"),
        ("nowhere/out.png", 1, "no such folder"),
        ("servo-friction.toml", 2, "not known what to"),
    ):
        refused(dsd(*COMMANDS[command], "--plot", plot, cwd=folder), code, text)
    assert not [*folder.glob("new.*")]
    same = (*COMMANDS["observe"][:-1], "out.parquet", "--plot", "servo-friction.png")
    shutil.copy(folder / "servo-friction.csv", folder / "servo-friction.png")
    refused(
        dsd("compare", "servo-friction.png", *KNOWN[1:], "--plot", "servo-friction.png", cwd=folder), 2, "is the input"
    )
    done(*same, cwd=folder)


def test_several_methods_are_not_drawn(folder: Path) -> None:
    refused(dsd(*COMMANDS["detect"], "--method", "dsd,imm", "--plot", "out.png", cwd=folder), 2, "--plot")
    refused(
        dsd("compare", "-c", "servo-bare.toml", "-c", "servo-friction.toml", "--plot", "o.png", cwd=folder), 2, "LOG"
    )
