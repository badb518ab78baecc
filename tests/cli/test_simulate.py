"""`dsd simulate`: seeds, options, provenance, and a log that its own model predicts."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import predict_d_hat
from dsd_cli.signals.log import CHANNELS, Log
from tests.cli.rig import done, dsd, read_labels, refused

STEP = ["--template", "paper-step", "--duration", "1"]


def test_the_columns_and_the_truth(tmp_path):
    said = done("simulate", *STEP, "-o", "log.parquet", cwd=tmp_path)
    assert said.stdout == ""
    assert "log.parquet: 1,000 samples, 1 ms apart" in said.stderr
    log = read_labels(tmp_path / "log.parquet")
    assert list(log) == list(CHANNELS)
    assert (log["true_delay"] == 0.3).all()
    assert (log["true_inertia"] == 1.0).all()
    assert done("simulate", *STEP, "-o", "log.parquet", "--quiet", cwd=tmp_path).stderr == ""


def test_a_seed_makes_the_same_log_again(tmp_path):
    for name, seed in (("a.csv", 1), ("b.csv", 1), ("c.csv", 2)):
        done("simulate", *STEP, "--noise", "0.1", "--seed", seed, "-o", name, cwd=tmp_path)
    a, b, c = ((tmp_path / f"{name}.csv").read_bytes() for name in "abc")
    assert a == b
    assert a != c
    out = done("simulate", *STEP, "--noise", "0.1", "--seed", "1", "-o", "-", "-q", cwd=tmp_path).stdout
    assert out.encode() == a


def test_options_reach_the_run_and_the_provenance(tmp_path):
    options = ["--set", "model.inertia=0.7", "--effect", "coulomb_friction:level=0.05", "--seed", "5", "--noise", "0.1"]
    done("simulate", *STEP, *options, "-o", "log.csv", cwd=tmp_path)
    done("simulate", *STEP, *options, "-o", "log.parquet", cwd=tmp_path)
    beside = json.loads((tmp_path / "log.csv.meta.json").read_text())
    inside = {k.decode(): v.decode() for k, v in pq.read_metadata(tmp_path / "log.parquet").metadata.items()}
    for found in (beside, inside):
        config = tomllib.loads(found["config"])
        assert config["model"]["inertia"] == 0.7
        assert config["model"]["effects"]["coulomb_friction"]["level"] == 0.05
        assert config["simulate"]["seed"] == 5
        assert config["simulate"]["noise"] == 0.1
        assert config["simulate"]["duration"] == 1
        assert found["seed"] == "5"
    csv, parquet = read_labels(tmp_path / "log.csv"), read_labels(tmp_path / "log.parquet")
    for name in CHANNELS:
        np.testing.assert_array_equal(csv[name], parquet[name])
    assert (csv["true_inertia"] == 0.7).all()
    (tmp_path / "again.toml").write_text(beside["config"])
    done("simulate", "-c", "again.toml", "-o", "again.csv", cwd=tmp_path)
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "log.csv").read_bytes()


def test_noise_is_what_was_asked_for(tmp_path):
    for noise in (0, 0.2):
        done("simulate", *STEP, "--noise", noise, "--set", "simulate.reference.amplitude=0", "-o", f"{noise}.parquet",
             cwd=tmp_path)  # fmt: skip
    quiet, noisy = (read_labels(tmp_path / f"{noise}.parquet")["d_hat"] for noise in (0, 0.2))
    assert (quiet == 0).all()
    assert noisy.std() == pytest.approx(0.2, rel=0.3)


@pytest.mark.parametrize("delay", [0.3, 0.02, 0.0203, 0.29985])
def test_the_written_log_is_predicted_by_its_true_model(tmp_path, delay):
    """Fit above 99.99 % after writing and reading, for whole and fractional delays.

    The sine begins with a jump of u, and the prediction takes the first u as held before the log: that is gone after
    the delay and some time constants.
    """
    done("simulate", "--template", "paper-sine", "--duration", "2", "--noise", "0", "--set", f"model.delay={delay}",
         "--effect", "viscous_friction:coefficient=0.3", "-o", "log.csv", cwd=tmp_path)  # fmt: skip
    log = read_labels(tmp_path / "log.csv")
    model = PlantModel(float(log["true_inertia"][0]), delay, {"viscous_friction": {"coefficient": 0.3}})
    got = predict_d_hat(model, Log(log, 0.001), ObserverSettings())
    settled = log["t"] > delay + 0.15
    y, got = log["d_hat"][settled], got[settled]
    assert 100 * (1 - np.linalg.norm(y - got) / np.linalg.norm(y - y.mean())) > 99.99


@pytest.mark.parametrize(
    ("options", "code", "text"),
    [
        (["--seed", "-1"], 2, "simulate.seed = -1"),
        (["--noise", "-0.1"], 2, "simulate.noise = -0.1"),
        (["--duration", "0"], 2, "simulate.duration = 0"),
        (["--duration", "soon"], 2, "is not a number"),
        (["--duration", "1e9"], 2, "at most 1e+08 sample times"),
        (["--set", "model.inertia=0"], 2, "model.inertia = 0"),
        (["--effect", "coulomb_friction:level=-1"], 2, "level"),
        (["-c", "dsd.toml"], 2, "give one of them"),
        (["--template", "paper-stop"], 2, "paper-step"),
        (["-o", "log.txt"], 2, "end the name in .csv or .parquet"),
        (["-o", "nowhere/log.csv"], 1, "no such folder"),
    ],
    ids=lambda x: " ".join(x) if isinstance(x, list) else "",
)
def test_what_cannot_work_is_one_line(tmp_path: Path, options, code, text):
    refused(dsd("simulate", *STEP, "-o", "log.csv", *options, cwd=tmp_path), code, text)
    assert list(tmp_path.iterdir()) == []


def test_without_a_config_it_says_which_is_missing(tmp_path):
    refused(dsd("simulate", "-o", "log.csv", cwd=tmp_path), 2, "dsd.toml")
