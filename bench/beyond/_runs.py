"""What several items share: logs of the paper's templates, logs made by a few lines of NumPy, Markdown tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from dsd_cli.cli.plan import detection_plan, detector_settings
from dsd_cli.cli.simulate import simulation_settings
from dsd_cli.detect import DetectorSettings, Engine, Grid, Labels
from dsd_cli.detect.engine import Measurement
from dsd_cli.detect.rows import Rows
from dsd_cli.detect.session import Session
from dsd_cli.files.config import Config, Observer, States
from dsd_cli.files.template import load_template
from dsd_cli.plant.simulation import simulate
from dsd_cli.signals.cleaning import Cleaner
from dsd_cli.signals.log import Array, Log

#: s, of the logs made here.
T = 0.001


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Markdown."""
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    return "\n".join(lines + [f"| {' | '.join(row)} |" for row in rows])


def percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


@cache
def simulated(template: str, *overrides: str) -> tuple[Config, Log]:
    """A template's run."""
    config = load_template(template).override(overrides)
    return config, simulate(simulation_settings(config))


def labelled(config: Config, log: Log, noise: float, seed: int, *overrides: str) -> tuple[Grid, Labels]:
    """Labels of a run with white noise on d_hat."""
    config = config.override(overrides)
    states, observer = config.require(States), config.require(Observer)
    grid = Grid(tuple(states.delays), tuple(states.inertias))
    engine = Engine(
        grid,
        detector_settings(config, grid),
        Measurement(log.sample_time, observer.nominal_inertia, observer.time_constant),
    )
    d_hat = np.array(log["d_hat"]) + noise * np.random.default_rng(seed).normal(size=len(log))
    return grid, engine.run(np.array(log["u"]), d_hat)


def detected(config: Config, log: Log, noise: float, seed: int, *overrides: str) -> Rows:
    """The same as `dsd detect` has it, with what it asks of a confident label."""
    config = config.override(overrides)
    d_hat = np.array(log["d_hat"]) + noise * np.random.default_rng(seed).normal(size=len(log))
    columns = {"t": np.array(log["t"]), "u": np.array(log["u"]), "d_hat": d_hat}
    session = Session(detection_plan(config, {name: name for name in columns}, {}, "log"), Cleaner(None))
    parts = [*session.feed(columns["t"], columns), *session.finish()]
    return Rows(*(np.concatenate([part[i] for part in parts]) for i in range(6)))


class State(NamedTuple):
    """A plant: delay in s and inertia."""

    delay: float
    inertia: float


def excitation(n: int, seed: int, bandwidth: float = 20.0) -> Array:
    """u of rms 1: white noise through two low-passes of `bandwidth`, Hz."""
    pole = np.exp(-2.0 * np.pi * bandwidth * T)
    noise = np.random.default_rng(seed).normal(size=n)
    u = lfilter([1.0 - pole], [1.0, -pole], lfilter([1.0 - pole], [1.0, -pole], noise))
    return np.asarray(u / u.std())


def measured(u: Array, states: Sequence[State], cuts: Sequence[int] = (), tau: float = 0.01) -> Array:
    """d_hat without noise of a plant that changes at the samples `cuts`; Jn = 1, u held between samples."""
    pole = np.exp(-T / tau)
    raw, edges = np.zeros(len(u)), [0, *cuts, len(u)]
    for state, begin, end in zip(states, edges[:-1], edges[1:], strict=True):
        whole = int(np.floor(state.delay / T + 1e-9))
        part = state.delay / T - whole
        late = (1.0 - part) * _shifted(u, whole + 1) + part * _shifted(u, whole + 2)
        raw[begin:end] = (late / state.inertia - _shifted(u, 1))[begin:end]
    return np.asarray(lfilter([1.0 - pole], [1.0, -pole], raw))


def _shifted(u: Array, by: int) -> Array:
    return np.concatenate([np.zeros(by), u])[: len(u)]


GRID = Grid((0.0, 0.004, 0.008), (0.5, 1.0, 2.0))


def engine(window: int = 100, rho: float = 0.1, tau: float = 0.01, **tuning: object) -> Engine:
    """A detector of method "profile" for the logs made here."""
    settings = DetectorSettings(method="profile", window=window, rho=rho, **tuning)  # type: ignore[arg-type]
    return Engine(GRID, settings, Measurement(T, 1.0, tau))
