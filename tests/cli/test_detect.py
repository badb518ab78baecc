"""`dsd detect` on files: labels, summary, exit codes, settings."""

import json
import os
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.cli.rig import CONFIG, LABELS, RIGHT, done, dsd, make_log, read_labels, refused, same, summary, write


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    (folder / "dsd.toml").write_text(CONFIG)
    write(folder, "log.csv", make_log())
    write(folder, "log.parquet", make_log())
    halves = make_log(), make_log(delay=0.0)
    write(folder, "mixed.csv", halves[0] | {"d_hat": np.where(halves[0]["t"] < 0.15, *(h["d_hat"] for h in halves))})
    return folder


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_one_label_per_row(rig, tmp_path, suffix):
    out = tmp_path / f"labels.{suffix}"
    done("detect", f"log.{suffix}", "-o", out, cwd=rig)
    labels = read_labels(out)
    assert list(labels) == LABELS
    np.testing.assert_array_equal(labels["t"], make_log()["t"])
    assert (labels["state"][:16] == 8).all()  # nothing is known yet: the initial label
    assert np.isnan(labels["log_likelihood"][:16].astype(float)).all()
    assert (labels["state"][60:] == RIGHT).all()
    assert (labels["delay"][60:] == 0.005).all()
    assert (labels["inertia"][60:] == 1.0).all()
    assert labels["confident"][100:].mean() > 0.9
    assert ((labels["probability"][60:] > 0) & (labels["probability"][60:] <= 1)).all()
    if suffix == "parquet":
        kinds = {field.name: str(field.type) for field in pq.read_schema(out)}
        assert kinds["state"] == "int16"
        assert (kinds["confident"], kinds["t"]) == ("bool", "double")


def test_the_summary_as_json_has_the_keys_that_scripts_rely_on(rig):
    log = make_log() | {"true_delay": np.full(300, 0.005), "true_inertia": np.full(300, 1.1)}
    write(rig, "truth.csv", log)
    got = summary("truth.csv", "--expect", "delay=0.005", "--after", "0.1", cwd=rig)
    assert (got["schema_version"], got["command"], got["log"], got["samples"]) == (1, "detect", "truth.csv", 300)
    assert len(got["states"]) == 9
    assert {"index", "delay", "inertia", "share"} <= set(got["states"][0])
    assert sum(state["share"] for state in got["states"]) == pytest.approx(1)
    assert {"start", "end", "state", "delay", "inertia", "confident_share"} <= set(got["segments"][0])
    assert got["segments"][0]["start"] == 0.0
    assert got["segments"][-1]["end"] == 0.299
    assert (got["final"]["delay"], got["final"]["inertia"]) == (0.005, 1.0)
    assert got["dropped"] == []
    assert got["truth"]["share_correct"] > 0.8
    assert got["truth"]["share_correct_confident"] == 1.0
    (check,) = got["checks"]
    assert (check["axis"], check["value"], check["holds"], check["samples"]) == ("delay", 0.005, True, 200)
    assert got["kernel"] in ("compiled", "numpy")


def test_the_summary_for_the_eye(rig):
    said = done("detect", "log.csv", cwd=rig)
    assert said.stderr == ""
    assert "300 samples, 1 ms apart" in said.stdout
    assert "final: delay 0.005, inertia 1 (confident)" in said.stdout
    assert "\x1b" not in said.stdout


EXPECTATIONS = [
    (["--expect", "delay=0", "--expect", "inertia=1", "--after", "0.2"], 0),
    (["--expect", "delay=0.005"], 3),
    (["--expect", "delay=0.005", "--min-share", "0.4"], 0),
    (["--expect", "delay=0", "--after", "0.2"], 0),
    (["--expect", "delay=0", "--after", "0.2", "--confident-only", "--min-share", "1"], 0),
    (["--expect", "delay=0.01", "--min-share", "0"], 0),
    (["--expect", "delay=0", "--expect", "delay=0.01", "--after", "0.2"], 3),
    (["--expect", "delay=0", "--after", "7"], 3),  # of no sample at all nothing can be said
]


@pytest.mark.parametrize(
    ("options", "code"), EXPECTATIONS, ids=lambda x: " ".join(x) if isinstance(x, list) else str(x)
)
def test_expectations_decide_the_exit_code(rig, options, code):
    said = dsd("detect", "mixed.csv", *options, "--format", "json", cwd=rig)
    assert said.returncode == code
    assert all(check["holds"] for check in json.loads(said.stdout)["checks"]) is (code == 0)
    assert said.stderr.startswith("dsd: error: expectation not met: ") if code else said.stderr == ""


@pytest.mark.parametrize(
    ("options", "code", "text"),
    [
        (["--expect", "delay=0.3"], 2, "candidates are 0, 0.005, 0.01"),
        (["--expect", "delay=x"], 2, "'x' is not a number"),
        (["--expect", "mass=1"], 2, "delay, inertia"),
        (["--expect", "delay"], 2, "AXIS=VALUE"),
        (["--min-share", "1.5"], 2, "between 0 and 1"),
        (["--min-share", "nan"], 2, "between 0 and 1"),
        (["--after", "nan", "--expect", "delay=0.005"], 2, "--after nan"),
        (["--after", "1"], 2, "give --expect too"),
        (["--after", "soon"], 2, "is not a number"),
        (["--format", "xml"], 2, "is not one of"),
        (["-o", "-", "--format", "json"], 2, "both want stdout"),
        (["-o", "x.csv", "--format", "jsonl"], 2, "give one"),
        (["-o", "labels.txt"], 2, "end the name in .csv or .parquet"),
        (["-o", "log.csv"], 2, "is the input"),
        (["-o", "nowhere/labels.csv"], 1, "no such folder"),
        (["-o", "/proc/labels.csv"], 1, "cannot be written"),
        (["-c", "none.toml"], 2, "none.toml"),
        (["--set", "detector.window=0"], 2, "detector.window = 0"),
        (["--set", "detector.windw=5"], 2, "did you mean"),
        (["--set", "detector.window=1000000000"], 2, "too much memory"),
        (["--set", "signals.u=torque"], 1, 'no column "torque"'),
        (["--effect", "viscous_friction:coefficient=0.5"], 1, "effect viscous_friction needs it"),
        (["--effect", "rust:x=1"], 2, "rust"),
        (["--set", "detector.transition.file=none.csv"], 2, "cannot be read"),
    ],
    ids=lambda x: " ".join(x) if isinstance(x, list) else "",
)
def test_what_cannot_work_is_one_line(rig, options, code, text):
    refused(dsd("detect", "log.csv", *options, cwd=rig), code, text)


def test_a_read_only_folder(rig, tmp_path):
    if os.getuid() == 0:
        pytest.skip("root may write anywhere")
    tmp_path.chmod(0o555)
    refused(dsd("detect", "log.csv", "-o", tmp_path / "labels.csv", cwd=rig), 1, "cannot be written to")


def test_labels_appear_whole_or_not_at_all(rig, tmp_path):
    text = (rig / "log.csv").read_text()
    bad = tmp_path / "bad.csv"
    bad.write_text(text + "0.3,zero,0\n")
    out = tmp_path / "labels.csv"
    out.write_text("the old ones")
    refused(dsd("detect", bad, "-o", out, cwd=rig), 1, "bad.csv, line 302", '"zero" is not a number')
    assert out.read_text() == "the old ones"
    assert {path.name for path in tmp_path.iterdir()} == {"bad.csv", "labels.csv"}


@pytest.mark.parametrize("method", ["average", "imm", "viterbi", "smooth", "profile"])
def test_the_other_methods(rig, method):
    tuning = ["--set", "detector.average=3"] if method == "average" else []
    got = summary("log.csv", "--set", f"detector.method={method}", *tuning, cwd=rig)
    assert (got["method"], got["samples"]) == (method, 300)
    assert (got["final"]["delay"], got["final"]["inertia"]) == (0.005, 1.0)
    assert got["states"][RIGHT]["confident_share"] > 0.99
    assert 0.01 < got["residual_rms"] < 0.1


def test_a_transition_matrix_from_a_file(rig):
    """Zeros forbid: with only the diagonal the initial label is for ever."""
    np.savetxt(rig / "stay.csv", np.eye(9), delimiter=",")
    got = summary("log.csv", "--set", "detector.transition.file=stay.csv", cwd=rig)
    assert got["states"][8]["share"] == 1.0
    assert got["confident_share"] == 0.0
    free = np.ones((9, 9))
    free[8, :4] = 0.0
    np.savetxt(rig / "free.csv", free, delimiter=",")
    got = summary("log.csv", "--set", "detector.transition.file=free.csv", cwd=rig)
    assert got["final"]["delay"] == 0.005
    np.savetxt(rig / "small.csv", np.eye(4), delimiter=",")
    refused(
        dsd("detect", "log.csv", "--set", "detector.transition.file=small.csv", cwd=rig), 2, "small.csv", "4 x 4", "9"
    )
    (rig / "text.csv").write_text("a,b\n1,2\n")
    refused(dsd("detect", "log.csv", "--set", "detector.transition.file=text.csv", cwd=rig), 2, "not a matrix")


def test_hold_and_initial(rig):
    write(rig, "still.csv", make_log() | {"u": np.zeros(300), "d_hat": np.zeros(300)})
    third = ["--set", "detector.initial.delay=0.005", "--set", "detector.initial.inertia=0.5"]
    got = summary("still.csv", *third, cwd=rig)
    assert got["states"][3]["share"] == 1.0
    assert got["confident_share"] == 0.0
    assert any("u is constant" in warning for warning in got["warnings"])
    refused(dsd("detect", "log.csv", "--set", "detector.initial.delay=0.7", cwd=rig), 2, "0.7", "[0.0, 0.005, 0.01]")
    held = summary("log.csv", "--set", "detector.hold=1e9", cwd=rig)
    assert held["states"][8]["share"] == 1.0


def test_both_kernels_give_the_same_labels(rig, tmp_path):
    for kernel in ("compiled", "numpy"):
        done("detect", "log.csv", "-o", tmp_path / f"{kernel}.parquet", cwd=rig, DSD_KERNEL=kernel)
    a, b = (read_labels(tmp_path / f"{kernel}.parquet") for kernel in ("compiled", "numpy"))
    for column in ("t", "state", "confident"):
        np.testing.assert_array_equal(a[column], b[column])
    np.testing.assert_allclose(a["log_likelihood"], b["log_likelihood"], rtol=1e-6)
    assert summary("log.csv", cwd=rig, DSD_KERNEL="numpy")["kernel"] == "numpy"


def test_labels_on_stdout(rig, tmp_path):
    done("detect", "log.csv", "-o", tmp_path / "labels.csv", cwd=rig)
    said = done("detect", "log.csv", "-o", "-", cwd=rig)
    assert said.stdout == (tmp_path / "labels.csv").read_text()
    assert "final: delay 0.005" in said.stderr
    quiet = done("detect", "log.csv", "--format", "jsonl", "--quiet", cwd=rig)
    assert quiet.stderr == ""
    rows = [json.loads(line) for line in quiet.stdout.splitlines()]
    assert list(rows[0]) == LABELS
    assert rows[0]["log_likelihood"] is None
    labels = read_labels(said.stdout)
    got = {name: np.array([np.nan if row[name] is None else row[name] for row in rows]) for name in LABELS}
    same(got, labels, single=True)
