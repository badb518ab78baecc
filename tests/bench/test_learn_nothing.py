"""Logs of the study of `dsd learn` in which nothing is missing, and from which a law was once learnt."""

import pytest

from bench.learn import judged
from bench.learn_nothing import COMPLETE, known_of, of_tier
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.learn.choose import OF_SENSOR, choose
from dsd_cli.learn.learning import learn
from dsd_cli.learn.results import LEARNT
from dsd_cli.learn.rows import balance_of
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.rig_strange import make


@pytest.mark.parametrize(
    ("law", "seed", "sensor", "motion"),
    [("nothing", 3011, "enc4096", "moves"), ("stribeck", 5018, "enc40k", "sines")],
    ids=["the error of a coarse encoder", "an axis that sticks"],
)
def test_what_the_sensor_or_sticking_leaves_is_no_law(law, seed, sensor, motion):
    log = make(law, seed, sensor, motion, laws=COMPLETE)
    model = PlantModel(log.inertia, log.delay, {**log.believed, **known_of(log)})
    recording = prepare(Log(log.channels, 1e-3, law), ObserverSettings(log.inertia, 0.01))
    assert choose(balance_of(pose([recording], model, Settings()))).refused == OF_SENSOR
    assert judged(recording, model, forgotten=False) is recording
    known = judged(recording, model, forgotten=True).pieces[0]["clear"]
    assert 0.0 == known[0] < known[-1] == 1.0


def test_what_is_left_of_a_crawl_where_its_direction_is_not_sure_is_no_law() -> None:
    """2.3 % of u is left, of which a function of the velocity takes a fifth, nearly all of it where the axis turns.

    Where it certainly moves 0.16 % of u is left, which may be the sensor's noise."""
    drawn = of_tier("crawl through cogging", 71033)
    assert drawn is not None
    _, recording, model = drawn
    assert set(model.effects) == {"cogging", "coulomb_friction"}
    assert choose(balance_of(pose([recording], model, Settings()))).refused == OF_SENSOR


@pytest.mark.parametrize(
    ("tier", "seed", "was"),
    [
        ("nothing missing, new axes", 85109, "a table over velocity and position, at a delay 22 ms off that suited it"),
        ("crawl through cogging", 93129, "a function of the velocity: stops led all that was fitted, the delay to 0"),
        (
            "crawl through cogging",
            93021,
            "a table over velocity and position: few rows were sure, so stops counted alike",
        ),
        ("crawl through cogging", 85129, "LuGre friction, of a tenth of the rows, which left 18 times as much of all"),
    ],
)
def test_a_law_leaves_less_of_the_whole_log_than_the_model_at_its_own_delay(tier: str, seed: int, was: str) -> None:
    drawn = of_tier(tier, seed)
    assert drawn is not None
    assert learn([drawn[1]], drawn[2]).verdict != LEARNT, was
