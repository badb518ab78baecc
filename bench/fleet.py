"""`python -m bench fleet`: many logs through `dsd fleet`: what two workers gain on one, memory over 10,000 logs."""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import predict_d_hat
from dsd_cli.signals.log import Log

CONFIG = """
[observer]
nominal_inertia = 1.0
time_constant = 0.002
[model]
inertia = 1.0
delay = 0.005
[states]
delays = [0.0, 0.005, 0.01]
inertias = [0.5, 1.0, 2.0]
[detector]
window = 40
rho = 0.1
"""
#: Logs that are really made; the rest are other names of them.
MADE = 10
DSD = [sys.executable, "-m", "dsd_cli", "fleet"]


def make_logs(folder: Path, count: int, rows: int) -> None:
    """Logs of a plant in one state each."""
    folder.mkdir()
    for k in range(count):
        path = folder / f"{k:05d}.parquet"
        if k >= MADE:
            os.link(folder / f"{k % MADE:05d}.parquet", path)
            continue
        rng = np.random.default_rng(k)
        t = np.arange(rows) * 1e-3
        u = sum(np.sin(w * t + p) for w, p in zip((5.0, 13.0, 41.0), rng.uniform(0, 6, 3), strict=True))
        velocity = np.cumsum(np.concatenate([np.zeros(5), u[:-5]])) * 1e-3
        log = Log({"t": t, "u": u}, 1e-3)
        d_hat = predict_d_hat(PlantModel(1.0, 0.005), log, ObserverSettings(time_constant=0.002))
        table = {"t": t, "u": u, "d_hat": d_hat + 0.02 * rng.normal(size=rows), "velocity": velocity}
        pq.write_table(pa.table(table), path)


def took(folder: Path, logs: str, where: list[str]) -> tuple[float, float]:
    """(s, s of all processors) of one run from nothing."""
    arguments = ["detect", logs, "-o", "r.parquet", *where, "--anew", "--quiet"]
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([*DSD, *arguments], cwd=folder, check=True)
    wall, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def gain(folder: Path, logs: str, repeats: int) -> str:
    """What a second worker gains: the shortest of each, taken in turns, and what the processor time allows.

    What the command and a worker take to start is not halved by a second one; all the rest is.
    """
    kinds = {"1 worker": ["--workers", "1"], "2 workers": ["--workers", "2"], "Dask local:2": ["--cluster", "local:2"]}
    start = min(took(folder, f"{logs}/00000.parquet", kinds["1 worker"])[1] for _ in range(3))
    turns = [{name: took(folder, f"{logs}/*", where) for name, where in kinds.items()} for _ in range(repeats)]
    wall = {name: min(turn[name][0] for turn in turns) for name in kinds}
    cpu = {name: min(turn[name][1] for turn in turns) for name in kinds}
    one, two = cpu["1 worker"], cpu["2 workers"]
    bounds = [one / (start + (total - start) / 2) for total in (one, two)]
    said = [f"{name} {wall[name]:.1f} s ({cpu[name]:.1f} s of CPU)" for name in kinds]
    said += [f"{wall['1 worker'] / wall[name]:.2f} times as fast with {name}" for name in list(kinds)[1:]]
    said += [
        f"at least 1.85; by the CPU time of 1 worker {bounds[0]:.2f}, of 2 {bounds[1]:.2f}; {start:.2f} s to start"
    ]
    return "; ".join([*said, f"load of the machine {os.getloadavg()[0]:.1f}"])


def memory(folder: Path, logs: str, count: int) -> list[tuple[float, int]]:
    """(MB of the whole run, largest process), after each tenth of the logs."""
    arguments = ["detect", f"{logs}/*", "-o", "m.parquet", "--workers", "2", "--quiet"]
    run = subprocess.Popen([*DSD, *arguments], cwd=folder)
    part, found = folder / "m.parquet.part", []
    while run.poll() is None:
        done = part.read_bytes().count(b"\n") if part.exists() else 0
        sizes = [_resident(pid) for pid in (run.pid, *_children(run.pid))]
        if done >= (len(found) + 1) * count / 10:
            found.append((sum(sizes), max(sizes)))
        time.sleep(0.1)
    return found


def _children(pid: int) -> list[int]:
    return [int(one) for one in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def _resident(pid: int) -> int:
    """MB."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) // 1024 for line in lines if line.startswith("VmRSS")), 0)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m bench fleet")
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--short", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=2)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="dsd-fleet-") as name:
        folder = Path(name)
        (folder / "dsd.toml").write_text(CONFIG)
        make_logs(folder / "long", options.logs, options.rows)
        print(f"detect of {options.logs} logs of {options.rows:,} rows: ", end="")
        print(gain(folder, "long", options.repeats), flush=True)
        make_logs(folder / "short", options.short, 300)
        begin = time.perf_counter()
        sizes = memory(folder, "short", options.short)
        rate = options.short / (time.perf_counter() - begin)
        print(f"detect of {options.short:,} logs of 300 rows, 2 workers: {rate:.0f} logs a second; ", end="")
        print(f"MB of all processes after each tenth {[total for total, _ in sizes]}, ", end="")
        print(f"of the largest {[most for _, most in sizes]}")


if __name__ == "__main__":
    main([])
