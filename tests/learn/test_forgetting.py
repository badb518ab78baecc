"""Springs that slip: from where on it is known how far they are bent, whatever they were when the log began."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.learn.families import RADII
from dsd_cli.learn.forgetting import forgetting, where_known
from dsd_cli.learn.rows import balance_of
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log, with_channels

T = 1e-3


def recorded(seed, rows, count=0.0):
    """Sines that grow, so that the widest swing comes late; u is that of a mass. count : of an encoder."""
    rng, t = np.random.default_rng(seed), T * np.arange(rows)
    w, phase = rng.uniform(2.0, 9.0, 3), rng.uniform(0.0, 6.0, 3)
    place = (0.2 + t / t[-1]) * np.sin(np.outer(t, w) + phase).sum(axis=1)
    u = 0.1 * np.gradient(np.gradient(place, T), T)
    place = count * np.round(place / count) if count else place
    return prepare(Log({"t": t, "u": u, "position": place}, T, "log"), ObserverSettings(0.1, 0.01))


def slipped(place, radius, z):
    """How far a spring is bent, one step after the other."""
    found = [z]
    for step in np.diff(place).tolist():
        found.append(min(max(found[-1] + step, -radius), radius))
    return np.array(found)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_springs_are_known_from_where_those_bent_either_way_have_met(seed):
    whole = recorded(seed, 24_000)
    (recording,) = forgetting([whole], pose([whole], PlantModel(0.1), Settings(effects=())))
    (piece,) = recording.pieces
    place, known = piece["position"], piece["clear"] > 0.0
    widest = RADII[1] * np.ptp(place)
    for radius in np.geomspace(0.01, 1.0, 5) * widest:
        one, other = (slipped(place, radius, side * radius) for side in (1.0, -1.0))
        np.testing.assert_allclose(one[known], other[known], atol=1e-9)
    one, other = (slipped(place, widest, side * widest) for side in (1.0, -1.0))
    assert 0.0 < np.mean(known) < 0.9
    assert np.all(np.abs(one - other)[~known] > 0.0)


def test_where_hardly_anything_would_be_left_all_rows_are_judged():
    long, short = (balance_of(pose([recorded(1, rows)], PlantModel(0.1), Settings(effects=()))) for rows in (8000, 400))
    assert where_known(long).equations.kept.sum() < long.equations.kept.sum()
    assert where_known(short) is short


def test_a_log_of_small_moves_forgets_by_the_travel_of_all():
    wide, narrow = recorded(1, 8000), recorded(2, 8000)
    small = [with_channels(p, position=0.05 * p["position"]) for p in narrow.pieces]
    both = [wide, replace(narrow, pieces=tuple(small))]
    known = forgetting(both, pose(both, PlantModel(0.1), Settings(effects=())))
    assert [float(np.mean(r.pieces[0]["clear"])) > 0.0 for r in known] == [True, False]


@pytest.mark.parametrize("seed", [4, 5])
def test_the_noise_of_an_encoder_is_no_larger_where_rows_begin_to_count(seed):
    """Cut at once, half a count there is an impulse of the acceleration, far above the noise of the other rows."""
    exact, counted = recorded(seed, 24_000), recorded(seed, 24_000, 2e-4)
    problem = pose([counted], PlantModel(0.1), Settings(effects=()))
    both = (problem.errors_for(problem.model, forgetting([r], problem)).equations for r in (counted, exact))
    noise = np.abs(np.subtract(*(equations.acceleration() for equations in both)))
    begin = int(np.argmax(noise > 1e-12))
    assert begin > 20
    assert np.max(noise[begin : begin + 8]) < np.max(noise[begin + 8 :])


def test_rows_that_are_not_sure_count_by_the_variance_of_what_is_left_there():
    balance = balance_of(pose([recorded(1, 8000)], PlantModel(0.1), Settings(effects=())))
    hardly = balance.counts & ~balance.sure
    assert 0 < hardly.sum() < balance.counts.sum()
    left = np.where(hardly, 3.0, 1.0)
    np.testing.assert_allclose(balance.weighed(left).weight[hardly], 1.0 / 9.0)
    for none in (np.zeros(len(left)), 1.0 / left):  # also once they counted little
        np.testing.assert_array_equal(balance.weighed(left).weighed(none).weight, balance.counts)
