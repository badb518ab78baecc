"""Simulated logs for the study of `dsd tune`, and the best of a 5 x 5 x 5 sweep of each, which knows the truth."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from dsd_cli.cli.plan import detection_plan
from dsd_cli.cli.simulate import simulation_settings
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.detect.transition import Transition
from dsd_cli.detect.tune.evidence import Evidence, Gatherer
from dsd_cli.files.template import load_template
from dsd_cli.plant.simulation import simulate
from dsd_cli.signals.cleaning import Cleaner
from dsd_cli.signals.log import Array, Log

#: Name -> overrides of the template paper-sine; every log has changes of delay and inertia.
LOGS = {
    "sine, 3 changes": (
        "simulate.duration=8",
        "simulate.noise=0.1",
        "simulate.events=[{time=2, delay=0.4}, {time=4, inertia=0.5}, {time=6, delay=0.2, inertia=2.0}]",
    ),
    "sine, loud": (
        "simulate.duration=8",
        "simulate.noise=3.0",
        "simulate.events=[{time=2, delay=0.4}, {time=4, inertia=0.5}, {time=6, delay=0.2, inertia=2.0}]",
    ),
    "multisine, slow": (
        "simulate.duration=20",
        "simulate.noise=0.05",
        'simulate.reference={kind="multisine", frequencies=[1.0, 2.3, 5.1]}',
        "simulate.events=[{time=5, inertia=2.0}, {time=10, delay=0.4}, {time=15, delay=0.2, inertia=0.5}]",
    ),
    "moves with rests": (
        "simulate.duration=20",
        "simulate.noise=0.02",
        'simulate.reference={kind="trapezoid", distance=1.0, speed=1.0, acceleration=4.0, dwell=1.0}',
        "simulate.events=[{time=6, inertia=0.5}, {time=13, delay=0.2}]",
    ),
    "steps of delay, J between candidates": (
        "simulate.duration=8",
        "simulate.noise=0.1",
        "model.inertia=0.8",
        "simulate.events=[{time=3, delay=0.4}, {time=5.5, delay=0.2}]",
    ),
}
RHOS = (0.03, 0.1, 0.3, 1.0, 3.0)
WINDOWS = (10, 30, 100, 300, 1000)
TRANSITIONS = (Transition(), *(Transition(stay=s) for s in (0.9, 0.99, 0.999, 0.9999)))


def evidence(name: str, seed: int = 1) -> tuple[Evidence, Log]:
    """The log as `dsd tune` reads it, and the log with its truth."""
    config = load_template("paper-sine").override([*LOGS[name], f"simulate.seed={seed}"])
    log = simulate(simulation_settings(config))
    plan = detection_plan(config, {"t": "t", "u": "u", "d_hat": "d_hat"}, {}, name)
    session = Gatherer(plan, Cleaner(None))
    for _ in itertools.chain(session.feed(log["t"], log.channels), session.finish()):
        pass
    return session.evidence(), log


def correct(evidence: Evidence, settings: DetectorSettings, log: Log) -> float:
    """Share of the judged samples whose label is the candidate nearest to the truth, as `dsd detect` counts."""
    labels = evidence.run(settings)
    judged = np.isfinite(labels.log_likelihood)
    delay = _nearest(labels.delay, log["true_delay"], evidence.engine.grid.axes["delay"])
    inertia = _nearest(1.0 / labels.inertia, 1.0 / log["true_inertia"], 1.0 / evidence.engine.grid.axes["inertia"])
    return float(np.mean((delay & inertia)[judged]))


def _nearest(label: Array, truth: Array, axis: Array) -> Array:
    nearest = np.abs(axis[None, :] - truth[:, None]).min(axis=1)
    return np.asarray(np.abs(label - truth) <= nearest * (1 + 1e-9) + 1e-12)


def sweep(evidence: Evidence, log: Log) -> Iterator[tuple[float, DetectorSettings]]:
    """Share correct of every combination."""
    now = evidence.engine.settings
    for rho, window, transition in itertools.product(RHOS, WINDOWS, TRANSITIONS):
        settings = replace(now, rho=rho, window=window, transition=transition)
        yield correct(evidence, settings, log), settings
