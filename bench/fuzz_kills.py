"""Random kills: a command is ended by a signal at a random time, and what it leaves behind is looked at."""

from __future__ import annotations

import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from dsd_cli.signals.log import Array

#: Signals that a command answers, and the one that it cannot.
ANSWERED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
OLD = b"t,u\n0,1\n"
#: s; on a busy machine a start alone may take half a minute.
PATIENCE = 300


class Kill(NamedTuple):
    """One try; `finding` is empty where all is as promised."""

    code: int
    seconds: float
    finding: str


def big_log(path: Path, rows: int) -> None:
    """A CSV log that takes a while to label."""
    import numpy as np
    import pyarrow as pa
    import pyarrow.csv as pc

    rng = np.random.default_rng(1)
    columns: dict[str, Array] = {
        "t": np.arange(rows) * 1e-3,
        "u": rng.normal(size=rows),
        "d_hat": rng.normal(size=rows),
    }
    pc.write_csv(pa.table(columns), path)


def command(folder: Path, name: str) -> list[str]:
    """`dsd detect` of the log in the folder, into `name`."""
    return [sys.executable, "-m", "dsd_cli", "detect", str(folder / "log.csv"), "-c", str(folder / "dsd.toml"),
            "-o", str(folder / "out" / name), "--quiet"]  # fmt: skip


def kill(folder: Path, name: str, number: int, after: float) -> Kill:
    """Run the command, send it the signal after so many seconds (when it writes, if `after` is negative), and look.

    `folder` has log.csv and dsd.toml; out/ is made anew, with an old file of that name in it.
    """
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    (out / name).write_bytes(OLD)
    began = time.monotonic()
    process = subprocess.Popen(command(folder, name), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    if after < 0.0:
        while process.poll() is None and not any(p.name.endswith(".tmp") for p in out.iterdir()):
            time.sleep(0.001)
        after = -after
    try:
        process.wait(after)
    except subprocess.TimeoutExpired:
        process.send_signal(number)
    try:
        _, said = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        return Kill(process.wait(), time.monotonic() - began, f"no end within {PATIENCE} s of the signal")
    return Kill(process.returncode, time.monotonic() - began, _finding(process.returncode, said, out, name, number))


def _finding(code: int, said: bytes, out: Path, name: str, number: int) -> str:
    ended = (-number, 128 + number)
    if code not in (0, *ended):
        return f"exit code {code}: {said.decode(errors='replace')[-300:]}"
    if b"Traceback" in said or b"Exception" in said:
        return f"a traceback: {said.decode(errors='replace')[-300:]}"
    left = sorted(p.name for p in out.iterdir() if p.name not in (name, f"{name}.meta.json"))
    if left and number != signal.SIGKILL:
        return f"left behind: {left}"
    content = (out / name).read_bytes()
    if content != OLD and not _is_whole(content, name):
        return f"half a file of {len(content)} bytes"
    return ""


def _is_whole(content: bytes, name: str) -> bool:
    if name.endswith(".parquet"):
        return content[:4] == content[-4:] == b"PAR1"
    return content.endswith(b"\n") and content.count(b"\n") == ROWS + 1


ROWS = 60_000
CONFIG = """
[observer]
nominal_inertia = 1.0
time_constant = 0.002
[states]
delays = [0.0, 0.005]
inertias = [0.5, 1.0]
[detector]
window = 40
"""


def prepare(folder: Path) -> None:
    """log.csv and dsd.toml for `kill`."""
    big_log(folder / "log.csv", ROWS)
    (folder / "dsd.toml").write_text(CONFIG)


def random_kill(folder: Path, seed: int, longest: float) -> tuple[str, Kill]:
    """A kill that the seed decides; and what it was, in words."""
    rng = random.Random(seed)
    name = rng.choice(("labels.csv", "labels.parquet"))
    number = rng.choice((*ANSWERED, *ANSWERED, signal.SIGKILL))
    after = rng.choice((rng.uniform(0.0, longest), -rng.uniform(0.0001, 0.06)))
    what = f"{name}, {signal.Signals(number).name} {'while it writes, ' if after < 0 else ''}after {abs(after):.4f} s"
    found = kill(folder, name, number, after)
    if number == signal.SIGKILL and not found.finding:
        found = _cleaned(folder, name, found)
    return what, found


def _cleaned(folder: Path, name: str, found: Kill) -> Kill:
    """After a SIGKILL the next run takes away what was left, and does its work."""
    done = subprocess.run(command(folder, name), capture_output=True, check=False, timeout=PATIENCE)
    left = sorted(p.name for p in (folder / "out").iterdir())
    if done.returncode or left != [name]:
        return found._replace(finding=f"the next run: exit code {done.returncode}, there is {left}")
    return found
