"""A drag and a force over the position beside each other: two curves of many knots, not one coarse table over both."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from dsd_cli.identify.fit.blocks import lay_blocks
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.learn.choose import as_good
from dsd_cli.learn.judge import LawFit
from dsd_cli.learn.learning import learn
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.rig_strange import make
from tests.oracle.rig_strange_laws import Law


def drag(s, v):
    """Of an eddy-current brake with two discs of different critical speeds."""
    return -1.5 * s.size * (v / 0.7 / (1.0 + (v / 0.7) ** 2) + v / 3.0 / (1.0 + (v / 3.0) ** 2))


def bump(s, q):
    """Two magnets side by side."""
    return s.size * (math.exp(-(((q - 0.5) / 0.2) ** 2)) - 0.7 * math.exp(-(((q + 0.4) / 0.3) ** 2)))


BOTH = Law("", lambda s: {}, lambda s, t, q, v, u: drag(s, v) + bump(s, q), ("velocity", "position"))


@pytest.mark.parametrize("motion", ["sines", "moves"])
def test_a_sum_of_two_laws_is_learnt_as_two_curves_that_are_the_two_laws(motion):
    log = make("both", 11, "speed40k", motion, 12.0, laws={"both": BOTH})
    model = PlantModel(log.inertia, log.delay, dict(log.believed))
    found = learn([prepare(Log(log.channels, 1e-3, "both"), ObserverSettings(log.inertia, 0.01))], model)
    assert found.verdict == "learnt"
    by_channel = {curve.channels: curve for curve in found.curves}
    assert set(by_channel) == {("velocity",), ("position",)}
    curve = by_channel["position",]
    seen = np.isfinite(curve.low)
    true = np.array([bump(SimpleNamespace(**log.drawn), q) for q in curve.knots[0]])[seen]
    told = np.array(curve.values)[seen]
    apart = (told - told.mean()) - (true - true.mean())  # a constant is of either curve
    assert np.sqrt(np.mean(apart**2)) < 0.03 * np.std(true)


def test_one_block_at_an_end_of_a_channel_does_not_say_which_law_is_as_good():
    """Without that block every fit extrapolates, and a stiff formula less than a curve that follows all the others."""
    blocks = lay_blocks([2000], 1, "log")

    def left(each, at_the_end):
        losses = np.array([each] * 19 + [at_the_end])
        return LawFit((), losses, np.zeros(1), np.zeros((1, 1)), 0.0, (), blocks)

    curve = left(1.0, 1000.0)
    assert not as_good(left(8.0, 300.0), curve)
    assert as_good(left(1.02, 300.0), curve)
