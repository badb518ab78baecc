"""Play whose load has Coulomb friction of its own, from the log to the config."""

import json
from pathlib import Path

import pytest

from tests.cli.rig import done

BARE = (Path(__file__).parents[2] / "sample_logs" / "servo-bare.toml").read_text(encoding="utf-8")
TRUTH = {"gap": 0.02, "load_share": 0.4, "stiffness": 50.0, "load_level": 0.02}


@pytest.fixture(scope="module")
def axis(tmp_path_factory):
    folder = tmp_path_factory.mktemp("axis")
    (folder / "bare.toml").write_text(BARE, encoding="utf-8")
    values = ",".join(f"{name}={value}" for name, value in TRUTH.items())
    done("simulate", "-c", "bare.toml", "--effect", f"backlash:{values}", "--duration", 4, "-o", "log.csv", cwd=folder)
    return folder


def test_its_level_is_found_with_the_gap(axis):
    found = json.loads(done("diagnose", "log.csv", "-c", "bare.toml", "--format", "json", cwd=axis).stdout)
    assert found["verdict"] == "backlash"
    (named,) = (one for one in found["ranking"] if one["effect"] == "backlash")
    values = {name: one["value"] for name, one in named["parameters"].items()}
    assert values == pytest.approx(TRUTH, rel=0.08)


@pytest.mark.parametrize(
    "told", [("--bounds", "backlash.load_level=0:1"), ("--prior", "backlash.load_level=0.02+-0.01")]
)
def test_what_is_known_of_a_level_that_the_model_does_not_have_is_no_error(axis, told):
    """KeyError: an optional parameter that a config leaves out is 0."""
    model = "".join(f"{name} = {value}\n" for name, value in TRUTH.items() if name != "load_level")
    (axis / "played.toml").write_text(f"{BARE}\n[model.effects.backlash]\n{model}", encoding="utf-8")
    said = done("add", "log.csv", "viscous_friction", "-c", "played.toml", *told, "-o", "-", cwd=axis)
    assert "viscous_friction" in said.stdout
