"""The kernel: window length, number of states, one step, and what the peers take on the same states."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from bench.files import GRIDS, chunks
from bench.measure import Line, ratio, seconds
from dsd_cli.detect import DetectorSettings, Engine, Grid
from dsd_cli.detect.engine import Measurement
from dsd_cli.detect.kernel import active_backend

#: Runs over the same samples, each step timed.
PASSES = 5


def engine(states: int = 9, window: int = 100, backend: str | None = None) -> Engine:
    delays, inertias = GRIDS[states]
    return Engine(Grid(tuple(delays), tuple(inertias)), DetectorSettings(window=window), Measurement(1e-3), backend)  # type: ignore[arg-type]


def data(rows: int) -> tuple[np.ndarray, np.ndarray]:
    batch = next(chunks(rows))
    return batch["u"].to_numpy(), batch["d_hat"].to_numpy()


def lines(rows: int, repeats: int) -> Iterator[Line]:
    """Ratios of the kernel with itself."""
    u, d = data(rows)

    def whole(**tuning: int) -> None:
        engine(**tuning).run(u, d)

    pairs = [
        ("window 10,000 / window 10, 9 states", {"window": 10_000}, {"window": 10}, 1.1),
        (
            "window 10,000 / window 10, 100 states",
            {"states": 100, "window": 10_000},
            {"states": 100, "window": 10},
            1.1,
        ),
        ("100 states / 9 states", {"states": 100}, {"states": 9}, 6.0),
    ]
    for what, ours, theirs, target in pairs:
        value, a, b = ratio(lambda t=ours: whole(**t), lambda t=theirs: whole(**t), repeats)
        yield Line(
            f"kernel: {what}", value, target, "times", f"{a / rows * 1e9:.0f} ns / {b / rows * 1e9:.0f} ns a sample"
        )
    for backend, target in (("compiled", 1.0), ("numpy", 15.0)):
        if backend == "compiled" and active_backend() != "compiled":
            continue
        yield _step(backend, target, u.tolist(), d.tolist())


def _step(backend: str, target: float, u: list[float], d: list[float]) -> Line:
    """The quietest of some passes: what else the machine does comes on top of a step, and of one in a hundred first."""
    passes = [_times(backend, u[:20_000], d[:20_000]) for _ in range(PASSES)]
    high = min(np.percentile(one, 99) for one in passes)
    middle, alone = np.median(passes), np.percentile(np.min(passes, axis=0), 99)
    detail = f"median {middle:.2f} us; p99 of the least of {PASSES} passes for each step {alone:.2f} us"
    return Line(f"Engine.step, 9 states, {backend}: p99", float(high), target, "us", detail)


def _times(backend: str, u: list[float], d: list[float]) -> list[float]:
    """us of each step."""
    one, times = engine(backend=backend), []
    for a, b in zip(u, d, strict=True):
        begin = time.perf_counter_ns()
        one.step(a, b)
        times.append((time.perf_counter_ns() - begin) / 1e3)
    return times


def peers(rows: int) -> Iterator[Line]:
    """hmmlearn's Viterbi and FilterPy's IMM on the same nine states, per sample."""
    u, d = data(rows)
    ours = min(seconds(lambda: engine().run(u, d)) for _ in range(5)) / rows
    detail = "its recursion alone, with the likelihoods handed to it; ours computes them"
    yield Line("hmmlearn Viterbi / ours, 9 states", _viterbi(len(u)) / ours, 5.0, "times", detail, at_least=True)
    detail = "likelihoods and recursion"
    yield Line("hmmlearn GaussianHMM.decode / ours, 9 states", _decode(u) / ours, 5.0, "times", detail, at_least=True)
    yield Line("FilterPy IMM / ours, 9 states", _imm(2000) / ours, 10_000.0, "times", at_least=True)


def _decode(u: np.ndarray) -> float:
    """Seconds per sample of a Gaussian HMM with nine states over one channel."""
    from hmmlearn.hmm import GaussianHMM

    model = GaussianHMM(n_components=9, covariance_type="spherical")
    model.startprob_, model.transmat_ = np.full(9, 1 / 9), np.full((9, 9), 1 / 9)
    model.means_, model.covars_ = np.linspace(-2, 2, 9)[:, None], np.full(9, 0.09)
    return min(seconds(lambda: model.decode(u[:, None], algorithm="viterbi")) for _ in range(3)) / len(u)


def _viterbi(rows: int) -> float:
    """Seconds per sample of the decoding alone, with the log likelihoods handed to it."""
    from hmmlearn import _hmmc

    frame = np.random.default_rng(0).normal(size=(rows, 9))
    start, transition = np.log(np.full(9, 1 / 9)), np.log(np.full((9, 9), 1 / 9))
    try:
        return min(seconds(lambda: _hmmc.viterbi(start, transition, frame)) for _ in range(3)) / rows
    except TypeError:
        return min(seconds(lambda: _hmmc.viterbi(np.exp(start), np.exp(transition), frame)) for _ in range(3)) / rows


def _imm(rows: int) -> float:
    """Seconds per sample of predict and update, each state a scalar Kalman filter."""
    from filterpy.kalman import IMMEstimator, KalmanFilter

    filters = []
    for _ in range(9):
        one = KalmanFilter(dim_x=1, dim_z=1)
        one.F, one.H, one.R, one.Q = np.eye(1), np.eye(1), np.eye(1) * 0.09, np.eye(1) * 1e-3
        filters.append(one)
    imm = IMMEstimator(filters, np.full(9, 1 / 9), np.full((9, 9), 1 / 9))

    def loop() -> None:
        for k in range(rows):
            imm.predict()
            imm.update(np.array([[np.sin(0.01 * k)]]))

    return seconds(loop) / rows
