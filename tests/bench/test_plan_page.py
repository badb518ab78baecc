"""The figures of docs/measured/plan.md out of the rows of `python -m bench plan`."""

import json
from pathlib import Path

import pytest

from bench import plan
from bench.plan_page import figures


def test_the_old_motion_is_asked_of_the_first_logs_of_all_runs_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plan, "RESULTS", tmp_path / "plan.json")
    monkeypatch.setattr(plan, "one", lambda case, kind, *, old: {"seed": case.seed, "old": old})
    plan.main(["--most", "2", "--old", "3"])
    plan.main(["--most", "2", "--old", "3", "--first", "2", "--more"])
    assert [row["old"] for row in json.loads(plan.RESULTS.read_text())["plans"]] == [True, True, True, False]


def test_limits_and_what_no_motion_identifies_are_figures_of_the_page():
    limits = [
        {"plans": 5, "broken": [{"u": 0.1}], "refused": 0, "cpu": [2.0, 9.0, 3.0, 3.0, 3.0]},
        {"plans": 4, "broken": [{"u": 0.02}, {"velocity": 0.08}], "refused": 1, "cpu": [3.0] * 4},
    ]
    impossible = [{"seed": 1, "gain": True, "load": False}, {"seed": 2, "gain": True, "load": True}]
    lines = figures({"limits": limits, "impossible": impossible})
    assert (
        "- a limit broken by one of five plans of a log: 3 of 9 plans of 2 logs, by 10.0 % at most; 1 refused" in lines
    )
    assert "- a limit broken by any of all these plans: 3 of 9" in lines
    assert "- CPU of one of five: 3.0 s in the middle, 9.0 s at most" in lines
    assert "- what no motion identifies, gain: right in 2 of 2" in lines
    assert "- what no motion identifies, load: right in 1 of 2" in lines


def test_nats_are_within_a_factor_of_two_or_are_not():
    row = {"what": "gravity", "kind": "slow", "sensing": "enc4096", "verdict": "unknown", "cpu": 2.0, "broken": {}}
    row |= {"after": "gravity", "settled": True, "after_old": "unknown", "settled_old": False}
    lines = figures({"plans": [row | {"realised": [(100.0, 201.0), (100.0, 51.0), (900.0, 3000.0), (40.0, 10.0)]}]})
    assert "- realised nats within a factor of 2 of the expected: 1 of 4 pairs" in lines
    assert "- within a factor of 2, or both beyond 500: 2 of 4 pairs" in lines
    assert "- realised nats less than half of the expected: 1 of 4 pairs" in lines
    assert lines[-1].startswith("| gravity | slow, enc4096 | unknown | gravity | unknown, not settled | 100, 201; ")


def test_what_was_not_asked_is_no_fault():
    assert not any("loops" in line for line in figures({}))
    row = {"what": "gravity", "kind": "slow", "sensing": "enc4096", "verdict": "unknown", "cpu": 2.0, "broken": {}}
    row |= {"after": "gravity", "settled": False, "realised": []}
    rows = [row | {"loop": {"settled": s, "experiments": 3, "broken": [{}, {"u": 0.1}]}} for s in (True, False)]
    lines = figures({"plans": [*rows, row | {"settled_old": True, "after_old": "gravity"}]})
    assert "- loops settled within three experiments: 1 of 2, by one: 0 of 2" in lines
    assert "- a limit broken by the second and third plans of these loops: 2 of 4" in lines
    assert (
        "- of 1 also run with the old motion for as long, settled after the planned one 0, after the old one 1" in lines
    )
    assert lines[-2].endswith("| gravity, not settled | - | - | 2.0 |")
