"""`python -m bench kills --runs 1000`: commands that write, ended by signals at random times, and what they leave.

Half of the signals come while a file is being written. A run is a forked copy of this process, which has the package
imported already, so that signals meet work and not the start of an interpreter; the tests use new processes. The number
of a run decides all of it; a finding prints the command that repeats it.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

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


class Process(Protocol):
    """A command that runs."""

    def wait(self, seconds: float) -> int | None:
        """Its exit code; None if it still runs after so long."""

    def send(self, number: int) -> None: ...


class Fresh:
    """In a new interpreter."""

    def __init__(self, arguments: list[str], said: Path) -> None:
        with said.open("wb") as stderr:
            command = [sys.executable, "-m", "dsd_cli", *arguments]
            self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=stderr)

    def wait(self, seconds: float) -> int | None:
        try:
            return self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def send(self, number: int) -> None:
        self._process.send_signal(number)


class Forked:
    """In a copy of this process, which must have no threads."""

    def __init__(self, arguments: list[str], said: Path) -> None:
        self._process = multiprocessing.get_context("fork").Process(target=_child, args=(arguments, said))
        self._process.start()

    def wait(self, seconds: float) -> int | None:
        self._process.join(seconds)
        return self._process.exitcode

    def send(self, number: int) -> None:
        if self._process.pid is not None and self._process.exitcode is None:
            os.kill(self._process.pid, number)


def _child(arguments: list[str], said: Path) -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # as `dsd` begins; of a fork that has not got so far, nothing is asked
    for number, name in ((0, os.devnull), (1, os.devnull), (2, str(said))):
        os.dup2(os.open(name, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600), number)
    sys.stdout = os.fdopen(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = os.fdopen(2, "w", encoding="utf-8", closefd=False)
    sys.argv = ["dsd", *arguments]
    from dsd_cli.cli.main import main as dsd

    dsd()


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
    """What writes `name`: `dsd detect` of the log in the folder into `labels...`, or a command of `OTHERS`."""
    if name in OTHERS:
        made = [str(folder / word) if word.startswith("rig.") else word for word in OTHERS[name]]
        return [*made, "-c", str(folder / "rig.toml"), "-o", str(folder / "out" / name), "--quiet"]
    log, config, out = (str(folder / one) for one in ("log.csv", "dsd.toml", f"out/{name}"))
    return ["detect", log, "-c", config, "-o", out, "--quiet"]


def kill(
    folder: Path, name: str, number: int, after: float, start: Callable[[list[str], Path], Process] = Fresh
) -> Kill:
    """Run the command, send it the signal after so many seconds (when it writes, if `after` is negative), and look.

    `folder` has log.csv and dsd.toml; out/ is made anew, with an old file of that name in it.
    """
    out, said = folder / "out", folder / "said"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    if name != FLEET:  # which goes on from a table of its own only
        (out / name).write_bytes(OLD)
    said.unlink(missing_ok=True)  # a worker of the run before may still write into that one
    said.touch()
    began = time.monotonic()
    process = start(command(folder, name), said)
    if after < 0.0:
        while process.wait(0.0) is None and not any(p.name.endswith((".tmp", ".part")) for p in out.iterdir()):
            time.sleep(0.001)
        after = -after
    if process.wait(after) is None:
        process.send(number)
    code = process.wait(PATIENCE)
    seconds = time.monotonic() - began
    if code is None:
        process.send(signal.SIGKILL)
        process.wait(PATIENCE)
        return Kill(-signal.SIGKILL, seconds, f"no end within {PATIENCE} s of the signal")
    return Kill(code, seconds, _finding(code, said.read_bytes(), out, name, number))


def _finding(code: int, said: bytes, out: Path, name: str, number: int) -> str:
    ended = (-number, 128 + number)
    if code not in (0, *ended):
        return f"exit code {code}: {said.decode(errors='replace')[-300:]}"
    of_worker = name == FLEET and b"spawn.py" in said  # Python's own, of a worker whose parent went while it began
    if (b"Traceback" in said or b"Exception" in said) and not of_worker:
        return f"a traceback: {said.decode(errors='replace')[-300:]}"
    kept = (name, f"{name}.meta.json", f"{FLEET}.part")  # the rows so far of a fleet are what it goes on from
    left = sorted(p.name for p in out.iterdir() if p.name not in kept)
    if left and number != signal.SIGKILL:
        return f"left behind: {left}"
    content = (out / name).read_bytes() if (out / name).exists() else OLD
    if content != OLD and not _is_whole(content, name, out.parent / f"whole.{name}"):
        return f"half a file of {len(content)} bytes"
    return ""


def _is_whole(content: bytes, name: str, other: Path) -> bool:
    """`other` : what a run wrote that nothing ended, if there is one; dates and times are as long in both."""
    if name.endswith(".parquet"):
        return content[:4] == content[-4:] == b"PAR1"
    if name in OTHERS:
        return not other.exists() or abs(len(content) - other.stat().st_size) <= SLACK
    return content.endswith(b"\n") and content.count(b"\n") == ROWS + 1


ROWS, SHORT = 60_000, 700
#: Bytes by which two runs may differ.
SLACK = 64
#: File -> what writes it; rig.csv and rig.toml are in the folder.
FLEET = "results.csv"
OTHERS = {
    "added.toml": ("add", "rig.csv", "coulomb_friction"),
    "improved.toml": ("improve", "rig.csv", "--auto"),
    "tuned.toml": ("tune", "rig.csv"),
    "page.html": ("report", "rig.csv"),
    FLEET: ("fleet", "detect", "rig.csv", "rig.toml", "--workers", "1"),
}
#: Most of the runs label.
NAMES = (*["labels.csv", "labels.parquet"] * 4, *OTHERS)
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
    """Logs and configs for `kill`."""
    big_log(folder / "log.csv", ROWS)
    (folder / "dsd.toml").write_text(CONFIG)
    samples = Path(__file__).parents[1] / "sample_logs"
    lines = (samples / "servo-friction.csv").read_bytes().splitlines(keepends=True)
    (folder / "rig.csv").write_bytes(b"".join(lines[: SHORT + 1]))
    shutil.copy(samples / "servo-bare.toml", folder / "rig.toml")


def undisturbed(folder: Path, name: str) -> float:
    """Seconds that a run takes which nothing ends; what it wrote is kept beside."""
    found = kill(folder, name, signal.SIGTERM, PATIENCE, Forked)
    if found.code or (folder / "out" / name).read_bytes() == OLD:
        raise RuntimeError(f"{name}: exit code {found.code}: {(folder / 'said').read_text()}")
    shutil.copy(folder / "out" / name, folder / f"whole.{name}")
    return found.seconds


def random_kill(folder: Path, seed: int, longest: dict[str, float]) -> tuple[str, Kill]:
    """A kill of a forked run that the seed decides; what it was, in words. `longest` : file -> s, as needed."""
    rng = random.Random(seed)
    name = rng.choice(NAMES)
    if name not in longest:
        longest[name] = undisturbed(folder, name)
    number = rng.choice((*ANSWERED, *ANSWERED, signal.SIGKILL))
    after = rng.choice((rng.uniform(0.0, longest[name]), -rng.uniform(0.0001, 0.06)))
    what = f"{name}, {signal.Signals(number).name} {'while it writes, ' if after < 0 else ''}after {abs(after):.4f} s"
    found = kill(folder, name, number, after, Forked)
    if number == signal.SIGKILL and not found.finding:
        found = cleaned(folder, name, found, Forked)
    return what, found


def cleaned(folder: Path, name: str, found: Kill, start: Callable[[list[str], Path], Process] = Fresh) -> Kill:
    """After a SIGKILL the next run takes away what was left, and does its work."""
    code = start(command(folder, name), folder / "said").wait(PATIENCE)
    left = sorted(p.name for p in (folder / "out").iterdir())
    if code or left != [name]:
        return found._replace(finding=f"the next run: exit code {code}, there is {left}")
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Random kills; exit code 1 if there was a finding."""
    from bench.fuzz import warm_up

    parser = argparse.ArgumentParser(prog="python -m bench kills", description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0, help="number of the first run")
    options = parser.parse_args(arguments)
    findings, codes = 0, Counter[int]()
    with tempfile.TemporaryDirectory(prefix="dsd-kills-") as name:
        folder = Path(name)
        subprocess.run([sys.executable, "-c", PREPARE, name], check=True)  # it starts threads, which no fork may find
        warm_up()
        longest: dict[str, float] = {}
        for number in range(options.seed, options.seed + options.runs):
            what, one = random_kill(folder, number, longest)
            codes[one.code] += 1
            if one.finding:
                findings += 1
                print(f"{what}: {one.finding}\n  repeat: python -m bench kills --runs 1 --seed {number}", flush=True)
    print(f"{options.runs} kills, exit codes {dict(sorted(codes.items()))}: {findings} finding(s)")
    sys.exit(1 if findings else 0)


PREPARE = "import sys; from pathlib import Path; from bench import fuzz_kills; fuzz_kills.prepare(Path(sys.argv[1]))"
