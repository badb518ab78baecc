"""A drive with two cogging lines, by the commands alone: simulated, found, written, held, compared, taken back."""

import json
import tomllib
from pathlib import Path

import pytest

from dsd_cli.files.config import load_config
from tests.cli.rig import AXIS, done, dsd
from tests.cli.test_schema import holds

HEAD = (
    AXIS
    + """
[model.effects.viscous_friction]
coefficient = 0.02
"""
)
LINES = {
    "cogging": {"amplitude": 0.06, "periods": 12.0, "phase": 0.4},
    "cogging_2": {"amplitude": 0.03, "periods": 6.0, "phase": -1.2},
}
TRUTH = (
    HEAD
    + """
[simulate]
duration = 8.0
sample_time = 0.002
encoder_step = 3.835e-4

[simulate.reference]
kind = "trapezoid"
distance = 6.2832
speed = 4.0
acceleration = 20.0
dwell = 0.0
start = 0.2

[simulate.controller]
kind = "pd"
kp = 5.0
kd = 0.4
derivative = "error"
"""
)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of such a drive; the config of its owner, who knows of friction alone."""
    folder = tmp_path_factory.mktemp("lines")
    (folder / "dsd.toml").write_text(HEAD)
    (folder / "truth.toml").write_text(TRUTH)
    lines = (f"{name}:" + ",".join(f"{p}={v}" for p, v in values.items()) for name, values in LINES.items())
    done("simulate", "-c", "truth.toml", "-o", "log.csv", *(x for one in lines for x in ("--effect", one)), cwd=folder)
    return folder


def near(name: str, value: float, error: float) -> bool:
    effect, _, parameter = name.partition(".")
    true = LINES[effect][parameter]
    return abs(value - true) < 4.0 * error + 0.002 * (1.0 if parameter == "phase" else true)


def test_both_are_found_each_with_its_values(rig: Path) -> None:
    rivals = ("cogging", "periodic_disturbance", "gravity", "viscous_friction")
    ran = done("diagnose", "log.csv", "--format", "json", "-q", cwd=rig, effects=rivals)
    holds("diagnose", ran.stdout)
    found = json.loads(ran.stdout)
    assert (found["verdict"], found["found"]) == ("cogging", ["cogging", "cogging_2"])
    values = {name: e for name, e in found["found_values"].items() if name.startswith("cogging")}
    assert set(values) == {f"{effect}.{p}" for effect, of in LINES.items() for p in of}
    assert [name for name, e in values.items() if not near(name, e["value"], e["std_error"])] == []


def test_one_is_added_beside_the_other_and_may_be_held(rig: Path) -> None:
    """The config and its history know it, `compare` predicts with it, --undo takes it back."""
    done("add", "log.csv", "cogging", "--fix", "cogging.periods=12", "-o", "one.toml", "-q", cwd=rig)
    known = ("--fix", "cogging_2.periods=6", "--prior", "cogging_2.amplitude=0.03+-0.001")
    done("add", "log.csv", "cogging_2", *known, "-c", "one.toml", "-o", "two.toml", "-q", cwd=rig)
    config = load_config(rig / "two.toml")
    values = {f"{e}.{p}": v for e, of in config.model.effects.items() if e in LINES for p, v in of.items()}
    errors = config.history[-1].fitted_errors
    assert [name for name, value in values.items() if not near(name, value, errors.get(name, 0.0))] == []
    assert config.model.effects["cogging_2"]["periods"] == 6.0
    assert [step.effect for step in config.history] == ["cogging", "cogging_2"]
    compared = json.loads(done("compare", "log.csv", "-c", "two.toml", "--format", "json", "-q", cwd=rig).stdout)
    assert compared["force"]["rmse"] == pytest.approx(config.history[-1].rmse_after, rel=0.01)
    assert compared["force"]["rmse"] < 0.1 * config.history[-1].rmse_before
    done("improve", "-c", "two.toml", "--undo", "-o", "back.toml", "-q", cwd=rig)
    assert tomllib.loads((rig / "back.toml").read_text()) == tomllib.loads((rig / "one.toml").read_text())


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        ("cogging", "cogging is in the model already: `dsd add LOG inertia` fits the values that are there;"
                    " `dsd add LOG cogging_2` adds one more of its kind"),
        ("gravity_2", "no effect 'gravity_2': a model has one gravity"),
    ],
)  # fmt: skip
def test_what_cannot_be_added_is_one_line(rig: Path, effect: str, said: str) -> None:
    (rig / "has.toml").write_text(HEAD + "\n[model.effects.cogging]\namplitude = 0.06\nperiods = 12\nphase = 0.4\n")
    ran = dsd("add", "log.csv", effect, "-c", "has.toml", "-o", "never.toml", cwd=rig)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr == f"dsd: error: {said}\n"
    assert not (rig / "never.toml").exists()
