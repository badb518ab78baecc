"""A value that is told wrongly: nothing takes its place in silence, and no verdict beside it is sure."""

import json
import re
from pathlib import Path

import pytest

from tests.cli.rig import FEW, done

SAMPLES = Path(__file__).parents[2] / "sample_logs"
LOG, KNOWN, BARE = "servo-friction.csv", "servo-friction.toml", "servo-bare.toml"
#: Of servo-friction.toml, with which the log was made.
COULOMB, VISCOUS = 0.15, 0.01


def improved(*told, config=KNOWN, effects=()):
    made = done("improve", LOG, "-c", config, *told, "--auto", "--format", "json", cwd=SAMPLES, effects=effects)
    return json.loads(made.stdout), made.stderr


@pytest.mark.parametrize(
    ("config", "told", "value", "kind"),
    [
        (KNOWN, ("--prior", "coulomb_friction.level=0.1+-0.000001"), "coulomb_friction.level", "prior"),
        (BARE, ("--bounds", "viscous_friction.coefficient=0.02:0.05"), "viscous_friction.coefficient", "bound"),
        (BARE, ("--fix", "inertia=0.013"), "inertia", "held"),
    ],
    ids=["narrow prior", "bounds", "held inertia"],
)
def test_nothing_is_added_in_place_of_a_value_that_was_told_wrongly(config, told, value, kind):
    found, words = improved(*told, "--to", "1.5", config=config)
    assert found["probability"] <= 0.5
    assert found["verdict_text"].count(f"contradicts the given values of {value}: look at that first") == 1
    (against,) = found["against_told"]
    assert (against["value"], against["told_by"], against["gave_way"]) == (value, kind, False)
    taken = {step["effect"] for step in found["ladder"]} - {"as given", "refit"}
    assert taken <= {"coulomb_friction", "viscous_friction"}  # what the log was made with
    assert "this log alone says" in words or "alone it says" in words
    assert words.splitlines()[0].startswith(f"dsd: this log contradicts the given values of {value}")


def test_a_prior_that_gives_way_leaves_the_verdict_alone():
    """And the error of the last rung is that of the verdict: beside a prior every step is fitted anew."""
    bare = ("--set", "model.effects.viscous_friction.coefficient=0.02", "--prior", "inertia=0.012+-0.0002")
    found, words = improved(*bare, "--to", "1.2", effects=FEW)
    assert found["verdict"] == "none"
    assert found["probability"] > 0.5
    assert "against the prior of inertia, which gave way" in found["verdict_text"]
    assert found["values"]["inertia"]["value"] == pytest.approx(0.01, rel=1e-3)
    assert "pulls against its prior 0.012 +- 0.0002" in words
    shown = re.search(r"-> (\S+) unit of u .*error below \S+ Hz(?:,| is) (\S+) \(unit of u\)", found["verdict_text"])
    assert shown[1] == shown[2] == f"{found['ladder'][-1]['heldout_rmse']:.3g}"


def test_what_is_told_rightly_changes_no_verdict():
    told = ("--fix", f"coulomb_friction.level={COULOMB}", "--bounds", f"viscous_friction.coefficient=0:{2 * VISCOUS}")
    made = done("diagnose", LOG, "-c", KNOWN, *told, "--to", "1.2", "--format", "json", cwd=SAMPLES)
    found = json.loads(made.stdout)
    assert (found["verdict"], found["against_told"]) == ("none", [])
    assert found["probability"] > 0.5
    assert "against" not in made.stderr


def test_parts_of_the_data_confirm_nothing_that_was_told_for_all_of_them():
    """They are not asked where the verdict is in doubt without them; that it is, is what matters."""
    made = done(
        "diagnose", LOG, "-c", BARE, "--bounds", "viscous_friction.coefficient=0.02:0.05", cwd=SAMPLES, effects=FEW
    )
    lines = [row for row in made.stdout.splitlines() if row.startswith("the same with")]
    assert all(row.endswith("as given: no confirmation of that") for row in lines)
    verdict = made.stdout.splitlines()[0]
    assert int(re.search(r"probability (\d+) %", verdict)[1]) <= 50


@pytest.mark.parametrize(
    ("told", "value", "bound"),
    [
        ("coulomb_friction.level=0.2:0.3", "coulomb_friction.level", "lower bound, 0.2: the log asks for less"),
        ("delay=0.004:0.01", "delay", "lower bound, 0.004: the log asks for less"),
    ],
)
def test_a_bound_that_the_truth_is_beyond_is_no_prior_that_gave_way(told, value, bound):
    """The verdict was 95 and 98 % sure; drag is missing as well, so that the log alone is two sigma off only."""
    made = done("diagnose", LOG, "-c", BARE, "--bounds", told, "--format", "json", cwd=SAMPLES, effects=FEW)
    found = json.loads(made.stdout)
    assert found["probability"] <= 0.5
    assert f"contradicts the given values of {value}: look at that first" in found["verdict_text"]
    assert bound in made.stderr
