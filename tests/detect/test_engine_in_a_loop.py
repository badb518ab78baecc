"""`Engine` as a controller uses it: init once, one step per sample, nothing kept."""

import gc
import sys

import numpy as np
import pytest

from dsd_cli.detect import DetectorSettings, Engine, Grid, Transition
from dsd_cli.detect.engine import Measurement
from tests.detect.test_against_oracle import BACKENDS

GRID = Grid((0.2, 0.3, 0.4), (0.5, 1.0, 2.0))


@pytest.mark.parametrize("backend", BACKENDS)
def test_steps_keep_no_memory(backend):
    """After the warm-up 20,000 steps leave not one block behind, and nothing for the garbage collector."""
    engine = Engine(GRID, DetectorSettings(), Measurement(1e-3), backend)
    samples = np.random.default_rng(1).normal(size=(25_000, 2)).tolist()
    for u, d in samples[:5000]:
        engine.step(u, d)
    gc.collect()
    before = sys.getallocatedblocks()
    for u, d in samples[5000:]:
        engine.step(u, d)
    assert abs(sys.getallocatedblocks() - before) < 200  # a block a step would be 20,000
    assert gc.collect() == 0


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("delays", [3, 20], ids=["few states", "many states"])  # NumPy has a step for either
@pytest.mark.parametrize("transition", [Transition(), Transition(stay=0.4)], ids=["uniform", "sticky"])
def test_steps_are_the_run(backend, delays, transition):
    """Bit by bit, with missing samples, and however calls of `step` and `run` take turns."""
    u, d = np.random.default_rng(2).normal(size=(2, 1500))
    u[700:703] = d[[650, 900, 901]] = np.nan
    grid = Grid(tuple(np.linspace(0.0, 0.2, delays).tolist()), (0.5, 1.0, 2.0))
    whole, one = (
        Engine(grid, DetectorSettings(rho=1.0, transition=transition, window=37), Measurement(1e-3), backend)
        for _ in range(2)
    )
    expected = whole.run(u, d)
    assert len(set(expected.state.tolist())) > 1
    for begin in range(0, len(u), 100):
        part = slice(begin, begin + 100)
        if begin % 300 == 200:
            got = one.run(u[part], d[part])
        else:
            got = [one.step(a, b) for a, b in zip(u[part].tolist(), d[part].tolist(), strict=True)]
        for field in ("state", "log_likelihood", "probability", "confident"):
            values = getattr(got, field) if begin % 300 == 200 else [getattr(label, field) for label in got]
            np.testing.assert_array_equal(values, getattr(expected, field)[part], err_msg=f"{field} from {begin}")
