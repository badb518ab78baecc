"""What method = "profile" costs: processor time per sample, and as a multiple of the NumPy kernel of method dsd."""

from __future__ import annotations

import time
from pathlib import Path

from bench.beyond._runs import State, T, excitation, measured, table
from dsd_cli.detect import DetectorSettings, Engine, Grid
from dsd_cli.detect.engine import Measurement

SAMPLES = 20_000
DELAYS = ((0.0, 0.004, 0.008), (0.0, 0.04, 0.08), (0.2, 0.3, 0.4))


def microseconds(delays: tuple[float, ...], method: str, change: float = 20.0) -> float:
    """Of one sample, the best of three runs."""
    u = excitation(SAMPLES, 1)
    d_hat = measured(u, [State(delays[1], 1.0)])
    best = float("inf")
    for _ in range(3):
        settings = DetectorSettings(method=method, rho=0.1, change=change)  # type: ignore[arg-type]
        engine = Engine(Grid(delays, (0.5, 1.0, 2.0)), settings, Measurement(T, 1.0, 0.01), "numpy")
        engine.run(u[:1000], d_hat[:1000])
        begin = time.process_time()
        engine.run(u[1000:], d_hat[1000:])
        best = min(best, time.process_time() - begin)
    return 1e6 * best / (SAMPLES - 1000)


def section(pictures: Path) -> str:
    rows = []
    for delays in DELAYS:
        dsd = microseconds(delays, "dsd")
        plain, changes = (microseconds(delays, "profile", change) for change in (0.0, 20.0))
        looked = round((delays[-1] - delays[0]) / T * (1.0 + 0.5 / (len(delays) - 1) * (2 if delays[0] else 1))) + 1
        cells = (f"{plain:.1f}", f"{changes:.1f}", f"{changes / dsd:.0f}")
        rows.append((", ".join(f"{1e3 * delay:g}" for delay in delays) + " ms", str(looked), *cells))
    head = ("candidates", "delays looked at", "us per sample", "with the test for changes", "times method dsd")
    return table(head, rows)
