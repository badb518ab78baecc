"""Random closed loops for the study of `dsd simulate --adapt`: a run is a seed, and all of it is drawn from that.

Each has a delay change, half of them a change of inertia, a burst of noise on d_hat, and a while in which the
controller is given a wrong label.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, cast

import numpy as np

from dsd_cli.detect import DetectorSettings, Engine, Grid
from dsd_cli.detect.engine import Label
from dsd_cli.detect.engine import Measurement as Measured
from dsd_cli.detect.feedback import Adaptation
from dsd_cli.errors import DataError
from dsd_cli.plant.controllers import ControllerSettings, cdm_gains
from dsd_cli.plant.model import PlantModel
from dsd_cli.plant.references import Multisine, Reference, Sine, Step, Trapezoids
from dsd_cli.plant.simulation import Event, Measurement, SimulationSettings, simulate
from dsd_cli.signals.log import Log

SAMPLE_TIME, DURATION = 2e-3, 14.0
GRID = Grid((0.2, 0.3, 0.4), (0.5, 1.0, 2.0))
#: A loop has diverged where it ends this many times farther from its reference than that ever goes.
FAR = 10.0


class Liar:
    """An engine whose labels are wrong, and confident, from sample `start` to `end`."""

    def __init__(self, engine: Engine, state: int, start: int, end: int) -> None:
        self.grid, self.settings, self.measurement, self.spec = (
            engine.grid, engine.settings, engine.measurement, engine.spec,
        )  # fmt: skip
        self._engine, self._state, self._lies, self._k = engine, state, range(start, end), 0

    def step(self, u: float, d_hat: float) -> Label:
        label = self._engine.step(u, d_hat)
        self._k += 1
        if self._k not in self._lies:
            return label
        delay, inertia = (float(self.grid.axes[name][self._state]) for name in ("delay", "inertia"))
        return label._replace(state=self._state, delay=delay, inertia=inertia, confident=True)


@dataclass(frozen=True)
class Case:
    """One random loop; from sample `start` to `end` its detector says `wrong` (a state of GRID)."""

    settings: SimulationSettings
    wrong: int
    start: int
    end: int

    @property
    def span(self) -> float:
        """How far the reference goes."""
        return float(np.abs(self.settings.reference.sample(int(DURATION / SAMPLE_TIME), SAMPLE_TIME).position).max())


class Outcome(NamedTuple):
    """rms of the tracking error over the last 3 s in parts of the reference's span, and whether the loop diverged."""

    error: float
    diverged: bool
    adopted: bool


def case(seed: int) -> Case:
    rng = np.random.default_rng(seed)
    inertia = float(np.exp(rng.uniform(np.log(0.4), np.log(2.5))))
    low = float(rng.uniform(0.001, 0.05))
    burst = float(rng.uniform(2.0, 9.0))
    later = float(np.exp(rng.uniform(np.log(0.4), np.log(2.5)))) if rng.random() < 0.5 else None
    events = (
        Event(float(rng.uniform(3.0, 8.0)), delay=float(rng.uniform(0.15, 0.4))),
        *([] if later is None else [Event(float(rng.uniform(3.0, 8.0)), inertia=later)]),
        Event(burst, noise=float(rng.uniform(0.5, 5.0))),
        Event(burst + float(rng.uniform(0.1, 0.5)), noise=low),
    )
    settings = SimulationSettings(
        PlantModel(inertia, float(rng.uniform(0.15, 0.4))),
        DURATION,
        SAMPLE_TIME,
        controller=ControllerSettings(gains=cdm_gains(float(rng.choice([1.0, 1.7, 2.5]))), derivative="error"),
        reference=_reference(rng),
        events=events,
        measurement=Measurement(d_hat_noise=low, velocity_noise=float(rng.uniform(0.0, 1e-3)), seed=seed),
    )
    start = float(rng.uniform(1.0, 9.0))
    end = start + float(rng.uniform(0.2, 1.5))
    return Case(settings, int(rng.integers(len(GRID))), round(start / SAMPLE_TIME), round(end / SAMPLE_TIME))


def _reference(rng: np.random.Generator) -> Reference:
    kind, size = rng.integers(4), float(rng.uniform(0.5, 2.0))
    if kind == 0:
        return Step(0.3, size)
    if kind == 1:
        return Sine(float(rng.uniform(0.5, 6.0)), size)
    if kind == 2:
        return Multisine(tuple(rng.uniform(0.3, 5.0, 3)), size / 3.0, int(rng.integers(1000)))
    return Trapezoids(size, 1.0, float(rng.uniform(1.0, 5.0)), 1.0, 0.3)


def adaptation(case: Case) -> Adaptation:
    """The paper's nine states and tuning (M = 50 is its 0.1 s), with the wrong labels of that case."""
    engine = Engine(GRID, DetectorSettings(window=50, rho=0.3, hold=3.0), Measured(SAMPLE_TIME, 1.0, 0.01))
    return Adaptation(cast(Engine, Liar(engine, case.wrong, case.start, case.end)))


def outcome(case: Case, adapt: bool) -> Outcome:
    feedback = adaptation(case) if adapt else None
    try:
        log = simulate(case.settings, feedback)
    except DataError:
        return Outcome(float("inf"), True, adapt)
    error = _last(log) / case.span
    adopted = adapt and bool(np.isfinite(log["adopted_inertia"]).any())
    return Outcome(float(np.sqrt(np.mean(error**2))), bool(np.abs(error).max() > FAR), adopted)


def _last(log: Log, seconds: float = 3.0) -> np.ndarray:
    return (log["reference"] - log["position"])[-round(seconds / log.sample_time) :]


def outcomes(seeds: range) -> Iterator[tuple[int, Outcome, Outcome]]:
    """(seed, without adaptation, with it)."""
    for seed in seeds:
        one = case(seed)
        yield seed, outcome(one, adapt=False), outcome(one, adapt=True)
