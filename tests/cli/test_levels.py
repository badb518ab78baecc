"""Two logs of one axis whose friction warmed up in between, by the commands alone: said, written, kept, taken back."""

import json
import re
import tomllib
from pathlib import Path

import pytest

from dsd_cli.files.config import load_config
from tests.cli.rig import AXIS, done
from tests.cli.test_schema import holds, published

HEAD = (
    AXIS
    + """
[model.effects.coulomb_friction]
level = 0.1
"""
)
TRUTH = (
    HEAD
    + """
[simulate]
duration = 5.0
sample_time = 0.002
encoder_step = 3.835e-4

[simulate.reference]
kind = "multisine"
frequencies = [1.7, 3.1, 5.3, 7.9, 11.3]
amplitude = 0.5
seed = 3

[simulate.controller]
kind = "pd"
kp = 5.0
kd = 0.4
derivative = "error"
"""
)
#: The weight, what may stand in for it, and for a level.
RIVALS = ("viscous_friction", "stribeck_friction", "load_friction", "gravity", "constant_load", "stiffness")
LEVELS = {"cold.csv": 0.13, "warm.csv": 0.07}
WEIGHT = "gravity:amplitude=0.1,phase=0.2"


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of the cold axis and one of the warm one; the config of its owner, who knows the mean and no weight."""
    folder = tmp_path_factory.mktemp("levels")
    (folder / "dsd.toml").write_text(HEAD)
    (folder / "truth.toml").write_text(TRUTH)
    for log, level in LEVELS.items():
        friction = f"model.effects.coulomb_friction.level={level}"
        done("simulate", "-c", "truth.toml", "-o", log, "--set", friction, "--effect", WEIGHT, cwd=folder)
    return folder


@pytest.fixture(scope="module")
def improved(rig: Path) -> dict:
    got = done("improve", *LEVELS, "--auto", "-o", "better.toml", "--format", "json", cwd=rig, effects=RIVALS)
    holds("improve", got.stdout)
    return json.loads(got.stdout)


def test_the_weight_is_named_and_the_level_of_each_log_said(improved):
    assert [step["effect"] for step in improved["ladder"]][-1] == "gravity"
    assert improved["verdict"] == "none"
    assert list(improved["levels"]) == ["coulomb_friction.level"]
    levels = improved["levels"]["coulomb_friction.level"]
    assert {one["log"]: one["value"] for one in levels["logs"]} == pytest.approx(LEVELS, rel=0.03)
    assert levels["mean"] == pytest.approx(0.1, rel=0.03)
    assert "coulomb_friction.level differs between the logs: 0.1" in improved["verdict_text"]
    for log in LEVELS:
        assert any(line.startswith(f"{log}: coulomb_friction.level is 0.") for line in improved["warnings"])


def test_the_schema_of_diagnose_has_them_too():
    one, other = published("diagnose")["properties"], published("improve")["oneOf"][0]["properties"]
    assert one["levels"] == other["levels"]


def test_improve_writes_the_mean_and_its_history_has_the_levels(improved, rig):
    model = load_config(rig / "better.toml").model
    assert model.effects["coulomb_friction"]["level"] == pytest.approx(0.1, rel=0.03)
    text = (rig / "better.toml").read_text()
    last = tomllib.loads(text)["history"][-1]
    assert last["levels"] == {"coulomb_friction.level": pytest.approx(list(LEVELS.values()), rel=0.03)}
    assert all(0.0 < e < 0.01 for e in last["level_errors"]["coulomb_friction.level"])
    assert "[model] has their mean, each log counting once" in text


def test_undo_takes_the_levels_back_too(improved, rig):
    text = (rig / "better.toml").read_text()
    for _ in tomllib.loads(text)["history"]:
        done("improve", "--undo", "-c", "better.toml", cwd=rig)
    assert (rig / "better.toml").read_text() == HEAD


# -- beside a value that is told wrongly ------------------------------------------------------------------------------


def test_a_wrong_inertia_is_not_paid_for_by_effects_where_levels_differ_too(rig):
    """The first look must know levels: without them it explains nothing, and is silent."""
    got = done("improve", *LEVELS, "--auto", "--fix", "inertia=0.013", "--format", "json", cwd=rig)
    found = json.loads(got.stdout)
    assert [one["value"] for one in found["against_told"]] == ["inertia"]
    assert found["probability"] <= 0.5
    assert {step["effect"] for step in found["ladder"]} <= {"as given", "refit", "inertia", "gravity"}


@pytest.mark.parametrize("level", [0.13, 0.1], ids=["of one log", "the mean"])
def test_a_level_that_is_held_is_held_in_every_log(rig, level):
    """What each of them says instead is said, and no other value is said to differ in its place."""
    told = ("--fix", f"coulomb_friction.level={level}", "--fix", "delay=0.004")
    got = done("diagnose", *LEVELS, *told, "--format", "json", cwd=rig, effects=RIVALS)
    found = json.loads(got.stdout)
    (against,) = found["against_told"]
    assert (against["value"], against["told_by"], against["gave_way"]) == ("coulomb_friction.level", "held", False)
    said = {log: float(value) for value, log in re.findall(r"(\S+) \+- \S+ \((\w+\.csv)\)", against["text"])}
    assert said == pytest.approx(LEVELS, rel=0.03)
    assert "levels" not in found
    assert found["probability"] <= 0.5


# -- a level of the model that is wrong, and nothing else -------------------------------------------------------------


def test_a_wrong_value_of_an_effect_that_the_model_has_is_no_effect_that_is_missing(rig):
    """Its value, and what it is in the model, are said; the way on is one that the tool goes."""
    weight = "\n[model.effects.gravity]\namplitude = 0.1\nphase = 0.2\n"
    (rig / "known.toml").write_text(HEAD.replace("level = 0.1", "level = 0.2") + weight)
    shown = done("diagnose", "cold.csv", "-c", "known.toml", cwd=rig, effects=RIVALS).stdout
    assert shown.startswith("coulomb_friction.level 0.2 of [model] is wrong: level 0.1")
    assert "is missing" not in shown.splitlines()[0]
    assert "-> dsd improve LOG -o FILE fits all values of the model again" in shown
    assert "all values fitted again, from" in shown
    got = done("improve", "cold.csv", "-c", "known.toml", "--auto", "--format", "json", cwd=rig, effects=RIVALS)
    values = json.loads(got.stdout)["values"]
    assert values["coulomb_friction.level"]["value"] == pytest.approx(LEVELS["cold.csv"], rel=0.03)


def test_a_held_out_log_with_another_level_is_no_noise(rig):
    """The model is right for the log that it was fitted to; of the other one its own level is said, in one band."""
    got = done("improve", "cold.csv", "--auto", "--holdout", "warm.csv", "-o", "aside.toml", cwd=rig, effects=RIVALS)
    last, *_ = [line for line in got.stdout.splitlines() if "nothing is missing" in line]
    assert "in cold.csv: the force error below" in last
    assert "in warm.csv, which no fit saw, it is" in last
    assert "a value differs there" in last
    (said,) = [line for line in got.stdout.splitlines() if line.startswith("warm.csv, not fitted")]
    level = re.search(r"coulomb_friction.level (\S+) \+-", said)
    assert float(level[1]) == pytest.approx(LEVELS["warm.csv"], rel=0.05)
    bands = set(re.findall(r"force error below (\S+) Hz", got.stdout))
    assert len(bands) == 1


def test_compare_says_which_log_is_further_off(rig):
    """A model that is right for the cold axis: the warm log alone is off in force, which d_hat hides behind the steps
    of the encoder; compare points to levels."""
    levels = HEAD.replace("level = 0.1", "level = 0.13") + "\n[model.effects.gravity]\namplitude = 0.1\nphase = 0.2\n"
    (rig / "cold.toml").write_text(levels)
    last = done("compare", *LEVELS, "-c", "cold.toml", cwd=rig).stdout.splitlines()[-1]
    assert re.search(r"warm.csv is \S+ times as far off as cold.csv: where friction or an offset differs", last)
    alone = done("compare", "warm.csv", "-c", "cold.toml", cwd=rig).stdout.splitlines()[-1]
    assert "times as far off" not in alone
