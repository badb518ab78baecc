"""`dsd detect` (a file, and one that grows) and `dsd observe` on a position that wraps: as on the one that goes on."""

import csv
import signal
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from tests.cli.rig import DSD, done, read_labels, same

SAMPLES = Path(__file__).parents[2] / "sample_logs"
CONFIG = SAMPLES / "servo-friction.toml"
TURN = 2.0 * np.pi
ROWS = 1500


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the log of an axis that passes 0 to and fro, and the same modulo a turn."""
    folder = tmp_path_factory.mktemp("wrapped")
    rows = list(csv.DictReader((SAMPLES / "servo-friction.csv").open(newline="")))[:ROWS]
    position = np.array([float(row["position"]) for row in rows]) - 0.8
    wrapped = np.mod(position, TURN)
    assert np.sum(np.abs(np.diff(wrapped)) > 3.0) >= 2
    for name, column in (("plain.csv", wrapped[0] - position[0] + position), ("wrapped.csv", wrapped)):
        lines = [f"{row['t']},{row['u']},{q!r}" for row, q in zip(rows, column.tolist(), strict=True)]
        (folder / name).write_text("\n".join(["t,u,position", *lines]) + "\n")
    return folder


def labels(log: str, rig: Path) -> dict:
    return read_labels(done("detect", log, "-c", CONFIG, "--format", "csv", cwd=rig).stdout)


def test_labels_of_a_file_and_a_note(rig):
    same(labels("wrapped.csv", rig), labels("plain.csv", rig))
    made = done("detect", "wrapped.csv", "-c", CONFIG, cwd=rig)
    assert "the position wraps after a turn" in made.stdout + made.stderr
    made = done("detect", "plain.csv", "-c", CONFIG, cwd=rig)
    assert "wraps" not in made.stdout + made.stderr


def test_labels_of_a_file_that_grows(rig):
    command = [*DSD, "detect", "wrapped.csv", "-c", str(CONFIG), "--follow", "-q"]
    process = subprocess.Popen(command, cwd=rig, stdout=subprocess.PIPE, text=True)
    lines: list[str] = []
    reader = threading.Thread(target=lambda: lines.extend(process.stdout))
    reader.start()
    end = time.monotonic() + 60
    while len(lines) < 1 + ROWS and time.monotonic() < end:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    process.wait(300)
    reader.join(300)
    same(read_labels("".join(lines)), labels("plain.csv", rig), single=True)


def test_what_observe_writes(rig):
    made = {log: done("observe", log, "-c", CONFIG, "-o", "-", cwd=rig) for log in ("plain.csv", "wrapped.csv")}
    plain, wrapped = (read_labels(one.stdout) for one in made.values())
    for name in ("position", "d_hat"):
        np.testing.assert_allclose(wrapped[name], plain[name], rtol=1e-6, atol=1e-6)
    assert "the position wraps after a turn" in made["wrapped.csv"].stderr
