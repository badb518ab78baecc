"""A u that was logged 9 ms later (or earlier) than it acted, under a delay of 2 ms: `signals.u_shift` mends it."""

import csv
import json
import signal
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from tests.cli.rig import DSD, FEW, done, read_labels, same

SAMPLES = Path(__file__).parents[2] / "sample_logs"
CONFIG = SAMPLES / "servo-friction.toml"
LATE, TRUE_DELAY = 9, 0.002


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the log as it is, and with u moved by so many rows."""
    folder = tmp_path_factory.mktemp("shift")
    rows = list(csv.DictReader((SAMPLES / "servo-friction.csv").open(newline="")))
    u = np.array([float(row["u"]) for row in rows])
    for name, samples in (("plain.csv", 0), ("late.csv", LATE), ("early.csv", -LATE)):
        moved = np.roll(u, samples)
        moved[: max(samples, 0)], moved[u.size + min(samples, 0) :] = u[0], u[-1]
        lines = [f"{row['t']},{x!r},{row['position']}" for row, x in zip(rows, moved.tolist(), strict=True)]
        (folder / name).write_text("\n".join(["t,u,position", *lines]) + "\n")
    return folder


def shifted(seconds: float) -> tuple[str, ...]:
    return "--set", f"signals.u_shift={seconds}"


def late(log: str, rig: Path, *given: str) -> list[dict]:
    found = json.loads(done("check", log, "-c", CONFIG, "--format", "json", *given, cwd=rig).stdout)["findings"]
    return [one for one in found if "later than the motion" in one["what"]]


def test_check_names_the_key_with_a_value_that_mends_it(rig):
    (one,) = late("late.csv", rig)
    key, _, value = one["remedy"].partition(" = ")
    assert (one["severity"], key) == ("warning", "signals.u_shift")
    assert float(value) == pytest.approx(TRUE_DELAY - LATE * 1e-3, abs=3e-4)  # of which the delay hides its part
    assert late("late.csv", rig, *shifted(float(value))) == []
    (again,) = late("late.csv", rig, *shifted(0.002))
    assert float(again["remedy"].partition(" = ")[2]) == pytest.approx(float(value), abs=3e-4)
    assert late("plain.csv", rig) == []


def test_a_diagnosis_is_right_with_it_and_every_fit_says_it_without(rig):
    said = done("compare", "late.csv", "-c", CONFIG, cwd=rig).stderr
    assert "later than the motion it causes" in said
    assert "signals.u_shift = -0.00" in said
    given = ("--set", "model.delay=0.004", "--format", "json", *shifted(-LATE * 1e-3))
    rivals = (*FEW, "actuator_lag")
    found = json.loads(done("diagnose", "late.csv", "-c", CONFIG, *given, cwd=rig, effects=rivals).stdout)
    assert found["verdict"] == "delay"
    delay = next(one for one in found["ranking"] if one["effect"] == "delay")["parameters"]["delay"]
    assert delay["value"] == pytest.approx(TRUE_DELAY, abs=1e-4)  # a tenth of a sample


def test_labels_are_those_of_the_log_as_it_was(rig):
    plain = read_labels(done("detect", "plain.csv", "-c", CONFIG, "--format", "csv", cwd=rig).stdout)
    for log, seconds in (("late.csv", -LATE * 1e-3), ("early.csv", LATE * 1e-3)):
        labels = read_labels(done("detect", log, "-c", CONFIG, "--format", "csv", *shifted(seconds), cwd=rig).stdout)
        assert labels["t"].size == plain["t"].size
        inside = slice(700, -2 * LATE)  # behind the edge, and what remembers it
        np.testing.assert_array_equal(labels["state"][inside], plain["state"][inside])


def test_rows_without_a_u_are_counted_and_what_observe_writes_has_it_in(rig):
    made = done("observe", "late.csv", "-c", CONFIG, "-o", "out.csv", *shifted(-LATE * 1e-3), cwd=rig)
    assert f"not finite: u {LATE}" in made.stderr
    plain = read_labels(done("observe", "plain.csv", "-c", CONFIG, "-o", "-", cwd=rig).stdout)
    written = read_labels(rig / "out.csv")
    np.testing.assert_array_equal(written["u"], plain["u"][:-LATE])
    again = [
        json.loads(done("compare", "out.csv", "-c", CONFIG, "--format", "json", *given, cwd=rig).stdout)["rmse"]
        for given in ((), shifted(-LATE * 1e-3))
    ]
    assert again[0] == again[1]


def test_a_log_that_grows_gets_the_labels_of_the_file(rig):
    options = ["late.csv", "-c", str(CONFIG), *shifted(-LATE * 1e-3)]
    done("detect", *options, "-o", "labels.csv", cwd=rig)
    process = subprocess.Popen([*DSD, "detect", *options, "--follow", "-q"], cwd=rig, stdout=subprocess.PIPE, text=True)
    lines: list[str] = []
    reader = threading.Thread(target=lambda: lines.extend(process.stdout))
    reader.start()
    end = time.monotonic() + 60
    before_the_end = 1 + 3000 - LATE - 1  # a header; the last rows wait for their u, and for the row behind it
    while len(lines) < before_the_end and time.monotonic() < end:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    process.wait(300)
    reader.join(300)
    same(read_labels("".join(lines)), read_labels(rig / "labels.csv"), single=True)
