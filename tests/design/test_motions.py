"""Parts of a motion: whatever their numbers, they begin and end at rest and keep the limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.design.limits import Limits
from dsd_cli.design.motions import KINDS, MotionSegment, Room, generator_values, position_of

ROOM = Room(Limits(-1.0, 2.0, 3.0, 20.0, 400.0, 1.0, 0.3), 10.0, 0.004)
SHARE = st.floats(0.0, 1.0)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25)
@given(values=st.tuples(SHARE, SHARE, SHARE, SHARE), seconds=st.floats(0.8, 6.0))
def test_a_part_keeps_the_limits_from_rest_to_rest(kind: str, values: tuple[float, ...], seconds: float) -> None:
    q = position_of(MotionSegment(kind, seconds, values), ROOM)
    v = np.diff(q) / ROOM.step
    a = np.diff(v) / ROOM.step
    j = np.diff(a) / ROOM.step
    assert abs(q[0] - 0.3) < 1e-9
    assert abs(q[-1] - 0.3) < 1e-3 * np.ptp(q) + 1e-12
    assert abs(v[0]) < 0.05
    assert abs(v[-1]) < 0.05
    assert q.min() >= -1.0
    assert q.max() <= 2.0
    assert abs(v).max() <= 3.0
    assert abs(a).max() <= 20.0
    assert abs(j).max() <= 400.0
    assert len(q) == round(seconds / ROOM.step) + 1


@pytest.mark.parametrize("start", [-1.0, 2.0])
def test_from_an_end_of_the_range_it_goes_to_the_other_side(start: float) -> None:
    room = Room(Limits(-1.0, 2.0, 3.0, 20.0, 400.0, 1.0, start), 10.0, 0.004)
    for kind in KINDS:
        q = position_of(MotionSegment(kind, 3.0, (0.5, 0.5, 0.5, 0.5)), room)
        assert q.min() >= -1.0 - 1e-9
        assert q.max() <= 2.0 + 1e-9
        assert np.ptp(q) > 0.0


def test_lines_of_harmonics_are_those_of_the_motion() -> None:
    """Between the fades the motion is the sum of the lines that are said."""
    part = MotionSegment("harmonics", 4.0, (0.4, 0.5, 0.3, 0.6), scale=0.7)
    q, said = position_of(part, ROOM), generator_values(part, ROOM)
    t = np.arange(len(q)) * ROOM.step
    lines = zip(said["frequency_hz"], said["amplitude"], said["phase_rad"], strict=True)
    wanted = 0.3 + sum(a * np.sin(2.0 * np.pi * f * t + p) for f, a, p in lines)
    inner = (t > said["fade_s"][0] + 0.01) & (t < 4.0 - said["fade_s"][0] - 0.01)
    np.testing.assert_allclose(q[inner], wanted[inner], atol=1e-9)


def test_moves_are_said_one_by_one() -> None:
    part = MotionSegment("moves", 6.0, (0.6, 0.8, 0.3, 0.4))
    q, said = position_of(part, ROOM), generator_values(part, ROOM)
    assert abs(sum(said["distance"])) < 0.02 * np.ptp(q)
    assert max(said["speed"]) == pytest.approx(np.abs(np.diff(q)).max() / ROOM.step)


def test_where_the_acceleration_rises_slowly_a_part_still_goes_as_far_as_its_time_allows() -> None:
    """A log whose band ends at 2 Hz lets the acceleration rise in a quarter of a second: a quick fade would take all
    of that for itself, and leave a twentieth of the way that there is time for."""
    slow = Room(Limits(-2.0, 2.0, 3.0, 12.0, 48.0, 1.0, 0.0), 2.0, 0.005)
    for seconds, least in ((2.5, 0.5), (5.0, 2.0)):
        q = position_of(MotionSegment("harmonics", seconds, (0.0, 1.0, 0.5, 0.0)), slow)
        assert np.ptp(q) > least
        # from rest to rest with acceleration as a sine: how far in half of the time
        assert np.ptp(q) < 2.0 * 48.0 * seconds**3 / (2.0 * np.pi) ** 2 / 4.0
