"""`dsd export` as a user runs it."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.cli.rig import done, dsd

SAMPLES = Path(__file__).parents[2] / "sample_logs"
MODEL = f"{SAMPLES}/servo-friction.toml"
LOG = f"{SAMPLES}/servo-friction.csv"
GCC = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")


@GCC
def test_a_header_is_written_run_and_compiles_as_strict_c99(tmp_path: Path) -> None:
    ran = done("export", MODEL, "--to", "c", "-o", "axis.h", "--name", "axis_2", "--format", "json", cwd=tmp_path)
    result = json.loads(ran.stdout)
    assert result["verify"]["ran"]
    assert result["verify"]["rms_percent"] < 1e-9
    assert {one["effect"] for one in result["carried"]} == {"inertia", "delay", "viscous_friction", "coulomb_friction"}
    assert result["dropped"] == []
    strict = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", "c", "axis.h"]
    assert subprocess.run(strict, cwd=tmp_path, check=False).returncode == 0
    assert "double axis_2_feedforward(" in (tmp_path / "axis.h").read_text()


@GCC
def test_it_is_run_under_the_u_of_a_log(tmp_path: Path) -> None:
    ran = done("export", MODEL, "--to", "c", "-o", "axis.h", "--verify", LOG, cwd=tmp_path)
    assert f"run under {LOG}" in ran.stdout


def test_what_is_not_carried_is_refused_or_measured(tmp_path: Path) -> None:
    (tmp_path / "odd.py").write_text(ODD)
    (tmp_path / "odd.toml").write_text("[model]\ninertia = 0.5\n[model.effects.odd]\nlevel = 0.4\n")
    given = ("export", "odd.toml", "--effects-from", "odd.py", "--to", "python", "-o", "axis.py")
    ran = dsd(*given, cwd=tmp_path)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.startswith("dsd: error: python does not carry odd (its law turns a value into a float")
    assert not (tmp_path / "axis.py").exists()
    result = json.loads(done(*given, "--drop", "--format", "json", cwd=tmp_path).stdout)
    (left,) = result["dropped"]
    assert left["effect"] == "odd"
    assert left["cost"]["force_rms"] > 0.1
    assert left["cost"]["velocity_percent"] > 1.0


ODD = """
import math
from dsd_cli.effects import Effect, Parameter, Role
import numpy as np

def columns(channels, shape):
    if np.ndim(channels.velocity):
        return (-np.tanh(channels.velocity),)
    return (-math.tanh(channels.velocity),)

EFFECT = Effect(
    id="odd", role=Role.APPLIED, law="-level tanh v", summary="s", pattern="p",
    parameters=(Parameter("level", "{u}", "level"),), needs=("velocity",), columns=columns,
)
"""


def test_an_effect_of_the_user_goes_out_like_any_other(tmp_path: Path) -> None:
    (tmp_path / "odd.py").write_text(ODD.replace("-math.tanh", "-np.tanh"))
    (tmp_path / "odd.toml").write_text("[model]\ninertia = 0.5\n[model.effects.odd]\nlevel = 0.4\n")
    given = ("export", "odd.toml", "--effects-from", "odd.py", "--to", "python", "-o", "axis.py", "--format", "json")
    result = json.loads(done(*given, cwd=tmp_path).stdout)
    assert result["verify"]["rms_percent"] < 1e-9
    assert "math.tanh" in (tmp_path / "axis.py").read_text()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--to", "excel"), "--to excel: targets are"),
        (("--to", "c", "--name", 'a"; system("id"); /*'), "letters, digits and _"),
        (("--to", "c", "--verify", LOG, "--no-verify"), "give one of them"),
        (("--to", "c", "--sample-time", "0"), "--sample-time 0: must be above 0"),
    ],
)
def test_a_bad_command_line_writes_nothing(given: tuple[str, ...], said: str, tmp_path: Path) -> None:
    ran = dsd("export", MODEL, *given, "-o", "out", cwd=tmp_path)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert said in ran.stderr
    assert list(tmp_path.iterdir()) == []
