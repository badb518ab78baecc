"""Which parts make a motion."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from dsd_cli.design.limits import Limits
from dsd_cli.design.measure import Measure
from dsd_cli.design.motions import KINDS, MotionSegment, Room
from dsd_cli.design.optimise import Sized, library_of, optimised

ROOM = Room(Limits(-9.0, 9.0, 30.0, 12.0, 140.0, 1.0, 0.0), 2.0, 0.005)
#: A measure by which parts are worth what stands in the place of their inner products.
SUM = cast(Measure, SimpleNamespace(worth=float, nothing=0.0))


@pytest.fixture
def unrefined(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dsd_cli.design.optimise._refined_part", lambda _measure, _room, part, _rest: part)


@pytest.mark.usefixtures("unrefined")
@pytest.mark.parametrize(("long", "lengths"), [(3.0, [5.0]), (1.5, [2.5, 2.5])])
def test_a_long_part_stands_for_several_where_it_is_worth_more(long: float, lengths: list[float]) -> None:
    """Two short ones of 1 are worth 2."""
    worth = {2.5: 1.0, 5.0: long}
    parts = {s: MotionSegment("harmonics", s, (0.0, 0.0, 0.0, 0.0)) for s in worth}
    library = [Sized(parts[s], cast(Any, worth[s])) for s in worth]
    assert [part.seconds for part in optimised(SUM, ROOM, 10.0, library)] == lengths


def test_each_kind_is_tried_in_the_time_of_several_parts_and_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slow axis gets nowhere in short ones."""
    monkeypatch.setattr("dsd_cli.design.optimise.sized", lambda _measure, _room, part: Sized(part, cast(Any, 0.0)))
    parts = [one.part for one in library_of(SUM, ROOM, 6.0)]
    assert {(part.kind, part.seconds) for part in parts} == {(kind, s) for kind in KINDS for s in (1.5, 3.0)}
