"""Positions that jump as no axis can: a log with a homing, a wrap or a wrong sample answers as the log without."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.continuous import continuous
from dsd_cli.signals.log import Log
from tests.oracle.rig import RigCase, make


def homed(q):
    q[len(q) // 2 :] += 0.8


def wrapped(q):
    q[:] = (q + 0.5) % 1.0 - 0.5


def spiked(q):
    q[[500, 3000, 6000]] += 3.0


@pytest.fixture(scope="module")
def dry():
    (log,) = make([RigCase(what=("coulomb_friction",), seed=4400, sensing="enc40k", duration=8.0)])
    return log


@pytest.mark.parametrize("spoil", [homed, wrapped, spiked])
def test_a_jump_hides_nothing_and_adds_nothing(dry, spoil):
    """ "Nothing is missing, 80 %" was said of a log with friction and one homing."""
    channels = {name: np.array(x) for name, x in dry.channels.items()}
    spoil(channels["position"])
    observer = ObserverSettings(dry.observer["nominal_inertia"], dry.observer["time_constant"])
    model = PlantModel(dry.believed["inertia"], dry.believed["delay"], dry.believed["effects"])
    found = diagnose([prepare(Log(channels, dry.sample_time, "log.csv"), observer)], model, observer)
    assert found.verdict == "coulomb_friction"
    assert found.probability > 0.9
    level = dry.truth["effects"]["coulomb_friction"]["level"]
    assert found.ranking[0].parameters["level"].value == pytest.approx(level, rel=0.03)


@settings(max_examples=50)
@given(
    at=st.integers(10, 480),
    size=st.floats(1.0, 1e4),
    counts=st.sampled_from([0.0, 1e-3, 1e-2]),
    speed=st.floats(0.01, 10.0),
)
def test_a_step_is_found_where_it_is_and_a_motion_is_none(at, size, counts, speed):
    q = np.sin(speed * np.arange(500) * 1e-2)
    q = np.round(q / counts) * counts if counts else q
    assert continuous(q).jumps == ()
    fast = max(np.abs(np.diff(q)).max(), counts)
    step = 40.0 * fast * size
    if step > 1e-6:
        q[at:] += step
        found = continuous(q)
        assert found.jumps == (at,) or found.wraps == 1


@pytest.mark.parametrize("turns", [1, 2, 4, 1024])
def test_a_counter_of_several_turns_goes_on_where_it_wraps(turns):
    """A jump is a turn less what the axis moved meanwhile: two turns of a fast axis were 0.006 rad too short."""
    t = 0.00025 * np.arange(40_000)
    size = 2.0 * np.pi * turns
    q = 24.0 * size * np.sin(0.5 * t) / 12.0 + 2e-5 * np.sin(40.0 * t)
    found = continuous(np.mod(q, size))
    assert found.wraps > 3
    assert np.ptp(found.position - q) < 1e-6 * size


def trials(ends):
    """Moves from 0 that are written one after the other: each breaks off in motion, the next begins at rest."""
    t = np.arange(400) * 1e-3
    return np.concatenate([end * np.sin(5.0 * t) ** 2 for end in ends])


def test_every_join_of_trials_is_found_the_small_ones_too():
    """Of 49 joins four were missed, by less than 20 fast steps: "u does not seem to drive this axis (90 %)"."""
    found = continuous(trials([2.0, -1.0, 0.03, 1.5, -0.05, 0.7]))
    assert found.jumps == (400, 800, 1200, 1600, 2000)
    assert found.wraps == 0


def test_a_single_jump_by_no_known_turn_is_a_new_zero():
    found = continuous(trials([2.6, 0.4]))
    assert (found.wraps, found.jumps) == (0, (400,))


@pytest.mark.parametrize("turn", [360.0, 65536.0, 1.0])
def test_a_single_jump_by_a_known_turn_is_a_wrap(turn):
    """At an even speed it is just that long."""
    found = continuous(np.mod(np.arange(4000) * 0.3e-3 * turn, turn))
    assert (found.wraps, found.jumps) == (1, ())


def test_moves_that_end_at_one_place_are_no_wraps_where_the_travel_is_longer():
    q = np.concatenate([np.sin(np.linspace(0.0, 2.3, 900))] * 3)
    assert continuous(q).wraps == 0


@pytest.mark.parametrize("counts", [1e-2, 1e-4, 0.0])
def test_a_hit_on_a_stop_and_a_sensor_that_hangs_are_no_joins(counts):
    t = np.arange(4000) * 1e-3
    q = np.sin(3.0 * t)
    stopped = np.minimum(q, 0.6)
    hung = q.copy()
    for at in range(100, 3900, 400):
        hung[at : at + 6] = hung[at]
    for one in (stopped, hung):
        one = np.round(one / counts) * counts if counts else one
        assert (continuous(one).jumps, continuous(one).wrong) == ((), ())
