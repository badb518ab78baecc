"""Any log is judged without a failure, and soon."""

import time
import warnings

import numpy as np
import pytest

from dsd_cli.identify.checks import check_log
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.identify.checks.rig import servo

N = 400
RNG = np.random.default_rng(0)
STRANGE = {
    "noise": {name: RNG.normal(size=N) for name in ("u", "velocity", "position", "d_hat")},
    "random walk": {"u": RNG.normal(size=N), "position": np.cumsum(RNG.normal(size=N))},
    "spikes": {"u": np.eye(1, N, 7)[0], "position": np.eye(1, N, 300)[0]},
    "constant": {"u": np.ones(N), "d_hat": np.ones(N)},
    "tiny": {"u": 1e-150 * RNG.normal(size=N), "velocity": 1e-150 * np.cumsum(RNG.normal(size=N))},
    "huge": {"u": 1e90 * RNG.normal(size=N), "position": 1e90 * np.cumsum(RNG.normal(size=N))},
    "one corrupt cell": {"u": RNG.normal(size=N), "velocity": 1e160 * np.eye(1, N, 7)[0]},
    "u alone": {"u": RNG.normal(size=N)},
    "ramp": {"u": RNG.normal(size=N), "position": np.arange(N) * 1.0, "velocity": np.ones(N)},
    "one step": {"u": RNG.normal(size=N), "position": np.repeat([0.0, 1.0], N // 2)},
    "same": {"u": np.sin(np.arange(N) * 0.1), "velocity": np.sin(np.arange(N) * 0.1)},
}
MODEL = PlantModel(1.0, 0.003, {"coulomb_friction": {"level": 0.1}, "gravity": {"amplitude": 0.5, "phase": 0.1}})


@pytest.mark.parametrize("rows", [0, 1, 49, 60, N])
@pytest.mark.parametrize("name", STRANGE)
def test_any_log_gets_a_verdict(name, rows):
    channels = {channel: x[:rows] for channel, x in STRANGE[name].items()}
    for t in ({}, {"t": np.arange(rows) * 0.001}, {"t": np.cumsum(RNG.uniform(0.0005, 0.0015, rows))}):
        log = Log({**t, **channels}, 0.001)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            bare = check_log(log)
            full = check_log(log, MODEL, ObserverSettings(1.0, 0.01), (rows // 3,))
        assert {one.severity for one in (*bare.findings, *full.findings)} <= {"error", "warning", "note"}
        assert all(0.0 <= one.sure <= 1.0 for one in full.findings)
        assert [one.name for one in full.parameters][:2] == ["inertia", "delay"]


def test_a_minute_at_1_khz_is_checked_in_a_moment():
    """The processor time of the check itself, without a model as in front of `diagnose`."""
    c = servo("velocity").channels
    long = {name: np.tile(x, 10) for name, x in c.items() if name != "t"}
    log = Log({**long, "t": np.arange(long["u"].size) * 0.001}, 0.001)
    restarts = tuple(range(c["u"].size, long["u"].size, c["u"].size))
    times = []
    for cut in (restarts, ()):
        start = time.process_time()
        check_log(log, None, None, cut)
        times.append(time.process_time() - start)
    assert min(times) < 1.0  # 0.15 s on a machine that has nothing else to do
