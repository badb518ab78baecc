"""The fit in the user's hands, by the real command on a sample log whose truth is known: hold, compare, cut."""

import json
import re
from pathlib import Path

import pytest

from tests.cli.rig import FEW, done

SAMPLES = Path(__file__).parents[2] / "sample_logs"
LOG, KNOWN, BARE = "servo-friction.csv", "servo-friction.toml", "servo-bare.toml"
#: Of servo-friction.toml, with which the log was made.
TRUTH = {"inertia": 0.01, "delay": 0.002, "viscous_friction.coefficient": 0.01, "coulomb_friction.level": 0.15}


def test_a_held_model_is_not_fitted_and_is_judged_on_what_no_fit_saw(tmp_path):
    units = ["--set", 'signals.u_unit="N m"', "--set", 'signals.position_unit="rad"']
    held = ["--hold", "--auto", "--to", "2", "--holdout", LOG, *units]
    out = done("improve", LOG, "-c", KNOWN, *held, "-o", tmp_path / "held.toml", cwd=SAMPLES, effects=FEW).stdout
    for name, value in TRUTH.items():
        (line,) = [row for row in out.splitlines() if row.strip().startswith(name)]
        assert line.split()[1] == f"{value:g}"
        assert line.split()[-1] == "held"
    assert "kg m^2" in out
    assert "(N m)/(rad/s)" in out
    assert "unit of u" not in out
    assert "without its part up to 2 s), not fitted: force error" in out
    assert "with levels of its own" in out
    assert "free simulation, open loop from the logged u: position " in out
    assert "; closed loop from the logged reference: position " in out


def test_a_value_of_an_effect_that_the_model_lacks_is_not_ignored_in_silence():
    said = done("compare", LOG, "-c", BARE, "--fix", "coulomb_friction.level=0.1", cwd=SAMPLES).stderr
    assert "--fix coulomb_friction.level=0.1 changes nothing here" in said
    assert "--effect coulomb_friction:level=0.1 puts it in" in said
    assert (
        "changes nothing"
        not in done("compare", LOG, "-c", KNOWN, "--fix", "coulomb_friction.level=0.1", cwd=SAMPLES).stderr
    )


def test_two_models_on_one_log(tmp_path):
    out = done("compare", LOG, "-c", KNOWN, "-c", BARE, cwd=SAMPLES).stdout
    assert f"{KNOWN} is better than {BARE}" in out
    twin = tmp_path / "twin.toml"
    twin.write_text((SAMPLES / KNOWN).read_text())
    same = done("compare", LOG, "-c", KNOWN, "-c", twin, cwd=SAMPLES).stdout
    assert "indistinguishable on this log" in same


def test_a_horizon_in_seconds_begins_anew(tmp_path):
    off = {}
    for horizon in ("200ms", "1s"):
        made = done("compare", LOG, "-c", BARE, "--horizon", horizon, "--format", "json", cwd=SAMPLES)
        off[horizon] = json.loads(made.stdout)["rmse"]
    assert 0.0 < off["200ms"] < off["1s"]


def test_what_stops_on_a_bound_or_pulls_against_its_prior_is_said(tmp_path):
    told = ["--bounds", "viscous_friction.coefficient=0:0.005", "--prior", "inertia=0.012+-0.833333%"]
    made = done("diagnose", LOG, "-c", KNOWN, *told, cwd=SAMPLES, effects=FEW)
    words, verdict = made.stderr, made.stdout.splitlines()[0]
    assert "contradicts the given values of inertia and viscous_friction.coefficient: look at that first" in verdict
    # drag stands in for the friction that the bound keeps out: it is named, and not sure
    assert 0 < int(re.search(r"probability (\d+) %", verdict)[1]) <= 50
    assert "viscous_friction.coefficient stands on its upper bound, 0.005" in words
    assert "pulls against its prior 0.012 +- 0.0001" in words  # a share of the mean


def test_what_stands_in_for_an_effect_that_was_told_wrongly_is_not_sure():
    """Coulomb friction is missing, 0.15; with a wrong size told of it something else takes its place."""
    held = ("--to", "2", "--fix", "coulomb_friction.level=0.4")
    made = done("diagnose", LOG, "-c", BARE, *held, cwd=SAMPLES, effects=FEW)
    verdict = made.stdout.splitlines()[0]
    assert "this log contradicts the given values of coulomb_friction.level: look at that first" in verdict
    assert int(re.search(r"probability (\d+) %", verdict)[1]) <= 50
    (line,) = [row for row in made.stderr.splitlines() if "is held at 0.4; this log alone says" in row]
    assert float(line.split("says ")[1].split()[0]) == pytest.approx(0.15, abs=0.01)


def test_an_inertia_in_another_unit_is_said():
    """kg cm^2 held as kg m^2: no delay near the one that such an axis would have is that of this one."""
    said = done("diagnose", LOG, "-c", KNOWN, "--to", "2", "--fix", "inertia=100", cwd=SAMPLES, effects=FEW)
    (line,) = [row for row in said.stderr.splitlines() if "inertia is held at 100; this log alone says" in row]
    assert float(line.split("says ")[1].split()[0]) == pytest.approx(TRUTH["inertia"], rel=0.05)
    assert "this log contradicts the given values of inertia" in said.stdout.splitlines()[0]


def test_a_creep_at_the_end_of_a_log_is_no_push(tmp_path):
    """Up to 2.95 s the log ends soon after a creep of 0.05 s, in which the logged speed does not tell the direction:
    the slope of the position, which is quieter, does."""
    made = done("diagnose", LOG, "-c", KNOWN, "--to", "2.95", "--format", "json", cwd=SAMPLES)
    found = json.loads(made.stdout)
    assert (found["verdict"], found["found"]) == ("none", [])


def test_a_horizon_longer_than_the_log_says_that_nothing_was_begun_anew():
    restarts = {}
    for horizon in ("500s", "0.5s"):
        made = done("compare", LOG, "-c", BARE, "--horizon", horizon, "--format", "json", cwd=SAMPLES)
        restarts[horizon] = json.loads(made.stdout)["restarts"]
    assert restarts == {"500s": 0, "0.5s": 5}
    said = done("compare", LOG, "-c", BARE, "--horizon", "500s", cwd=SAMPLES).stdout
    assert "never begun anew: the log has no stretch longer than 500 s" in said
    assert "so nothing was begun anew" in said.splitlines()[-1]
    assert "from a measured state" not in said


@pytest.mark.parametrize(
    "command",
    [("tune", "--format", "json"), ("detect", "--method", "dsd,imm", "--format", "json")],
    ids=lambda one: one[0],
)
def test_a_part_of_a_log_is_the_log_of_that_part(command, tmp_path):
    """What is said of a part is what is said of a file that holds no more."""
    header, *rows = (SAMPLES / LOG).read_text().splitlines()
    part = [row for row in rows if 1.0 <= float(row.split(",")[0]) <= 2.0]
    (tmp_path / LOG).write_text("\n".join([header, *part]) + "\n")
    for beside in (BARE, f"{LOG}.meta.json"):
        (tmp_path / beside).write_text((SAMPLES / beside).read_text())

    def said(*window: str, cwd: Path) -> list[str]:
        lines = done(*command, LOG, "-c", BARE, *window, cwd=cwd).stdout.splitlines()
        return [line for line in lines if "nanoseconds" not in line]

    assert said("--from", "1", "--to", "2", cwd=SAMPLES) == said(cwd=tmp_path)


def test_effects_that_only_one_of_two_models_has_are_said():
    """From either side; and why there is no sigma."""
    effects = "viscous_friction and coulomb_friction"
    line = f"only {KNOWN} has {effects}; {BARE} has no value of them (-)"
    for configs in (("-c", BARE, "-c", KNOWN), ("-c", KNOWN, "-c", BARE)):
        out = done("compare", *configs, cwd=SAMPLES).stdout.splitlines()
        assert out.count(line) == 1
        assert out[-1].startswith("no sigma: ")
        assert "[[history]]" in out[-1]


def test_too_few_blocks_are_no_verdict_on_two_models():
    """Half a second: fewer blocks than the better one must win for 1 in 100 of random signs."""
    out = done("compare", LOG, "-c", KNOWN, "-c", BARE, "--from", "0.2", "--to", "0.6", cwd=SAMPLES).stdout
    (line,) = [row for row in out.splitlines() if "too few" in row]
    assert int(line.split()[0]) < 8
    assert f"{KNOWN} leaves" in line
    assert "indistinguishable on this log" not in out
