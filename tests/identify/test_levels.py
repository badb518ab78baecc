"""Levels that differ between the logs of one rig: found beside all that the motion explains, never in place of it."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from dsd_cli.identify.fit.bank import Bank
from dsd_cli.identify.fit.equations import equations_of
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.recordings.excerpts import Deviations, with_levels
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import Estimate
from dsd_cli.identify.search.levels import Asked, deviations, levelled
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.task import Task
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.identify.verdict.levels import log_levels, said_of, stand_ins
from dsd_cli.plant.references import Multisine
from dsd_cli.signals.log import with_channels
from tests.identify.search_rig import BELIEVED, OBSERVER, SINES, seen

NAMES = ("gravity", "stiffness", "coulomb_friction", "viscous_friction", "constant_load")
LOADS = (-0.15, 0.05, 0.1)


@dataclass(frozen=True)
class At:
    """A reference around another place."""

    base: Any
    place: float

    def sample(self, samples: int, sample_time: float) -> Any:
        found = self.base.sample(samples, sample_time)
        return found._replace(position=self.place + found.position)


def settled(recording: Recording) -> Recording:
    """Without the first second, in which the axis goes to its place."""
    (piece,) = recording.pieces
    return replace(recording, pieces=(replace(piece, channels={n: x[500:] for n, x in piece.channels.items()}),))


def logs(effects, places=None) -> list[Recording]:
    """One for each set of effects, with a motion of its own."""
    moves = [replace(SINES, seed=i) if isinstance(SINES, Multisine) else SINES for i in range(len(effects))]
    return [
        settled(replace(seen(one, reference=At(move, place), seed=i, duration=7.0), name=f"log{i}.csv"))
        for i, (one, move, place) in enumerate(zip(effects, moves, places or [0.0] * len(effects), strict=True))
    ]


def load(force: float, **others) -> dict:
    return {"constant_load": {"force": force}, **others}


def asked(recordings, settings=Settings(effects=NAMES)) -> Search:  # noqa: B008
    return Search(pose(recordings, BELIEVED, settings))


def within(found: Deviations, truth, errors=5.0) -> bool:
    means = np.asarray(truth) - np.mean(truth)
    return all(abs(d - m) < errors * s for d, m, s in zip(found.by_log, means, found.errors, strict=True))


def test_a_known_load_of_one_log_is_what_it_adds_to_u():
    """Oracle: the same force in u itself."""
    plain = logs([{}, {}])
    levels = [Deviations("constant_load", "force", 0, (0.2, -0.2), (0.0, 0.0))]
    shifted = [
        replace(r, pieces=tuple(with_channels(p, u=p["u"] + x) for p in r.pieces))
        for r, x in zip(plain, (0.2, -0.2), strict=True)
    ]
    known, other = (equations_of(some, 10) for some in (with_levels(plain, levels), shifted))
    inside = slice(5, -5)
    for a, b in zip(
        known.by_stretch(Bank(known).drive((), 1)), other.by_stretch(Bank(other).drive((), 1)), strict=True
    ):
        np.testing.assert_allclose(a[inside], b[inside], atol=1e-9)
    bare = equations_of(plain, 10)
    np.testing.assert_array_equal(Bank(known).command((), 1), Bank(bare).drive((), 1))
    assert with_levels(with_levels(plain, levels), []) == tuple(plain)


@pytest.fixture(scope="module")
def three() -> list[Recording]:
    """A weight that nobody knows of, and a load that is another one in each log."""
    arm = {"gravity": {"amplitude": 0.4, "phase": 0.3}}
    return logs([load(force, **arm) for force in LOADS])


@pytest.fixture(scope="module")
def found(three):
    return levelled(Task(tuple(three), BELIEVED, Settings(effects=NAMES)))


def test_the_levels_are_found_beside_what_is_missing_and_the_rest_is_noise(found):
    (one,) = found.levels
    assert (one.name, one.alike) == ("constant_load.force", ())
    assert within(one, LOADS)
    assert {t.id for t in found.search.added(found.whole.terms)} == {"gravity"}  # the mean of the loads is 0
    assert found.search.problem.errors.rmse(found.whole) < 1.2 * found.search.problem.floor
    assert found.plain == tuple(r for r in found.plain if not r.levels)


def test_a_log_alone_has_no_levels(three):
    one = levelled(Task(tuple(three[:1]), BELIEVED, Settings(effects=("gravity", "constant_load"))))
    assert (one.levels, one.task.recordings) == ((), tuple(three[:1]))
    assert {t.id for t in one.search.added(one.whole.terms)} == {"gravity", "constant_load"}


def test_one_level_for_all_logs_leaves_more(found, three):
    shared = asked(three)
    fit = shared.fit(found.whole.terms, found.whole.tap)
    assert shared.problem.errors.rmse(fit) > 5.0 * found.search.problem.errors.rmse(found.whole)


def test_levels_known_already_are_asked_for_whole(found):
    again = deviations(found.search, found.whole)
    assert [one.name for one in again] == ["constant_load.force"]
    assert within(again[0], LOADS)


def test_a_value_that_is_held_is_the_same_in_all_logs(three):
    known = PriorKnowledge(fixed={"constant_load.force": 0.0})
    search = asked(three, Settings(effects=NAMES, known=known))
    assert "constant_load.force" not in [one.name for one in deviations(search, search.refit)]


def test_logs_of_equal_levels_have_none():
    search = asked(logs([load(0.1, coulomb_friction={"level": 0.1})] * 3))
    assert deviations(search, search.refit) == ()


def test_a_spring_seen_at_three_places_is_not_three_loads():
    search = asked(logs([{"stiffness": {"coefficient": 0.1}}] * 3, places=(-4.0, 0.0, 4.0)))
    assert deviations(search, search.refit) == ()
    assert stand_ins(search, search.options(search.refit)[0].fit) == {}


def test_two_loads_at_two_places_may_be_a_spring_and_it_is_said():
    search = asked(logs([load(-0.1), load(0.1)], places=(-4.0, 4.0)))
    assert deviations(search, search.refit) == ()
    apart = Asked(search, search.refit)
    assert {key[0] for key in apart.columns if apart.told(key)} == {"coulomb_friction", "viscous_friction"}
    spring = next(o for o in search.options(search.refit) if o.effect == "stiffness")
    assert stand_ins(search, spring.fit) == {"stiffness": ("constant_load",)}


def test_each_log_that_differs_has_a_sentence():
    one = Deviations("coulomb_friction", "level", 0, (-0.3, 0.001, 0.299), (0.01, 0.01, 0.01))
    levels = log_levels([one], {one.name: Estimate(1.0, 0.0, "{u}")}, ("a", "b", "c"))
    assert [e.value for e in levels[0].values] == pytest.approx([0.7, 1.001, 1.299])
    assert said_of(levels) == (
        "a: coulomb_friction.level is 0.7 +- 0.01 here, 30 % less than the mean of the logs, 1",
        "c: coulomb_friction.level is 1.299 +- 0.01 here, 30 % more than the mean of the logs, 1",
    )
    (without,) = log_levels([one], {}, ("a", "b", "c"))
    assert without.mean == 0.0
    assert "-0.3 off the mean of the logs, 0" in said_of([without])[0]


# -- the effect whose level differs -----------------------------------------------------------------------------------


def test_a_weight_that_makes_the_mean_of_loads_gives_way_to_the_load():
    """Gravity was 0.75 N, the loads -0.75 and 2.25 around 0, where they are 0 and 3."""
    found = levelled(Task(tuple(logs([load(-0.05), load(0.15), load(0.2)])), BELIEVED, Settings(effects=NAMES)))
    search = found.search
    assert [one.name for one in found.levels] == ["constant_load.force"]
    assert [t.id for t in search.added(found.whole.terms)] == ["constant_load"]
    mean = search.problem.values(found.whole).estimates["constant_load.force"]
    assert mean.value == pytest.approx(0.1, abs=5.0 * mean.std_error)


def test_an_offset_of_each_log_makes_no_u_of_another_axis():
    """Of three logs whose loads nobody told apart the motion tells u but for these."""
    found = diagnose(logs([load(0.6), load(-0.6), load(0.0)]), BELIEVED, OBSERVER, Settings(effects=("gravity",)))
    assert "drives this axis" not in found.blocked
    assert "drive this axis" not in found.blocked
