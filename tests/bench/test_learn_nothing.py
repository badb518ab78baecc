"""Logs of the study of `dsd learn` in which nothing is missing, and from which a law was once learnt."""

import pytest

from bench.learn import recording_of
from bench.learn_nothing import COMPLETE
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.learn.choose import choose
from dsd_cli.identify.learn.rows import balance_of
from tests.oracle.rig_strange import make


@pytest.mark.parametrize(
    ("law", "seed", "sensor", "motion"),
    [("nothing", 3011, "enc4096", "moves"), ("stribeck", 5018, "enc40k", "sines")],
    ids=["the error of a coarse encoder", "an axis that sticks"],
)
def test_what_the_sensor_or_sticking_leaves_is_no_law(law, seed, sensor, motion):
    recording, model = recording_of(make(law, seed, sensor, motion, laws=COMPLETE))
    assert ("stribeck_friction" in model.effects) == (law == "stribeck")
    assert choose(balance_of(pose([recording], model, Settings()))).refused == "what is left may be the sensor's noise"
