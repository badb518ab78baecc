"""The plain regression beside published values: a drive of known values, made here by small steps."""

from __future__ import annotations

import numpy as np
import pytest

from bench.machines_cases import Recorded
from bench.machines_regression import regressed

TRUE = {"inertia": 0.4, "viscous_friction.coefficient": 1.5, "coulomb_friction.level": 0.8}
STEP, DELAY = 0.002, 0.006


def test_it_finds_the_values_and_the_delay_of_a_log_that_has_them(tmp_path):
    t = np.arange(0.0, 12.0, STEP)
    v = 2.0 * np.sin(1.7 * t) + 1.0 * np.sin(4.1 * t)
    a = 3.4 * np.cos(1.7 * t) + 4.1 * np.cos(4.1 * t)
    u = TRUE["inertia"] * a + TRUE["viscous_friction.coefficient"] * v + TRUE["coulomb_friction.level"] * np.sign(v)
    sent = np.interp(t + DELAY, t, u)
    np.savetxt(tmp_path / "log.csv", np.stack([t, sent, v], axis=1), delimiter=",", header="t,u,v", comments="")
    signals = {"time": "t", "u": "u", "velocity": "v", "position": ""}
    case = Recorded("drive", ("log.csv",), signals, 0.4, regress=tuple(TRUE), regress_hz=8.0)
    found = regressed(case, [tmp_path / "log.csv"])
    assert found["delay"][0] == pytest.approx(DELAY, abs=0.0011)
    for name, value in TRUE.items():
        assert found[name][0] == pytest.approx(value, abs=4.0 * found[name][1] + 0.03 * value)
