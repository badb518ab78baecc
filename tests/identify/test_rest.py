"""When an axis rests: while it stays, and not while it only turns or passes slowly."""

import numpy as np
import pytest

from dsd_cli.identify.fit.stretches import resting
from dsd_cli.identify.policy import POLICY

REST = 0.1


def _move(*parts):
    return np.concatenate([np.asarray(p, dtype=float) for p in parts])


def test_a_dwell_between_two_moves_is_rest_and_the_moves_are_not():
    v = _move(np.full(50, 1.0), np.zeros(40), np.full(50, -1.0))
    found = resting(v, REST)
    assert found.shape == v.shape
    assert found[51:90].all()  # intervals both of whose ends are slow
    assert not found[:51].any()
    assert not found[90:].any()


def test_an_axis_that_turns_is_not_at_rest():
    """The speed passes straight through the band of slow speeds, in however many samples."""
    for samples in (8, 20, 200, 1000):
        v = _move(np.full(20, 1.0), np.linspace(REST, -REST, samples), np.full(20, -1.0))
        assert not resting(v, REST).any(), samples


def test_creeping_near_the_band_is_not_rest():
    slow = 0.9 * REST
    assert not resting(_move(np.full(20, 1.0), np.full(60, slow), np.full(20, 1.0)), REST).any()
    creeping = 0.3 * REST
    assert resting(_move(np.full(20, 1.0), np.full(60, creeping), np.full(20, 1.0)), REST).sum() == 59


@pytest.mark.parametrize("seed", range(10))
def test_noise_on_a_standing_axis_is_rest(seed):
    rng = np.random.default_rng(seed)
    v = _move(np.full(50, 1.0), np.zeros(300), np.full(50, -1.0)) + REST / 5.0 * rng.normal(size=400)
    assert resting(v, REST)[60:340].mean() > 0.95


@pytest.mark.parametrize("seed", range(10))
def test_noise_on_a_turning_axis_makes_no_rest(seed):
    rng = np.random.default_rng(seed)
    v = _move(np.linspace(1.0, -1.0, 1000)) + REST / 5.0 * rng.normal(size=1000)
    assert not resting(v, REST).any()


def test_a_rest_has_so_many_samples_at_least():
    for count in range(1, 12):
        v = _move(np.full(9, 1.0), np.zeros(count), np.full(9, 1.0))
        assert resting(v, REST).sum() == (count - 1 if count - 1 >= POLICY.least_rest_samples else 0)


def test_a_whole_log_may_be_rest_and_a_rest_may_end_it():
    assert resting(np.zeros(30), REST).all()
    assert resting(_move(np.ones(20), np.zeros(30)), REST)[21:].all()
    assert not resting(np.ones(30), REST).any()


def test_which_way_the_axis_moves_does_not_matter():
    rng = np.random.default_rng(1)
    v = np.cumsum(rng.normal(size=2000)) * 0.02
    np.testing.assert_array_equal(resting(v, REST), resting(-v, REST))
    np.testing.assert_array_equal(resting(v, REST), resting(1000.0 * v, 1000.0 * REST))
