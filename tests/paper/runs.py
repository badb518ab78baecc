"""The paper's runs: a template, simulated and labelled as `dsd simulate` and `dsd detect` do it."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from dsd_cli.cli.plan import detector_settings
from dsd_cli.cli.simulate import simulation_settings
from dsd_cli.detect import Engine, Grid, Labels
from dsd_cli.detect.engine import Measurement
from dsd_cli.files.config import Observer, States
from dsd_cli.files.template import load_template
from dsd_cli.plant.simulation import simulate
from dsd_cli.signals.log import Log

#: Table I: the inertias of the six simulations.
INERTIAS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
#: Those that are no candidate: 0.5, 1.0 and 2.0 are.
BETWEEN = (0.6, 0.7, 0.8, 0.9)


class Run(NamedTuple):
    """A log and its labels."""

    t: np.ndarray
    log: Log
    labels: Labels

    def delay(self, after: float, before: float = np.inf) -> np.ndarray:
        """Delay labels of the samples with after <= t < before."""
        return self.labels.delay[(self.t >= after) & (self.t < before)]

    def inertia(self, after: float, before: float = np.inf) -> np.ndarray:
        """Inertia labels of the samples with after <= t < before."""
        return self.labels.inertia[(self.t >= after) & (self.t < before)]

    def confident(self, after: float, before: float = np.inf) -> np.ndarray:
        """Confidence of the samples with after <= t < before."""
        return self.labels.confident[(self.t >= after) & (self.t < before)]


@cache
def run(template: str, *overrides: str) -> Run:
    """Simulate a template with overrides (`model.inertia=0.7`) and label every sample."""
    config = load_template(template).override(overrides)
    log = simulate(simulation_settings(config))
    states, observer = config.require(States), config.require(Observer)
    grid = Grid(tuple(states.delays), tuple(states.inertias))
    measurement = Measurement(log.sample_time, observer.nominal_inertia, observer.time_constant)
    labels = Engine(grid, detector_settings(config, grid), measurement).run(log["u"], log["d_hat"])
    return Run(log["t"], log, labels)


def neighbours(inertia: float, candidates: tuple[float, ...] = (0.5, 1.0, 2.0)) -> set[float]:
    """The candidates on both sides; in 1/J, as eq. 13 has it, these are the same ones."""
    return {max(c for c in candidates if c <= inertia), min(c for c in candidates if c >= inertia)}


def follow_lag(labelled: Run, change: float = 1.5, delay: float = 0.4) -> float:
    """s from the change to the sample from which the delay label stays right; inf if it never does."""
    wrong = np.flatnonzero((labelled.t >= change) & (labelled.labels.delay != delay))
    if wrong.size and wrong[-1] == len(labelled.t) - 1:
        return float("inf")
    return float(labelled.t[wrong[-1] + 1] - change) if wrong.size else 0.0
