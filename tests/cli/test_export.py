"""`dsd export` as a user runs it."""

import json
import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.cli.export import _check_holds
from dsd_cli.errors import CheckFailed
from dsd_cli.export.making import Verified
from tests.cli.rig import done, dsd, refused
from tests.cli.terminal import terminal

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


def test_the_budget_says_what_each_effect_is_worth(tmp_path: Path) -> None:
    given = ("export", MODEL, "--to", "parameters", "-o", "v.csv", "--budget", "--verify", LOG, "--format", "json")
    budget = {one["effect"]: one["cost"] for one in json.loads(done(*given, cwd=tmp_path).stdout)["budget"]}
    assert set(budget) == {"delay", "viscous_friction", "coulomb_friction"}
    assert budget["coulomb_friction"]["force_rms"] == pytest.approx(0.15, rel=0.1)  # the level, but for rests
    assert budget["coulomb_friction"]["velocity_percent"] > 5.0


RNG = np.random.default_rng(1)
STILL = {
    "short.csv": np.full(20, 1.5),
    "noise.csv": 1.5 + 1e-4 * RNG.standard_normal(2000),
    "encoder.csv": 1.5 + 1e-3 * RNG.integers(0, 3, 2000),
}


def _log(file: Path, u: np.ndarray, **channels: np.ndarray) -> None:
    t = 0.001 * np.arange(len(u))
    rows = np.column_stack([t, u, *channels.values()])
    np.savetxt(file, rows, "%.9g", ",", header=",".join(["t", "u", *channels]), comments="")


def _config(folder: Path, sensor: str = "position") -> None:
    signals = f'[signals]\ntime = "t"\nu = "u"\n{sensor} = "{sensor}"\n'
    (folder / "m.toml").write_text(signals + HEAVY)


HEAVY = """
[model]
inertia = 0.5
[model.effects.viscous_friction]
coefficient = 0.3
[model.effects.coulomb_friction]
level = 0.5
"""


@pytest.mark.parametrize("name", STILL)
def test_a_log_at_rest_verifies_nothing(name: str, tmp_path: Path) -> None:
    _config(tmp_path)
    _log(tmp_path / name, np.full(len(STILL[name]), 0.1), position=STILL[name])
    ran = dsd("export", "m.toml", "--to", "python", "--verify", name, "-o", "axis.py", cwd=tmp_path)
    refused(ran, 1, f"{name}: the axis does not move: nothing can be compared")
    assert not (tmp_path / "axis.py").exists()


def test_nor_does_noise_of_a_speed_or_a_model_that_stays(tmp_path: Path) -> None:
    _config(tmp_path, "velocity")
    _log(tmp_path / "speed.csv", np.full(2000, 0.1), velocity=1e-3 * RNG.standard_normal(2000))
    given = ("export", "m.toml", "--to", "python", "-o", "axis.py", "--verify")
    refused(dsd(*given, "speed.csv", cwd=tmp_path), 1, "speed.csv: the axis does not move")
    moves = np.sin(0.01 * np.arange(2000))
    moves[:2] = 0.0
    _log(tmp_path / "weak.csv", np.full(2000, 0.1), velocity=moves)  # u is below the friction of the model
    refused(dsd(*given, "weak.csv", cwd=tmp_path), 1, "weak.csv: the model does not move under its u")


def test_a_target_that_runs_nothing_says_so_of_the_log(tmp_path: Path) -> None:
    ran = done("export", MODEL, "--to", "parameters", "-o", "v.csv", "--verify", LOG, cwd=tmp_path)
    said = f"dsd: warning: --verify {LOG}: not run: a table of values has no motion; nothing of parameters is verified"
    assert ran.stderr.splitlines()[0] == said


def test_binary_is_not_for_a_terminal(tmp_path: Path) -> None:
    given = ("export", MODEL, "--to", "fmu", "--no-verify", "-o", "-")
    with terminal(*given, cwd=tmp_path, columns=120) as screen:
        assert screen.finish() == 2
    assert b"PK" not in screen.raw
    assert b"binary, and stdout is a terminal" in screen.raw


@pytest.mark.parametrize(
    ("percent", "said"), [(math.nan, "more than 1000 %"), (4e9, "more than 1000 %"), (2.5, "2.5 %")]
)
def test_a_model_that_runs_away_is_refused_in_words(percent: float, said: str) -> None:
    with pytest.raises(CheckFailed, match=f"the speed of the exported model is {said} off under a chirp"):
        _check_holds("sdf", Verified(True, "a chirp", percent))


def test_most_of_u_is_not_left_out_quietly(tmp_path: Path) -> None:
    _config(tmp_path)
    text = (tmp_path / "m.toml").read_text() + "[model.effects.stiffness]\ncoefficient = 40.0\n"
    (tmp_path / "m.toml").write_text(text)
    ran = done("export", "m.toml", "--to", "table", "-o", "t.csv", "--drop", cwd=tmp_path)
    assert ran.stderr.startswith("dsd: warning: without stiffness, ")
    assert "what is written is another axis" in ran.stderr.splitlines()[0]
    (tmp_path / "m.toml").write_text(text.replace("40.0", "0.4"))
    assert done("export", "m.toml", "--to", "table", "-o", "t.csv", "--drop", cwd=tmp_path).stderr == ""
