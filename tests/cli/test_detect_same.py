"""However a log comes in, the labels are the same; and effects, channels and the API agree with the command."""

from pathlib import Path

import numpy as np
import pytest

from dsd_cli.detect import DetectorSettings, Engine, Grid
from dsd_cli.detect.engine import Measurement
from tests.cli.rig import CONFIG, T, csv_text, done, dsd, make_log, read_labels, refused, same, summary, write

GRID = Grid((0.0, 0.005, 0.01), (0.5, 1.0, 2.0))
SERVO = ["--template", "servo", "--duration", "1"]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    (folder / "dsd.toml").write_text(CONFIG)
    write(folder, "log.csv", make_log())
    write(folder, "log.parquet", make_log(), row_group_size=41)
    return folder


def test_file_stream_parquet_and_api_give_the_same_labels(rig, tmp_path):
    done("detect", "log.csv", "-o", tmp_path / "csv.parquet", cwd=rig)
    done("detect", "log.parquet", "-o", tmp_path / "parquet.parquet", cwd=rig)
    done("detect", "-", "-o", tmp_path / "stream.parquet", cwd=rig, stdin=csv_text(make_log()))
    content = (rig / "log.parquet").read_bytes()
    done("detect", "-", "-o", tmp_path / "piped.parquet", cwd=rig, stdin=content)
    whole = read_labels(tmp_path / "csv.parquet")
    for other in ("parquet", "stream", "piped"):
        same(read_labels(tmp_path / f"{other}.parquet"), whole)

    log = make_log()
    tuning = DetectorSettings(window=40, rho=0.1, initial=8)
    run = Engine(GRID, tuning, Measurement(T, 1.0, 0.002)).run(log["u"], log["d_hat"])
    engine = Engine(GRID, tuning, Measurement(T, 1.0, 0.002))
    steps = [engine.step(u, d) for u, d in zip(log["u"].tolist(), log["d_hat"].tolist(), strict=True)]
    for name in ("state", "delay", "inertia", "log_likelihood", "probability", "confident"):
        column = getattr(run, name)
        np.testing.assert_array_equal([getattr(label, name) for label in steps], column)
        np.testing.assert_array_equal(whole[name], column.astype(whole[name].dtype), err_msg=name)


@pytest.mark.parametrize("kernel", ["compiled", "numpy"])
def test_the_papers_step_run_with_and_without_hold(tmp_path, kernel):
    """After the step the loop goes quiet, and noise alone decides; hold = 3 keeps the last well-founded label."""
    done("init", "--template", "paper-step", cwd=tmp_path)
    done("simulate", "-o", "log.parquet", "--noise", "0.3", cwd=tmp_path)
    free, held = (
        summary("log.parquet", "--set", f"detector.hold={hold}", cwd=tmp_path, DSD_KERNEL=kernel) for hold in (0.0, 3.0)
    )
    assert free["truth"]["share_correct"] < 0.9
    assert held["truth"]["share_correct"] > 0.95
    assert held["segments_total"] < 10 < free["segments_total"]
    assert (held["final"]["delay"], held["final"]["inertia"]) == (0.3, 1.0)


def test_velocity_only_and_position_only_as_direct_and_by_observe(tmp_path):
    done("init", "--template", "servo", cwd=tmp_path)
    done("simulate", "-o", "log.parquet", "--duration", "1", "--set", "simulate.noise=0", cwd=tmp_path)
    for channel in ("velocity", "position"):
        log = read_labels(tmp_path / "log.parquet")
        columns = {name: log[name] for name in ("t", "u", channel)}
        source = write(tmp_path, f"{channel}.csv", columns)
        friction = [] if channel == "position" else ["--set", "model.effects.coulomb_friction.level=0.15"]
        got = summary(source, "-o", "direct.parquet", *friction, cwd=tmp_path)
        assert got["d_hat"] == channel
        said = done("observe", source, "-o", "observed.parquet", cwd=tmp_path)
        assert f"1,000 samples, d_hat computed from {channel}" in said.stderr
        again = summary("observed.parquet", "-o", "twice.parquet", *friction, cwd=tmp_path)
        assert again["d_hat"] == "logged"
        same(read_labels(tmp_path / "twice.parquet"), read_labels(tmp_path / "direct.parquet"))


def test_axes_of_effect_values(tmp_path):
    """Which level of Coulomb friction: a third axis beside delay and inertia, in labels, JSON and expectations."""
    done("init", "--template", "servo", cwd=tmp_path)
    done("simulate", "-o", "log.csv", "--duration", "2", cwd=tmp_path)
    axis = ["--set", "states.effects.coulomb_friction.level=[0.05, 0.15, 0.3]"]
    got = summary("log.csv", "-o", "labels.csv", *axis, "--expect", "coulomb_friction.level=0.15", "--after", "0.6",
                  "--confident-only", cwd=tmp_path)  # fmt: skip
    assert len(got["states"]) == 27
    assert got["final"]["coulomb_friction.level"] == 0.15
    assert "coulomb_friction.level" in got["segments"][0]
    labels = read_labels(tmp_path / "labels.csv")
    assert list(labels)[2:5] == ["delay", "inertia", "coulomb_friction.level"]
    refused(dsd("detect", "log.csv", *axis, "--expect", "coulomb_friction.level=1", cwd=tmp_path), 2, "0.05, 0.15, 0.3")


def test_irregular_stamps(rig, tmp_path):
    """Stamps that keep no clock are used as they are; from a file and from a stream alike."""
    rng = np.random.default_rng(3)
    log = make_log() | {"t": np.round(np.cumsum(rng.uniform(0.0005, 0.0015, 300)), 6)}
    source = write(tmp_path, "log.csv", log)
    got = summary(source, "-o", tmp_path / "a.parquet", cwd=rig)
    assert (got["clock"], got["samples"], got["dropped"]) == ("irregular", 300, [])
    done("detect", "-", "-o", tmp_path / "b.parquet", cwd=rig, stdin=source.read_text())
    same(read_labels(tmp_path / "a.parquet"), read_labels(tmp_path / "b.parquet"))
