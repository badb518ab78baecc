"""`Engine` as a controller uses it: init once, one step per sample, nothing kept."""

import gc
import sys

import numpy as np
import pytest

from dsd_cli.detect import DetectorSettings, Engine, Grid
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
def test_steps_are_the_run(backend):
    u, d = np.random.default_rng(2).normal(size=(2, 1500))
    whole = Engine(GRID, DetectorSettings(rho=1.0), Measurement(1e-3), backend).run(u, d)
    one = Engine(GRID, DetectorSettings(rho=1.0), Measurement(1e-3), backend)
    labels = [one.step(a, b) for a, b in zip(u.tolist(), d.tolist(), strict=True)]
    assert [label.state for label in labels] == whole.state.tolist()
    np.testing.assert_array_equal([label.log_likelihood for label in labels], whole.log_likelihood)
