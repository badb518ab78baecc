"""Signs, scales and offsets of [signals]: a disguised log, read with what undoes it, is the log. Factors are powers of
two, and values have few digits, so that nothing is rounded and results must be the same bits."""

import json
import signal
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.cli.plan import reading
from dsd_cli.files.command import Command
from dsd_cli.files.config import parse_config
from dsd_cli.files.logs import load_log
from tests.cli.rig import CONFIG, DSD, csv_text, done, dsd, interruptible, make_log, read_labels, refused, same, write

FACTORS = (
    "[signals]\nu_sign = -1\nu_scale = 0.25\nvelocity_scale = 2\nposition_scale = -0.5\n"
    "u_offset = 1.5\nvelocity_offset = -0.25\n"
)
#: What turns a channel into what the disguised file holds.
DISGUISE = {"u": -4.0, "d_hat": 4.0, "velocity": 0.5, "position": -2.0, "reference": -2.0}
ZEROS = {"u": 1.5, "velocity": -0.25}
MODEL = "[model]\ninertia = 1.0\ndelay = 0.005\n"


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "plain.toml").write_text(CONFIG + MODEL)
    (tmp_path / "dsd.toml").write_text(FACTORS + CONFIG + MODEL)
    write(tmp_path, "plain.csv", channels())
    write(tmp_path, "log.csv", disguised())
    return tmp_path


def channels(rows: int = 300) -> dict[str, np.ndarray]:
    log = make_log(rows)
    velocity = np.cumsum(log["u"]) * 0.001
    position = np.cumsum(velocity) * 0.001
    plain = {**log, "velocity": velocity, "position": position, "reference": position + 0.1}
    return {name: column if name == "t" else np.round(column * 2.0**24) / 2.0**24 for name, column in plain.items()}


def disguised() -> dict[str, np.ndarray]:
    return {name: column * DISGUISE.get(name, 1.0) + ZEROS.get(name, 0.0) for name, column in channels().items()}


def test_factors_are_those_that_are_not_one():
    assert parse_config("").signals.factors() == {}
    assert parse_config(FACTORS).signals.factors() == {
        "u": -0.25,
        "d_hat": 0.25,
        "velocity": 2.0,
        "position": -0.5,
        "reference": -0.5,
    }


@pytest.mark.parametrize("name", ["log.csv", "log.parquet"])
def test_a_log_in_memory_has_them_once(rig, name):
    path = write(rig, name, disguised())
    signals = {channel: channel for channel in ("t", *DISGUISE)}
    read = {**reading(parse_config(FACTORS)), "command": Command("sampled")}
    log = load_log(path, signals, **read).log
    for channel, column in channels().items():
        np.testing.assert_array_equal(log[channel], column)
    assert log.u_hold == "sampled"


@pytest.mark.parametrize(("key", "spike"), [("velocity_range = [-3.5, 3.5]", 3.0), ("outlier_factor = 10", 6.0)])
def test_ranges_and_outliers_are_judged_with_them_in(rig, key, spike):
    """The column holds half the speed: only with the factor in is the spike beyond the limit, and 1.7 within."""
    spoiled = {**disguised(), "velocity": np.full(300, 0.25)}
    spoiled["velocity"][[100, 200]] = 1.7, spike
    spoiled["velocity"] += ZEROS["velocity"]
    path = write(rig, "log.csv", spoiled)
    (rig / "dsd.toml").write_text(f"{FACTORS}{key}\n{CONFIG}{MODEL}")
    signals = {channel: channel for channel in ("t", *DISGUISE)}
    loaded = load_log(path, signals, **reading(parse_config(f"{FACTORS}{key}\n")))
    beyond = "beyond the range of the channel: velocity"
    assert loaded.dropped[beyond] == 1
    labelled = done("detect", "log.csv", "--set", 'signals.d_hat=""', "--format", "json", cwd=rig)
    assert {"reason": beyond, "count": 1} in json.loads(labelled.stdout)["dropped"]


def test_a_value_that_overflows_with_its_factor_is_not_finite(rig):
    spoiled = disguised()
    spoiled["velocity"][100] = 1e308
    write(rig, "log.csv", spoiled)
    checked = done("check", "log.csv", "--set", "signals.velocity_scale=1e10", cwd=rig)
    assert "without a finite velocity" in checked.stdout
    assert checked.stderr == ""


@pytest.mark.parametrize("source", ["d_hat", "velocity", "position"])
def test_detect_from_files_and_streams(rig, source):
    others = [f'signals.{name}=""' for name in ("d_hat", "velocity", "position") if name != source]
    options = [part for one in others for part in ("--set", one)]
    done("detect", "plain.csv", "-c", "plain.toml", "-o", "plain_labels.csv", *options, cwd=rig)
    plain = read_labels(rig / "plain_labels.csv")
    write(rig, "log.parquet", disguised())
    for log in ("log.csv", "log.parquet"):
        done("detect", log, "-o", "labels.csv", *options, cwd=rig)
        same(read_labels(rig / "labels.csv"), plain)
    piped = done("detect", "-", "-q", *options, cwd=rig, stdin=csv_text(disguised()))
    same(read_labels(piped.stdout), plain, single=True)


def test_detect_of_a_file_that_grows(rig):
    done("detect", "plain.csv", "-c", "plain.toml", "-o", "plain_labels.csv", cwd=rig)
    command = [*DSD, "detect", "log.csv", "--follow", "-q"]
    process = subprocess.Popen(command, cwd=rig, stdout=subprocess.PIPE, text=True, preexec_fn=interruptible)
    lines: list[str] = []
    reader = threading.Thread(target=lambda: lines.extend(process.stdout))
    reader.start()
    end = time.monotonic() + 300
    while len(lines) < 301 and time.monotonic() < end:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    process.wait(300)
    reader.join(300)
    same(read_labels("".join(lines)), read_labels(rig / "plain_labels.csv"), single=True)


def test_compare_reads_through_them(rig):
    def figures(log, config):
        return done("compare", log, "-c", config, "--format", "json", cwd=rig).stdout.replace("plain.csv", "log.csv")

    assert figures("log.csv", "dsd.toml") == figures("plain.csv", "plain.toml")


def test_observe_writes_them_in_and_the_same_config_does_not_take_them_twice(rig):
    done("observe", "plain.csv", "-c", "plain.toml", "-o", "plain_out.csv", cwd=rig)
    done("observe", "log.csv", "-o", "out.csv", cwd=rig)
    written, plain = read_labels(rig / "out.csv"), read_labels(rig / "plain_out.csv")
    for name, column in plain.items():
        np.testing.assert_array_equal(written[name], column, err_msg=name)
    labels = [
        read_labels(done("detect", log, "-c", config, "--format", "csv", cwd=rig).stdout)
        for log, config in (("plain_out.csv", "plain.toml"), ("out.csv", "plain.toml"), ("out.csv", "dsd.toml"))
    ]
    same(labels[1], labels[0])
    same(labels[2], labels[0])
    figures = [
        json.loads(done("compare", "out.csv", "-c", config, "--format", "json", cwd=rig).stdout)["force"]
        for config in ("plain.toml", "dsd.toml")
    ]
    assert figures[0] == figures[1]


def test_a_log_with_factors_that_does_not_say_whose_its_columns_are_is_refused(rig):
    """As earlier versions wrote them."""
    done("observe", "log.csv", "-o", "older.csv", cwd=rig)
    beside = rig / "older.csv.meta.json"
    metadata = json.loads(beside.read_text())
    del metadata["channels"]
    beside.write_text(json.dumps(metadata))
    refused(dsd("detect", "older.csv", cwd=rig), 1, "older.csv", "in it already", "u_sign")
    refused(dsd("compare", "older.csv", cwd=rig), 1, "older.csv", "in it already")


def test_a_sensor_zero_is_said_with_its_key_and_taken_off(tmp_path):
    """A current of 2 A per V about 1.65 V, of an axis of 0.02 kg m2 at 0.3 N m/A."""
    t = np.arange(8000) * 0.001
    current = (np.sin(8.2 * t) + 0.5 * np.sin(19.5 * t)) * (t > 0.5)
    velocity = np.append(0.0, np.cumsum(0.3 * current / 0.02)[:-1] * 0.001)
    counts = np.round(8388608.0 + 20000.0 * current)  # of an analogue input of 24 bits
    write(tmp_path, "counts.csv", {"t": t, "current": counts, "velocity_rad_s": velocity})
    assert "signals.u_offset = 8388608\n" in done("init", "counts.csv", cwd=tmp_path).stderr
    (tmp_path / "dsd.toml").unlink()
    write(tmp_path, "log.csv", {"t": t, "current_V": 1.65 + current / 2.0, "velocity_rad_s": velocity})
    said = done("init", "log.csv", cwd=tmp_path).stderr
    assert "signals.u_offset = 1.65" in said
    scale = ("--set", "signals.u_scale=0.6")
    assert "signals.u_offset = 1.65" in done("check", "log.csv", *scale, cwd=tmp_path).stdout
    zero = ("--set", "signals.u_offset=1.65")
    init = done("init", "log.csv", "--force", *scale, *zero, cwd=tmp_path)
    assert "never comes to 0" not in init.stderr
    assert "\ninertia = 0.02 " in (tmp_path / "dsd.toml").read_text()
    assert "never comes to 0" not in done("check", "log.csv", cwd=tmp_path).stdout
