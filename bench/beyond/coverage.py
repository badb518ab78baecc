"""Do 95 % intervals hold 95 %, and how near is the variance to the Cramer-Rao bound?

The bound is computed here from finite differences of the plant of `_runs`, without anything of the detector.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from bench.beyond._runs import State, T, engine, excitation, measured, percent, table
from dsd_cli.detect.coloured import SensorNoise
from dsd_cli.signals.log import Array

WINDOWS = 3000
#: 97.5 % of the normal distribution.
REACH = 1.959964


class Case(NamedTuple):
    what: str
    state: State = State(0.0043, 1.3)
    noise: float = 0.1
    window: int = 100
    bandwidth: float = 20.0
    rho: float | None = None
    velocity: float = 0.0
    slow: float = 0.0
    told: bool = False


CASES = (
    Case("noise 10 % of u"),
    Case("a whole number of samples", State(0.004, 1.3)),
    Case("on a candidate", State(0.004, 1.0)),
    Case("noise 2 %", noise=0.02),
    Case("noise 30 %", noise=0.3),
    Case("noise 30 %, window 300", noise=0.3, window=300),
    Case("slow u, 5 Hz, noise 2 %", bandwidth=5.0, noise=0.02),
    Case("fast u, 100 Hz, noise 5 %", bandwidth=100.0, noise=0.05),
    Case("rho half of the noise", rho=0.05),
    Case("rho twice the noise", rho=0.2),
    Case("noise of a velocity, white rho", noise=0.02, rho=0.1, velocity=0.0005),
    Case("the same, given to the detector", noise=0.02, rho=0.02, velocity=0.0005, told=True),
    Case("noise 2 %, correlated over 2 samples, white rho", noise=0.02, slow=0.5),
    Case("noise 2 %, correlated over 10 samples", noise=0.02, slow=0.9),
    Case("noise 10 %, correlated over 10 samples", slow=0.9),
    Case("the same, window 300", slow=0.9, window=300),
    Case("delay 0, the edge of what is possible", State(0.0, 1.3), noise=0.02),
)


class Score(NamedTuple):
    """Of one value: share of windows that identify it, coverage of 95 % intervals, mean square error over the bound."""

    told: float
    coverage: float
    over_bound: float


def score(case: Case, windows: int = WINDOWS, seed: int = 0) -> tuple[Score, Score]:
    """Delay and inertia, over windows that do not overlap."""
    n, tau = windows * case.window + 1000, 0.01
    u, rng = excitation(n, seed, case.bandwidth), np.random.default_rng(seed + 1)
    noise = case.noise * rng.normal(size=n)
    if case.slow > 0.0:
        noise = np.sqrt(1.0 - case.slow**2) * lfilter([1.0], [1.0, -case.slow], noise)
    if case.velocity > 0.0:
        pole = np.exp(-T / tau)
        noise += lfilter([1.0 - pole], [1.0, -pole], np.diff(rng.normal(size=n + 1)) * case.velocity / T)
    sensor = SensorNoise(velocity=case.velocity) if case.told else SensorNoise()
    found = engine(case.window, case.rho or case.noise, tau, sensor_noise=sensor, change=0.0)
    labels = found.run(u, measured(u, [case.state]) + noise)
    at = np.arange(1000, n, case.window)
    bounds = bound(case, u, at)
    values = labels.estimates
    return tuple(  # type: ignore[return-value]
        _score(values[2 * i][at], values[2 * i + 1][at], values[4 + i][at], case.state[i], bounds[i]) for i in (0, 1)
    )


def _score(value: Array, std: Array, told: Array, truth: float, limit: Array) -> Score:
    error, std, limit = (value - truth)[told], std[told], limit[told]
    return Score(float(told.mean()), float(np.mean(np.abs(error) <= REACH * std)), float(np.mean((error / limit) ** 2)))


def bound(case: Case, u: Array, at: Array) -> tuple[Array, Array]:
    """Cramer-Rao: standard deviations of delay and inertia for the windows that end at the samples `at`."""
    (delay, inertia), step = case.state, 0.01 * T
    low = max(delay - step, 0.0)
    by_delay = (measured(u, [State(delay + step, inertia)]) - measured(u, [State(low, inertia)])) / (delay + step - low)
    by_inertia = (measured(u, [State(delay, inertia + 0.001)]) - measured(u, [State(delay, inertia - 0.001)])) / 0.002

    def summed(x: Array) -> Array:
        total = np.concatenate([[0.0], np.cumsum(x)])
        return np.asarray(total[at + 1] - total[at + 1 - case.window]) / case.noise**2

    a, b, c = summed(by_delay**2), summed(by_delay * by_inertia), summed(by_inertia**2)
    return np.sqrt(c / (a * c - b * b)), np.sqrt(a / (a * c - b * b))


def section(pictures: Path) -> str:
    rows = []
    for case in CASES:
        delay, inertia = score(case)
        cells = [f"{found.over_bound:.2f}" if case.velocity == case.slow == 0.0 else "-" for found in (delay, inertia)]
        told, covered = (
            (percent(delay.told), percent(inertia.told)),
            (percent(delay.coverage), percent(inertia.coverage)),
        )
        rows.append((case.what, told[0], covered[0], cells[0], told[1], covered[1], cells[1]))
    same = ("95 % covers", "variance / bound")
    head = ("case", "delay identified", *same, "inertia identified", *same)
    return table(head, rows)
