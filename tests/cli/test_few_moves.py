"""A diagnosis of a log of which `dsd check` says that its moves are too few says so as well."""

from types import SimpleNamespace

import numpy as np
import pytest

from dsd_cli.cli.few_moves import said_of_moves
from dsd_cli.identify.checks import check_log
from dsd_cli.signals.log import Log

STEP = 0.002


def moves(directions):
    """Trapezoids of speed with rests between them."""
    one = np.interp(np.arange(400) * STEP, [0.0, 0.2, 0.3, 0.5, 0.6], [0.0, 0.0, 2.0, 2.0, 0.0])
    v = np.concatenate([way * one for way in directions])
    u = 0.02 * np.gradient(v, STEP) + 0.1 * np.sign(v)
    return Log({"t": np.arange(v.size) * STEP, "u": u, "velocity": v}, STEP, "log")


@pytest.mark.parametrize("directions", [(1,), (1, -1), (1, -1, 1), (1, -1) * 4])
def test_both_say_it_of_the_same_logs(directions):
    log = moves(directions)
    recording = SimpleNamespace(sample_time=STEP, pieces=(log,))
    checked = any("too few for an effect" in one.what for one in check_log(log).findings)
    said = said_of_moves([recording])
    assert bool(said) == checked == (len(directions) < 3)
    assert all(one.startswith(f"{len(directions)} move") for one in said)
    assert said_of_moves([recording] * 3) == ()
