"""How sure a name is: less where much stays unexplained beside it, hardly less in a short log that leaves nothing."""

import math

import numpy as np

from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log

STEP, INERTIA, LEVEL = 0.002, 0.05, 0.4


def friction_over(seconds: float, varies: float):
    """Verdict and {name: probability} of a motion of many sines (few would imitate a force themselves) against dry
    friction, whose level may go up and down by that share of it, three times a turn; inertia and delay are known."""
    random, t = np.random.default_rng(8), np.arange(0.0, seconds, STEP)
    lines = [
        (f, 1.5 / (1.0 + f), p) for f, p in zip(random.uniform(0.2, 3.0, 16), random.uniform(0, 6.3, 16), strict=True)
    ]
    velocity = sum(a * np.sin(2 * math.pi * f * t + p) for f, a, p in lines)
    acceleration = sum(2 * math.pi * f * a * np.cos(2 * math.pi * f * t + p) for f, a, p in lines)
    position = sum(-a / (2 * math.pi * f) * np.cos(2 * math.pi * f * t + p) for f, a, p in lines)
    u = INERTIA * acceleration + LEVEL * np.sign(velocity) * (1.0 + varies * np.sin(3.0 * position))
    channels = {
        "u": u,
        "velocity": velocity + 2e-3 * random.normal(size=t.size),
        "position": position + 1e-5 * random.normal(size=t.size),
    }
    observer = ObserverSettings(INERTIA, 0.02)
    found = diagnose([prepare(Log(channels, STEP, "log.csv"), observer)], PlantModel(INERTIA, 0.0, {}), observer)
    return found.verdict, found.probability, {one.effect: one.probability for one in found.missing}


def test_a_name_that_leaves_half_of_itself_is_less_likely_than_not():
    """What varies is 0.7 / sqrt 2 of what does not: the power ratio is 4, that of a stand-in 9 and more."""
    verdict, probability, missing = friction_over(20.0, 0.7)
    assert max(missing.values(), default=0.0) < 0.5
    assert verdict == "unknown" or probability < 0.5


def test_a_short_log_that_one_effect_explains_is_nearly_as_sure_as_a_long_one():
    verdict, short, _ = friction_over(3.0, 0.0)
    assert verdict == "coulomb_friction"
    assert 0.85 < short < 0.99
    verdict, long, missing = friction_over(20.0, 0.0)
    assert verdict == "coulomb_friction"
    assert long == missing["coulomb_friction"]
    assert short < long
