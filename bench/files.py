"""`dsd detect` on long files against a bare read-and-write of the same columns."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc
import pyarrow.parquet as pq

from bench.measure import Line, peak_memory, ratio, run

CONFIG = """
[observer]
nominal_inertia = 1.0
time_constant = 0.01
[states]
delays = {delays}
inertias = {inertias}
[detector]
window = 100
rho = 0.3
"""
GRIDS = {9: ([0.2, 0.3, 0.4], [0.5, 1.0, 2.0])}
GRIDS[100] = (np.linspace(0.1, 0.55, 10).round(3).tolist(), np.geomspace(0.5, 2.0, 10).round(3).tolist())
CHUNK = 1_000_000


def chunks(rows: int) -> Iterator[pa.RecordBatch]:
    """A delayed plant (0.3 s) driven by a slow random u, with noise of 0.3 on d_hat."""
    rng = np.random.default_rng(0)
    tail, level = np.zeros(300), 0.0
    for start in range(0, rows, CHUNK):
        n = min(CHUNK, rows - start)
        steps = np.repeat(rng.normal(size=n // 200 + 1), 200)[:n]
        u = steps + rng.normal(size=n) * 0.1 + level
        delayed = np.concatenate([tail, u])[:n]
        tail = u[-300:]
        d_hat = delayed - u + rng.normal(size=n) * 0.3
        yield pa.record_batch({"t": (start + np.arange(n)) * 1e-3, "u": u, "d_hat": d_hat})


def make(path: Path, rows: int) -> Path:
    """The log, as Parquet or CSV."""
    if path.exists():
        return path
    schema = next(chunks(1)).schema
    writer = pq.ParquetWriter(path, schema) if path.suffix == ".parquet" else pc.CSVWriter(path, schema)
    with writer:
        for batch in chunks(rows):
            writer.write_batch(batch)
    return path


BARE = {
    "parquet": """
import sys, pyarrow.parquet as pq
source = pq.ParquetFile(sys.argv[1], pre_buffer=False, buffer_size=1 << 20)
with pq.ParquetWriter(sys.argv[2], source.schema_arrow) as writer:
    for batch in source.iter_batches(batch_size=65536):
        writer.write_batch(batch)
""",
    "csv": """
import sys, pyarrow.csv as pc
source = pc.open_csv(sys.argv[1])
with pc.CSVWriter(sys.argv[2], source.schema) as writer:
    for batch in source:
        writer.write_batch(batch)
""",
}


def _detect(log: Path, states: int, out: Path) -> tuple[str, ...]:
    config = out.with_name(f"grid{states}.toml")
    delays, inertias = GRIDS[states]
    config.write_text(CONFIG.format(delays=delays, inertias=inertias))
    return ("-m", "dsd_cli", "detect", str(log), "-c", str(config), "-o", str(out), "--quiet")


def lines(folder: Path, rows: int, repeats: int) -> Iterator[Line]:
    """Throughput and memory."""
    targets = {("parquet", 9): 1.3, ("parquet", 100): 1.4, ("csv", 9): 1.2, ("csv", 100): 1.4}
    for (kind, states), target in targets.items():
        count = rows if kind == "parquet" else rows // 5
        log, out = make(folder / f"log{count}.{kind}", count), folder / f"labels.{kind}"
        detect = _detect(log, states, out)
        bare = ("-c", BARE[kind], str(log), str(folder / f"copy.{kind}"))
        value, a, b = ratio(lambda d=detect: run(*d), lambda d=bare: run(*d), repeats)
        what = f"detect {kind} to {kind}, {count / 1e6:g} M rows, {states} states / bare read and write"
        yield Line(what, value, target, "times", f"{a:.2f} s / {b:.2f} s")
    for count in (rows, 5 * rows):
        log = make(folder / f"log{count}.parquet", count)
        value = peak_memory(*_detect(log, 9, folder / "labels.parquet"))
        yield Line(f"peak memory, {count / 1e6:g} M rows of Parquet", value, 250.0, "MB")
