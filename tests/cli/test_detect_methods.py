"""`dsd detect --method`: one for this run, or several side by side."""

import json
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.detect import Grid
from dsd_cli.detect.rows import Rows
from dsd_cli.detect.side_by_side import score
from tests.cli.rig import done, dsd, refused

EVENTS = "simulate.events=[{time=1.5, delay=0.4}, {time=2.5, inertia=0.5}]"
RUN = ("simulate", "--template", "paper-sine", "--noise", "1.0", "--duration", "3.5", "--set", EVENTS, "-o", "log.csv")
ALL = "dsd,average,combination,imm,viterbi,smooth,profile"

SOME = "dsd,combination,viterbi"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    here = tmp_path_factory.mktemp("methods")
    done("init", "--template", "paper-sine", cwd=here)
    done(*RUN, cwd=here)
    return here


def test_each_line_is_what_the_method_gives_alone(folder):
    table = json.loads(done("detect", "log.csv", "--method", SOME, "--format", "json", cwd=folder).stdout)
    assert [one["method"] for one in table["methods"]] == SOME.split(",")
    for one in table["methods"]:
        alone = json.loads(done("detect", "log.csv", "--method", one["method"], "--format", "json", cwd=folder).stdout)
        assert alone["method"] == one["method"]
        assert alone["judged"] == one["judged"]
        assert alone["truth"]["share_correct"] == pytest.approx(one["share_correct"], abs=1e-12)
        assert one["changes"] == 2
        assert one["nanoseconds"] > 0
    dsd_line = table["methods"][0]
    assert (dsd_line["followed"], dsd_line["detection_delay"] < 0.1) == (2, True)


def test_the_table_names_every_method(folder):
    said = done("detect", "log.csv", "--method", ALL, cwd=folder).stdout
    assert [line.split()[0] for line in said.splitlines() if line.split() and line.split()[0] in ALL.split(",")] == (
        ALL.split(",")
    )
    assert "2 of 2" in said
    narrow = done("detect", "log.csv", "--method", ALL, cwd=folder, COLUMNS="80").stdout
    assert "\u2026" not in narrow  # every cell whole
    assert "e+" not in narrow
    truthless = ("--set", 'signals.true_delay=""', "--set", 'signals.true_inertia=""')
    assert "switches" in done("detect", "log.csv", "--method", "dsd,imm", *truthless, cwd=folder).stdout


def test_the_numbers_of_a_log_counted_by_hand():
    """Truth 0.1 then 0.2 s at row 100; the label follows at row 130, is right until 180, and strays once."""
    t, n = 0.01 * np.arange(200), 200
    state = np.where(np.arange(n) < 130, 0, 1).astype(np.int32)
    state[40:43] = 1  # a false switch and the way back
    state[180:] = 0
    rows = Rows(t, state, np.zeros(n), np.ones(n), np.arange(n) >= 150, np.ones(n, dtype=np.int32))
    truth = {"true_delay": np.where(np.arange(n) < 100, 0.1, 0.2), "true_inertia": np.ones(n)}

    class Took:
        seconds, samples = 2e-4, 200

    found = score("dsd", [rows], truth, Grid((0.1, 0.2), (1.0,)), Took())
    assert found.share_correct == pytest.approx((97 + 50) / 200)
    assert found.share_correct_confident == pytest.approx(30 / 50)
    assert (found.changes, found.followed) == (1, 1)
    assert found.detection_delay == pytest.approx(0.3)
    assert (found.switches, found.false_switches) == (4, 2)
    assert found.nanoseconds == pytest.approx(1000.0)


def test_what_cannot_be_compared_is_one_line(folder):
    for options, text in (
        (("--method", "dsd,nothing"), "no method 'nothing'"),
        (("--method", "dsd,dsd"), "each method once"),
        (("--method", "dsd,imm", "-o", "x.csv"), "only compared"),
        (("--method", "dsd,imm", "--format", "csv"), "only table and json"),
    ):
        refused(dsd("detect", "log.csv", *options, cwd=folder), 2, text)
    refused(dsd("detect", "-", "--method", "dsd,imm", "--format", "table", cwd=folder), 2, "read again")


def test_a_log_whose_truth_never_changes(tmp_path):
    samples = Path(__file__).parents[2] / "sample_logs"
    config = samples / "servo-friction.toml"
    ran = done("detect", samples / "servo-friction.csv", "-c", config, "--method", "dsd,viterbi", cwd=tmp_path)
    assert "viterbi" in ran.stdout


def test_a_log_whose_true_state_never_changes_has_no_changes_to_follow(tmp_path):
    done("init", "--template", "damping", cwd=tmp_path)
    done("simulate", "-o", "log.csv", cwd=tmp_path)
    table = json.loads(done("detect", "log.csv", "--method", SOME, "--format", "json", cwd=tmp_path).stdout)
    for one in table["methods"]:
        assert (one["changes"], one["followed"], one["detection_delay"]) == (0, 0, None)
        assert one["share_correct"] > 0.9
    assert "viterbi" in done("detect", "log.csv", "--method", SOME, cwd=tmp_path).stdout
