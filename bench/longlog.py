"""`python -m bench longlog [--hours H] [--rate HZ]`: a day-long recording, made on the fly, through `dsd detect`.

The log is a minute of a servo axis whose delay and inertia change, over and over with fresh noise, and never stored:
the rows go through the code that `dsd detect LOG` runs, as from a file. Of a few places the minute around them is made
again, labelled by itself, and its labels are held against those of the whole.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Iterator, Mapping

import numpy as np

from dsd_cli.cli.detect_checks import Judgement
from dsd_cli.cli.detect_job import Destination, Job
from dsd_cli.detect.rows import Rows
from dsd_cli.files.config import parse_config
from dsd_cli.files.table_source import Batch, TableSource
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import predict_d_hat
from dsd_cli.signals.log import Array, Log

BATCH_ROWS = 1 << 17
#: s of the stretch that is repeated; delay and inertia change in its middle.
PERIOD = 60.0
NOISE = 0.01
STATES = ((0.001, 0.01), (0.002, 0.015))
#: Rows at each place that is labelled by itself too, and rows before them that it takes to forget where it began.
PART_ROWS, LEAD_ROWS = 50_000, 100_000
#: So often it says how far it is, and how large.
REPORT_ROWS = 100_000_000
CONFIG = """
[observer]
nominal_inertia = 0.01
time_constant = 0.002
[states]
delays = [0.0, 0.001, 0.002]
inertias = [0.007, 0.01, 0.015]
[detector]
window = 1000
rho = 0.02
hold = 3.0
"""


class LongLog:
    """Rows `start` to `stop` of the recording; see `TableSource`. The same rows whatever the part asked for."""

    def __init__(self, rate: float, start: int, stop: int) -> None:
        self.name, self.metadata, self.warnings = f"{(stop - start) / rate / 3600:g} h at {rate:g} Hz", {}, []
        self.columns: Mapping[str, str] = {name: name for name in ("t", "u", "d_hat")}
        self.column_names, self.unreadable = list(self.columns), 0
        self._rate, self._start, self._stop = rate, start, stop
        self._u, self._d_hat = _period(rate)

    def batches(self) -> Iterator[Batch]:
        for block in range(self._start // BATCH_ROWS, -(-self._stop // BATCH_ROWS)):
            at = np.arange(block * BATCH_ROWS, (block + 1) * BATCH_ROWS)
            noise = np.random.default_rng(block).standard_normal(BATCH_ROWS)
            place = at % self._u.size
            columns = {"t": at / self._rate, "u": self._u[place], "d_hat": self._d_hat[place] + NOISE * noise}
            cut = slice(max(self._start - at[0], 0), self._stop - at[0])
            yield Batch(columns["t"][cut].size, {name: values[cut] for name, values in columns.items()})


def _period(rate: float) -> tuple[Array, Array]:
    """u and d_hat of one period, in the state that has settled when it is repeated."""
    rows = round(PERIOD * rate)
    t = np.arange(2 * rows) / rate
    turns = 2 * np.pi * np.round(np.array([0.7, 3.1, 8.3, 19.0, 41.0]) * PERIOD) / PERIOD
    u = sum(np.sin(turn * t + k) for k, turn in enumerate(turns)) / np.sqrt(turns.size)
    log = Log({"t": t, "u": u}, 1.0 / rate)
    settings = ObserverSettings(0.01, 0.002)
    parts = [predict_d_hat(PlantModel(inertia, delay), log, settings) for delay, inertia in STATES]
    half = rows // 2
    return u[rows:], np.concatenate([parts[0][rows : rows + half], parts[1][rows + half :]])


class LongJob(Job):
    """`dsd detect`, but for where the rows come from and who looks at the labels."""

    def __init__(self, table: LongLog, keep: list[slice]) -> None:
        super().__init__(table.name, parse_config(CONFIG), False, Destination("json", None, True, ()))
        self._table, self._at, self._keep = table, 0, keep
        self.kept: list[list[Rows]] = [[] for _ in keep]
        self.memory: list[float] = []

    def _open(self, interrupted: list[bool]) -> TableSource:
        return self._table

    def _labels(self, table, session, truth):  # type: ignore[no-untyped-def]
        for rows in super()._labels(table, session, truth):
            for kept, part in zip(self.kept, self._keep, strict=True):
                a, b = max(part.start - self._at, 0), min(part.stop - self._at, rows.state.size)
                if a < b:
                    kept.append(Rows(*(column[a:b].copy() for column in rows)))
            if (self._at + rows.state.size) // REPORT_ROWS > self._at // REPORT_ROWS:
                done = self._at + rows.state.size
                print(f"  {done:,} rows, {_resident():.0f} MB", file=sys.stderr, flush=True)
            self._at += rows.state.size
            yield rows


def _joined(parts: list[Rows]) -> Rows:
    return Rows(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _resident() -> float:
    """MB of this process at its largest."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _differences(rate: float, rows: int, at: int, whole: Rows) -> int:
    """Labels of the place that are others when it is labelled by itself."""
    start = max(0, at - LEAD_ROWS)
    job = LongJob(LongLog(rate, start, at + PART_ROWS), [slice(at - start, at - start + PART_ROWS)])
    job.run(Judgement())
    alone = _joined(job.kept[0])
    return int(((alone.state != whole.state) | (alone.confident != whole.confident)).sum())


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m bench longlog")
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--rate", type=float, default=10_000.0)
    parser.add_argument("--parts", type=int, default=8)
    options = parser.parse_args(arguments)
    rows = round(options.hours * 3600 * options.rate)
    first = LongJob(LongLog(options.rate, 0, min(rows, 3_000_000)), [])
    first.run(Judgement())
    early = _resident()
    places = np.linspace(0, rows - PART_ROWS, options.parts).astype(int).tolist()
    job = LongJob(LongLog(options.rate, 0, rows), [slice(at, at + PART_ROWS) for at in places])
    begin = time.perf_counter()
    result = job.run(Judgement())
    took = time.perf_counter() - begin
    late = _resident()
    wrong = [_differences(options.rate, rows, at, _joined(kept)) for at, kept in zip(places, job.kept, strict=True)]
    summary = result.summary
    print(
        f"{summary.samples:,} rows ({options.hours:g} h at {options.rate:g} Hz) in {took:,.0f} s, made on the fly: ",
        end="",
    )
    print(
        f"{1e9 * took / rows:.0f} ns a row, {options.hours * 3600 / took:,.0f} times as fast as they would be recorded"
    )
    print(
        f"peak memory after 3 M rows {early:.0f} MB, at the end {late:.0f} MB (labels of {len(places)} parts included)"
    )
    print(
        f"labels that are others when a part is labelled by itself: {sum(wrong)} of {len(places) * PART_ROWS:,} {wrong}"
    )
    shares = {state.index: state.share for state in summary.states if state.share > 0.001}
    print(
        f"shares of states {shares}; {summary.segments_total:,} segments; "
        f"{100 * summary.confident_share:.1f} % confident"
    )


if __name__ == "__main__":
    main([])
