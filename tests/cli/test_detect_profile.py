"""`dsd detect` with method = "profile": the columns it adds, in every form, the summary, and what it refuses."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.cli.labels_out import ESTIMATES
from tests.cli.rig import CONFIG, LABELS, done, dsd, make_log, read_labels, refused, summary, write

METHOD = ("--set", "detector.method=profile")


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    (folder / "dsd.toml").write_text(CONFIG)
    write(folder, "log.csv", make_log(600))
    halves = make_log(600), make_log(600, delay=0.002)
    late = halves[0]["t"] >= 0.3
    write(folder, "change.csv", halves[0] | {"d_hat": np.where(late, *(half["d_hat"] for half in halves[::-1]))})
    return folder


def test_labels_gain_columns_and_the_old_stay(rig: Path, tmp_path: Path) -> None:
    for suffix in ("csv", "parquet"):
        done("detect", "log.csv", *METHOD, "-o", tmp_path / f"labels.{suffix}", cwd=rig)
        labels = read_labels(tmp_path / f"labels.{suffix}")
        assert list(labels) == [*LABELS, *ESTIMATES]
        sure = labels["delay_confident"].astype(bool)
        assert sure[200:].mean() > 0.8
        np.testing.assert_allclose(labels["delay_estimate"][200:].astype(float), 0.005, atol=5e-4)
        np.testing.assert_allclose(labels["inertia_estimate"][200:].astype(float), 1.0, rtol=0.05)
        assert (labels["delay_std"][200:].astype(float) > 0.0).all()


def test_live_lines_are_those_of_the_file(rig: Path) -> None:
    text = (rig / "log.csv").read_text()
    streamed = done("detect", "-", *METHOD, "--quiet", cwd=rig, stdin=text).stdout
    assert streamed == done("detect", "log.csv", *METHOD, "-o", "-", "--quiet", cwd=rig).stdout
    lines = done("detect", "-", *METHOD, "--format", "jsonl", cwd=rig, stdin=text).stdout.splitlines()
    assert json.loads(lines[0])["delay_estimate"] is None
    assert json.loads(lines[-1])["delay_estimate"] == pytest.approx(0.005, abs=5e-4)


def test_the_summary_has_estimates_and_the_change(rig: Path) -> None:
    result = summary("change.csv", *METHOD, cwd=rig)
    assert result["estimates"]["delay"]["value"] == pytest.approx(0.002, abs=5e-4)
    assert result["estimates"]["inertia"]["std"] > 0.0
    (change,) = result["changes"]
    assert change["low"] - 0.0015 <= 0.3 <= change["high"] + 0.0015
    assert change["detected"] >= change["time"] - 0.04
    assert change["before"]["delay"] == pytest.approx(0.005, abs=1e-3)
    assert change["after"]["delay"] == pytest.approx(0.002, abs=1e-3)
    assert 0.0 < result["change_test"]["false_alarms_per_hour"] < 0.1
    table = done("detect", "change.csv", *METHOD, cwd=rig).stdout
    (told,) = re.findall(r"change at ([0-9.]+)", table)
    assert float(told) == pytest.approx(change["time"], abs=1e-3)
    assert "estimated between the candidates: delay 0.00" in table


def test_other_methods_have_no_estimates(rig: Path) -> None:
    result = summary("log.csv", cwd=rig)
    assert not {"estimates", "changes", "change_test"} & set(result)


def test_a_short_window_is_refused_in_one_line(rig: Path) -> None:
    result = dsd("detect", "log.csv", *METHOD, "--set", "detector.window=5", cwd=rig)
    refused(result, 2, "needs 10 samples")


def test_a_change_is_placed_within_its_own_interval(tmp_path: Path) -> None:
    """The load is taken up at 1.5 s, while little moves: many places explain the log almost as well."""
    samples = Path(__file__).parents[2] / "sample_logs"
    log, config = samples / "servo-load-change.parquet", samples / "servo-load-change.toml"
    said = done("detect", log, "-c", config, *METHOD, "--format", "json", cwd=tmp_path).stdout
    (change,) = json.loads(said)["changes"]
    assert change["low"] <= change["time"] <= change["high"]
    assert change["low"] <= 1.5 <= change["high"]
