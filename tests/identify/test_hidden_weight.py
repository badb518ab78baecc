"""J0 gives what is left of the motion the unit of u: a weight that nobody told of must not make it small."""

from __future__ import annotations

import numpy as np
import pytest

from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

J, WEIGHT, FRICTION, DAMPING, STEP = 0.65, 6.4, 1.6, 1.55, 2e-3


def _moves(seed: int) -> np.ndarray:
    """Point-to-point moves of an arm with rests between them, rad."""
    draw, at, parts = np.random.default_rng(seed), 0.0, [np.zeros(100)]
    for _ in range(15):
        to = draw.uniform(-1.4, 1.4)
        s = np.linspace(0.0, 1.0, int(max(abs(to - at), 0.2) * draw.uniform(1.2, 2.0) / STEP))
        parts += [at + (to - at) * s**3 * (10 - 15 * s + 6 * s * s), np.full(int(draw.uniform(0.1, 0.5) / STEP), to)]
        at = to
    return np.concatenate(parts)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_size_of_a_force_is_not_that_of_an_inertia_swamped_by_a_weight(seed: int) -> None:
    q = _moves(seed)
    v = np.gradient(q, STEP)
    u = J * np.gradient(v, STEP) + WEIGHT * np.sin(q + 0.2) + FRICTION * np.tanh(v / 0.002) + DAMPING * v
    log = Log({"time": STEP * np.arange(len(q)), "u": u, "position": np.round(q / 3e-5) * 3e-5}, STEP, "arm.csv")
    observer = ObserverSettings(J, 0.02)
    problem = pose([prepare(log, observer)], PlantModel(0.9 * J, 0.0, {}), Settings())
    assert 0.5 * J < problem.solver.inertia < 2.0 * J
