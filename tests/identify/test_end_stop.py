"""A stop is what pushes at an end of the travel each time, not what is left there once."""

import numpy as np
import pytest
from scipy.signal import lfilter

from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.end_stop import _Touching
from dsd_cli.signals.log import Log
from tests.identify.comparison_rig import BELIEVED, OBSERVER, T


@pytest.mark.parametrize("seed", [7, 8, 9])
def test_where_the_axis_went_once_a_slow_load_is_no_stop(seed):
    """Each end is met in one part of the log: what its column takes there is nothing in the others, and made another's
    gain out of rounding. Of a load this slow a column takes ten times what it would of white noise, besides."""
    t, rng = T * np.arange(round(12.0 / T)), np.random.default_rng(seed)
    q = 0.5 * np.sin(np.pi * t + 0.3) + 0.3 * np.sin(2.6 * np.pi * t + 1.0)
    q += 1.5 * np.exp(-(((t - 1.0) / 0.3) ** 2)) - np.exp(-(((t - 8.0) / 0.3) ** 2))
    u = np.interp(t + BELIEVED.delay, t, BELIEVED.inertia * np.gradient(np.gradient(q, T), T))
    slow = lfilter([1.0], [1.0, -0.98], rng.normal(size=len(t)))
    channels = {"t": t, "u": u + 0.1 * np.std(u) * slow / np.std(slow), "position": np.round(q, 5)}
    recording = prepare(Log(channels, T, "log.csv"), OBSERVER)
    search = Search(pose([recording], BELIEVED, Settings(effects=("viscous_friction", "coulomb_friction"))))
    assert _Touching(*search.searched(search.refit)).contacts() == []
