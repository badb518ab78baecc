"""Play whose load has Coulomb friction of its own, from the log to the config."""

import json
import tomllib
from pathlib import Path

import pytest

from dsd_cli.files.logs import load_log
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.play import Play
from dsd_cli.identify.search.response import response_of
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import ObserverSettings, PlantModel
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


def test_adding_it_finds_what_diagnosing_does(axis):
    """Friction that the model lacks hides a play from the balance of forces: the fit of the play alone ended at a gap
    of several times the true one. In the response it is found beside friction."""
    found = json.loads(done("add", "log.csv", "backlash", "-c", "bare.toml", "-o", "added.toml", "--format", "json",
                            cwd=axis).stdout)  # fmt: skip
    values = tomllib.loads((axis / "added.toml").read_text(encoding="utf-8"))["model"]["effects"]
    assert values == {"backlash": pytest.approx(TRUTH, rel=0.08)}
    assert found["effect"] == "backlash"


def test_friction_of_a_load_that_is_not_identifiable_is_the_motors(axis, monkeypatch):
    """It was taken off the motor, and written nowhere."""
    model = PlantModel(0.01, 0.002)
    log = load_log(axis / "log.csv", {name: name for name in ("t", "u", "position", "velocity")}).log
    search = Search(pose([prepare(log, ObserverSettings(0.01, 0.005))], model, Settings(("backlash",))))
    known = Play.values

    def unsure(*args):
        return {name: pair for name, pair in known(*args).items() if name != "load_level"}

    monkeypatch.setattr(Play, "values", unsure)
    seen = response_of(search, search.refit, ("backlash",), doubtful=True).seen
    assert seen.model.effects["coulomb_friction"]["level"] == pytest.approx(TRUTH["load_level"], rel=0.1)
