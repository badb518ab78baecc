"""Values of a finite impulse response, every few samples one, against NumPy's convolution."""

import numpy as np
import pytest

from dsd_cli.signals.decimating import decimated, in_groups


@pytest.mark.parametrize("step", [1, 2, 3, 7, 16, 48, 49, 130])
@pytest.mark.parametrize("taps", [1, 2, 37, 401])
@pytest.mark.parametrize("samples", [401, 1000, 30011])
def test_each_value_is_the_taps_times_the_samples_from_its_step_on(step, taps, samples):
    rng = np.random.default_rng(step * taps)
    x, response = rng.standard_normal(samples), rng.standard_normal(taps)
    wanted = np.convolve(x, response[::-1], mode="valid")[::step]
    np.testing.assert_allclose(decimated(x, in_groups(response, step), len(wanted)), wanted, atol=1e-10)


@pytest.mark.parametrize("step", [1, 3, 60])
def test_nothing_is_asked_for_where_no_value_is_wanted(step):
    assert decimated(np.ones(5), in_groups(np.ones(9), step), 0).shape == (0,)
