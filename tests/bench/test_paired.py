"""The paired study: how an answer is judged, what pairs and probabilities amount to, one log through an engine."""

import json
from pathlib import Path

import pytest

from bench import machines, paired, paired_ask
from bench import paired_score as score
from bench.engines import ROOT, Asked, Engine
from bench.machines_cases import RECORDED, Recorded


def row(**more):
    usual = {"engine": "a", "tier": "x", "seed": 1, "digest": "d", "hidden": ["gravity"], "judged": "one", "also": []}
    usual |= {"tied": False, "verdict": "gravity", "probability": 0.95, "ties": [], "named": ["gravity"], "values": []}
    return usual | more


@pytest.mark.parametrize(
    ("more", "is_right", "is_sure_and_wrong"),
    [
        ({}, True, False),
        ({"verdict": "stiffness"}, False, True),
        ({"verdict": "stiffness", "probability": 0.8}, False, False),
        ({"verdict": "stiffness", "ties": ["gravity"]}, False, False),
        ({"verdict": "stiffness", "ties": ["gravity"], "tied": True}, True, False),
        ({"verdict": "delay", "also": ["delay"]}, True, False),
        ({"verdict": "none"}, False, True),
        ({"verdict": "unknown"}, False, False),
        ({"verdict": "error", "probability": 0.0}, False, False),
        ({"judged": "none", "hidden": [], "verdict": "none"}, True, False),
        ({"judged": "none", "hidden": [], "verdict": "inertia"}, False, True),
        ({"judged": "stranger", "hidden": ["eddy_brake"], "verdict": "unknown"}, True, False),
        ({"judged": "stranger", "hidden": ["eddy_brake"], "verdict": "none"}, False, True),
        ({"judged": "set", "verdict": "none", "hidden": ["gravity", "inertia"]}, True, False),
        ({"judged": "set", "verdict": "none", "named": ["gravity", "cogging"]}, False, True),
        ({"judged": "set", "verdict": "none", "named": [], "hidden": ["gravity"]}, False, True),
        ({"judged": "set", "verdict": "unknown", "named": ["gravity"], "hidden": ["gravity", "cogging"]}, False, False),
    ],
)
def test_answers_are_judged(more, is_right, is_sure_and_wrong):
    assert score.right(row(**more)) is is_right
    assert score.sure_and_wrong(row(**more)) is is_sure_and_wrong


def test_discordant_pairs_of_the_same_log_alone_count():
    rows = [row(seed=s, engine=e, verdict=v) for s in range(9) for e, v in (("a", "gravity"), ("b", "cogging"))]
    rows += [row(seed=20, engine="a"), row(seed=20, engine="b", digest="other", verdict="none")]
    pairs = score.paired(rows, "a", "b")
    assert len(pairs) == 9
    only_a, only_b, p = score.mcnemar(pairs)
    assert (only_a, only_b) == (9, 0)
    assert p == pytest.approx(2.0 * 0.5**9)


def test_calibration_counts_each_verdict_in_its_bin():
    bins = score.reliability([(0.95, True), (0.97, False), (1.0, True), (0.2, False)])
    assert [(b.low, b.hits, b.of) for b in bins] == [(0.0, 0, 1), (0.95, 1, 2), (0.99, 1, 1)]
    assert score.brier([(1.0, True), (0.5, False)]) == pytest.approx(0.125)


def test_the_probability_of_a_tie_is_that_of_its_first():
    half = row(probability=0.5, ties=["gravity"], tied=True, verdict="stiffness")
    assert score.right(half)
    assert score.stated(half) == (0.5, False)
    assert score.stated(row(probability=0.5, ties=["stiffness"], tied=True)) == (0.5, True)


def test_each_effect_that_is_listed_is_one_answer():
    """A second cogging is there where cogging is; what a log's maker counts as one effect as well is, too."""
    listed = [{"effect": "cogging_2", "probability": 0.8}, {"effect": "gravity", "probability": 0.3}]
    found = row(hidden=["cogging"], verdict="cogging", missing=listed)
    assert score.names(found) == [(0.8, True), (0.3, False)]
    assert score.names({**found, "also": ["gravity"]}) == [(0.8, True), (0.3, True)]
    assert score.names({**found, "verdict": "error"}) == score.names({**found, "missing": None}) == []


def test_phases_go_round_and_turn_with_their_amplitude():
    values = [
        {"name": "gravity.amplitude", "true": 2.0, "value": -2.1, "std_error": 0.1},
        {"name": "gravity.phase", "true": 0.1, "value": 0.1 - 3.14159265, "std_error": 0.1},
        {"name": "inertia", "true": 1.0, "value": 1.3, "std_error": 0.1},
    ]
    found = [paired_ask.deviation(v, values) for v in values]
    assert found == pytest.approx([1.0, 0.0, 3.0], abs=1e-6)
    assert score.coverage([row(values=values)]) == score.Coverage(2, 3)
    assert score.coverage([row(values=values, verdict="none")]) == score.Coverage(0, 0)


def test_logs_are_dealt_out_by_weight():
    tiers = paired.all_tiers(None)
    dealt = paired.counts(tiers, 1500)
    assert len(dealt) == len(tiers)  # no name twice
    assert abs(sum(dealt.values()) - 1500) < 0.05 * 1500
    assert dealt["over a background"] > dealt["geared joint"] > dealt["4 kHz"]


PLUGGED = """
import numpy as np
from tests.oracle.questions import Question, Tier

def draw(seed):
    rng, t = np.random.default_rng(seed), 0.002 * np.arange(3000)
    v = np.cumsum(np.convolve(rng.standard_normal(3000), np.hanning(300), "same")) * 1e-4
    u = 0.5 * np.gradient(v, t) + 0.8 * v + 0.001 * rng.standard_normal(3000)
    believed = {"inertia": 0.5, "delay": 0.0, "effects": {}}
    truth = believed | {"effects": {"viscous_friction": {"coefficient": 0.8}}}
    observer = {"nominal_inertia": 0.5, "time_constant": 0.01}
    return Question(("viscous_friction",), {"t": t, "u": u, "velocity": v}, believed, observer, truth)

def tiers():
    return [Tier("plugged", draw)]
"""


def test_a_tier_from_a_file_is_asked_of_an_engine_once(tmp_path, capsys):
    (tmp_path / "mine.py").write_text(PLUGGED)
    output = tmp_path / "rows.jsonl"
    words = ["--tiers-from", str(tmp_path / "mine.py"), "--only", "plugged", "--logs", "1", "--workers", "1"]
    for _ in range(2):
        paired.main([*words, "--output", str(output), "--engine", f"here={ROOT}"])
    (kept,) = [json.loads(line) for line in output.read_text().splitlines()]
    assert "| plugged | 1 of 1 | 0 |" in capsys.readouterr().out
    assert kept["verdict"] == "viscous_friction"
    assert kept["seconds"] > 0.0
    (value,) = [v for v in kept["values"] if v["name"] == "viscous_friction.coefficient"]
    assert value["value"] == pytest.approx(0.8, rel=0.05)


def test_an_engine_that_is_none_and_a_command_that_fails(tmp_path):
    with pytest.raises(SystemExit, match="no checkout"):
        Engine.of(f"x={tmp_path}")
    engine = Asked(Engine.of(f"here={ROOT}"))
    (tmp_path / "dsd.toml").write_text(CASE.config())
    done = engine.run("diagnose", "absent.csv", cwd=tmp_path)
    engine.close()
    assert done["code"] != 0
    assert "absent.csv" in done["err"]


CASE = Recorded("m", (), {}, 1.0, must=("gravity", "coulomb_friction|load_friction"), must_not=("dead_zone",), first=1)


@pytest.mark.parametrize(
    ("steps", "met", "violated"),
    [
        (["gravity", "load_friction"], 3, []),
        (["refit", "gravity", "coulomb_friction", "dead_zone"], 3, ["dead_zone"]),
        (["coulomb_friction", "gravity"], 2, []),
        (["coulomb_friction"], 1, []),
        ([], 0, []),
    ],
)
def test_what_must_be_named_is_counted(steps, met, violated):
    found = machines.judged(CASE, {"verdict": "unknown", "steps": steps, "values": {}})
    assert found["musts"] == 3
    assert (found["met"], found["violated"]) == (met, violated)


def test_every_recording_is_asked_about():
    """All nine machines, by the names of their folders."""
    asked = {Path(log).parts[0] for case in RECORDED for log in case.logs}
    assert asked == {
        *("emps", "bam_xl330", "dfki_pendulum", "kuka_kr300", "rack_pinion"),
        *("odrive_cogging", "silverbox", "hsm150", "frc_drivetrain"),
    }
