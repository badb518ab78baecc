"""One corrupt cell costs at most its window: dropped and said, or taken as it is and nothing confident rests on it."""

import csv
import io
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.cli.rig import csv_text, done, dsd, make_log, read_labels, refused, summary, write

SAMPLES = Path(__file__).parents[2] / "sample_logs"
ROW, WINDOW, REACH = 702, 300, 60  # REACH: the longest delay, and until Q has forgotten the spike
CONFIG = SAMPLES / "servo-friction.toml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    here = tmp_path_factory.mktemp("corrupt")
    shutil.copy(SAMPLES / "servo-friction.csv", here / "log.csv")
    done("detect", "log.csv", "-c", CONFIG, "-o", "clean.csv", cwd=here)
    return here


def corrupt(folder: Path, column: str, value: str) -> str:
    rows = list(csv.reader(io.StringIO((folder / "log.csv").read_text())))
    rows[ROW + 1][rows[0].index(column)] = value
    text = "".join(",".join(row) + "\n" for row in rows)
    (folder / "bad.csv").write_text(text)
    return text


@pytest.mark.parametrize("column", ["u", "d_hat"])
@pytest.mark.parametrize("value", ["3", "20", "1e3", "-9e4", "1e8", "1e20", "1e100", "1e308", "-1.7e308"])
def test_no_wrong_label_is_confident_and_all_are_right_again_after_a_window(folder, column, value):
    corrupt(folder, column, value)
    done("detect", "bad.csv", "-c", CONFIG, "-o", "labels.csv", cwd=folder)
    bad, clean = read_labels(folder / "labels.csv"), read_labels(folder / "clean.csv")
    wrong = np.flatnonzero(bad["state"] != clean["state"])
    assert not bad["confident"][wrong].any()
    assert wrong.size == 0 or wrong.max() <= ROW + WINDOW + REACH
    assert bad["confident"][ROW + WINDOW + REACH + 1 :].all()


@pytest.mark.parametrize("value", ["1e8", "1e308", "-1e308"])
def test_what_no_machine_does_is_dropped_and_said(folder, value):
    corrupt(folder, "u", value)
    found = summary("bad.csv", "-c", CONFIG, cwd=folder)
    assert found["dropped"] == [
        {"reason": "beyond the range of the channel: u", "count": 1},
        {"reason": "bridged", "count": 1},
    ]


def test_a_range_of_the_user_drops_what_is_beyond_it(folder):
    corrupt(folder, "u", "3")
    found = summary("bad.csv", "-c", CONFIG, "--set", "signals.u_range=[-2, 2]", cwd=folder)
    assert found["dropped"][0] == {"reason": "beyond the range of the channel: u", "count": 1}
    refused(
        dsd("detect", "bad.csv", "-c", CONFIG, "--set", "signals.u_range=[2, -2]", cwd=folder),
        2, "signals.u_range", "a smaller and a larger number",
    )  # fmt: skip


@pytest.mark.parametrize("value", ["2.5", "20", "1e8"])
def test_live_and_files_give_the_same_labels(folder, value):
    text = corrupt(folder, "u", value)
    done("detect", "bad.csv", "-c", CONFIG, "-o", "labels.csv", cwd=folder)
    live = done("detect", "-", "-c", CONFIG, cwd=folder, stdin=text.encode()).stdout.decode()
    assert live == (folder / "labels.csv").read_text()


def test_a_spike_that_the_measurement_shows_stays_confident(tmp_path):
    """A delayed plant that was given one large command for real: that is the best evidence there is."""
    columns = make_log(600)
    from dsd_cli.plant.model import ObserverSettings, PlantModel
    from dsd_cli.plant.prediction import predict_d_hat
    from dsd_cli.signals.log import Log
    from tests.cli.rig import CONFIG as RIG
    from tests.cli.rig import DELAY, INERTIA, RIGHT, T

    columns["u"][300] += 60.0 * abs(columns["u"]).max()
    log = Log({"t": columns["t"], "u": columns["u"]}, T)
    noise = 0.02 * np.random.default_rng(1).normal(size=600)
    columns["d_hat"] = predict_d_hat(PlantModel(INERTIA, DELAY), log, ObserverSettings(time_constant=0.002)) + noise
    (tmp_path / "dsd.toml").write_text(RIG)
    write(tmp_path, "log.csv", columns)
    done("detect", "log.csv", "-o", "labels.csv", cwd=tmp_path)
    labels = read_labels(tmp_path / "labels.csv")
    assert (labels["state"][301:] == RIGHT).all()
    assert labels["confident"][310:].all()


def test_observe_writes_no_value_that_is_not_finite(tmp_path):
    columns = make_log(300)
    columns["velocity"] = np.cumsum(columns["u"]) * 1e-3
    del columns["d_hat"]
    columns["u"][100] = 1e308
    columns["velocity"][200] = -1e308
    (tmp_path / "dsd.toml").write_text("[observer]\nnominal_inertia = 1.0\ntime_constant = 0.002\n")
    (tmp_path / "log.csv").write_text(csv_text(columns))
    said = done("observe", "log.csv", "-o", "out.csv", cwd=tmp_path).stderr
    assert "beyond the range of the channel: u 1" in said
    assert all(np.isfinite(column).all() for column in read_labels(tmp_path / "out.csv").values())
    columns["velocity"] = columns["u"] = 1e300 * np.cumsum(make_log(300)["u"])
    (tmp_path / "log.csv").write_text(csv_text(columns))
    extreme = ("--set", "observer.nominal_inertia=1e10")
    refused(dsd("observe", "log.csv", "-o", "extreme.csv", *extreme, cwd=tmp_path), 1, "d_hat", "finite")
    assert not (tmp_path / "extreme.csv").exists()


@pytest.mark.parametrize("row", [900, 1650, 2400])
@pytest.mark.parametrize("name", ["paper-step", "paper-delay-change"])
def test_no_label_is_confident_because_only_others_have_the_spike(folder, name, row):
    """It reaches the states of a quiet log one after the other: one that it has not reached yet, or has left, is no
    better for that. 108 labels were confident and wrong."""
    log = {name: column.copy() for name, column in read_labels(SAMPLES / f"{name}.csv").items()}
    log["u"][row] = 1e3
    write(folder, "spike.csv", log)
    done("detect", "spike.csv", "-c", SAMPLES / f"{name}.toml", "-o", "labels.csv", cwd=folder)
    labels = read_labels(folder / "labels.csv")
    wrong = (labels["delay"] != log["true_delay"]) | (labels["inertia"] != log["true_inertia"])
    near = np.arange(wrong.size) - row
    assert not (labels["confident"] & wrong)[(near >= 0) & (near < 600)].any()


@pytest.fixture(scope="module")
def load_change(tmp_path_factory) -> Path:
    here = tmp_path_factory.mktemp("load")
    config = SAMPLES / "servo-load-change.toml"
    done("simulate", "-c", config, "--duration", "3", "--seed", "11", "-o", "made.csv", cwd=here)
    write(here, "log.csv", read_labels(here / "made.csv"))  # without what `simulate` says of it beside it
    done("detect", "log.csv", "-c", config, "-o", "clean.csv", cwd=here)
    return here


@pytest.mark.parametrize(("row", "value"), [(1610, 3.0), (1850, -2.5), (2300, 2.2), (2700, -3.9)])
def test_no_label_is_confident_because_of_a_value_that_is_hardly_more_than_usual(load_change, row, value):
    """u reaches 1.24 here. 2.2 is enough: a delay of 0 explains it, and 250 labels were confident and wrong."""
    log = {name: column.copy() for name, column in read_labels(load_change / "log.csv").items()}
    clean = read_labels(load_change / "clean.csv")
    log["u"][row] = value
    write(load_change, "spike.csv", log)
    config = SAMPLES / "servo-load-change.toml"
    done("detect", "spike.csv", "-c", config, "-o", "labels.csv", cwd=load_change)
    labels = read_labels(load_change / "labels.csv")
    assert not (labels["confident"].astype(bool) & (labels["state"] != clean["state"])).any()
    near = np.arange(log["u"].size) - row
    away = (near < 0) | (near > WINDOW + REACH)  # it costs its window and no more
    assert (labels["confident"] == clean["confident"])[away].all()
