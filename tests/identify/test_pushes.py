"""Pushes in time: taken where something pushed, and not where a law of the motion, or a drift, makes them."""

import numpy as np
import pytest

from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.pulses import sharpened, with_pulses
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.identify.verdict.discrepancy import discrepancy_of
from dsd_cli.identify.verdict.pushes import _of_place, law_of_pushes, pushed
from dsd_cli.plant.references import Multisine
from tests.identify.outside_rig import diagnosed
from tests.identify.search_rig import BELIEVED, OBSERVER, T, posed, seen
from tests.identify.test_discrepancy import disturbed

PUSHES = {"external_force": {"events": [{"start": 3.0, "end": 3.4, "force": 0.5}]}}

SLOPE = {
    "coulomb_friction": {"level": 0.3},
    "viscous_friction": {"coefficient": 0.05},
    "external_force": {"events": [{"start": 4.0, "end": 7.0, "force": -0.5}]},
}


def test_a_push_is_found_where_it_was_and_nothing_is_left_then():
    search = posed(PUSHES, ("external_force", "gravity", "viscous_friction"))
    before = discrepancy_of(search, search.refit)
    fit, found = pushed(search, search.refit, before)
    (term,) = search.added(fit.terms)
    assert term.id == "external_force"
    ((start, end),) = term.shape["edges"]
    assert start == pytest.approx(3.0, abs=3 * T)
    assert end == pytest.approx(3.4, abs=3 * T)
    assert not found.unknown
    assert search.problem.errors.rmse(fit) < 0.8 * search.problem.errors.rmse(search.refit)


def test_a_push_that_lasts_is_found_with_the_friction_beside_it():
    """A slope of 3 s: in the motion by u neither shows without the other. Of 20 more draws of the noise 12 are found,
    and the others are unknown."""
    names = ("coulomb_friction", "viscous_friction", "stiffness", "external_force")
    slow = Multisine((0.23, 0.47, 0.91), 2.0, seed=3)
    search = posed(SLOPE, names, reference=slow, duration=12.0)
    whole = search.run(search.refit)
    fit, found = pushed(search, whole, discrepancy_of(search, whole))
    assert {t.id for t in search.added(fit.terms)} == {"coulomb_friction", "viscous_friction", "external_force"}
    assert next(t for t in fit.terms if t.effect.listed).shape["edges"][0] == pytest.approx((4.0, 7.0), abs=3 * T)
    assert not found.unknown


def test_without_a_push_everything_stays_as_it_was():
    search = posed(None, ("external_force",))
    before = discrepancy_of(search, search.refit)
    assert pushed(search, search.refit, before) == (search.refit, before)


def test_pulses_never_stand_in_for_a_law():
    """A force that goes with speed times place is no train of pushes: it stays unknown, and nothing is added."""
    search = disturbed(lambda t, v, q: 0.4 * v * q, ("external_force",))
    before = discrepancy_of(search, search.refit)
    fit, found = pushed(search, search.refit, before)
    assert fit is search.refit
    assert found.unknown


def _drawn(seed, count=3000):
    """(force, place): four pushes at random times, an axis that goes to and fro at a rate that wanders."""
    rng = np.random.default_rng(seed)
    place = np.sin(2.0 * np.pi * np.cumsum(rng.uniform(0.5, 1.5, count // 50).repeat(50)) / 250.0)
    force = np.zeros(count)
    for start in rng.integers(0, count - 150, 4):
        force[start : start + int(rng.integers(30, 150))] += rng.choice([-1.0, 1.0])
    return force, place


def test_pushes_at_random_times_are_of_no_place():
    """20 seeds, and what an end of the travel does to the same motion is always seen."""
    assert [seed for seed in range(20) if _of_place(*_drawn(seed))] == []
    ends = [(-np.maximum(place - 0.7, 0.0) > -0.15) * 1.0 for _, place in map(_drawn, range(20))]
    assert all(_of_place(1.0 - end, _drawn(seed)[1]) for seed, end in enumerate(ends))


def test_a_push_all_along_is_of_no_place():
    assert not _of_place(np.ones(500), np.linspace(0.0, 1.0, 500))


def test_what_pushes_back_at_the_end_of_the_travel_is_no_train_of_pushes():
    """A wall that is not in the catalogue: unknown, and it depends on the position."""
    search = disturbed(lambda t, v, q: -0.4 * (q > np.quantile(q, 0.9)), ("external_force",))
    fit, found = pushed(search, search.refit, discrepancy_of(search, search.refit))
    assert fit is search.refit
    assert found.unknown
    assert "position" in found.on


def test_a_force_that_climbs_by_steps_is_a_drift():
    """Five levels without a pause: a function of time that nobody knows. Two pushes on top of each other are pushes."""
    steps = np.array([0.15, 0.35, 0.2, 0.45, 0.3])
    climbing = disturbed(
        lambda t, v, q: np.where((t >= 3.0) & (t < 5.5), steps[np.clip((t / 0.5 - 6.0).astype(int), 0, 4)], 0.0),
        ("external_force",),
    )
    fit = sharpened(climbing, with_pulses(climbing, climbing.refit))
    assert law_of_pushes(climbing, fit) == "time"
    assert pushed(climbing, climbing.refit, discrepancy_of(climbing, climbing.refit))[0] is climbing.refit
    stacked = disturbed(
        lambda t, v, q: 0.2 * ((t >= 3.0) & (t < 6.0)) + 0.25 * ((t >= 4.0) & (t < 5.0)), ("external_force",)
    )
    fit = sharpened(stacked, with_pulses(stacked, stacked.refit))
    assert law_of_pushes(stacked, fit) == ""


def test_strong_pushes_of_a_short_log_are_no_dead_zone():
    """4 pushes that take 40 % of 3 s: inertia and friction may absorb them ("dead zone, 99 %")."""
    assert diagnosed(("external_force",), 51016, "enc40k", 3.0).verdict == "external_force"


@pytest.mark.parametrize("start", [2.0, 4.0, 5.5])
def test_a_single_push_is_never_surer_than_ninety_percent(start):
    """No other part of the data has it: what else happened in that second nobody knows. Of 20 logs of other noise
    and times, 18 say 90 % and two 50 %."""
    push = {"external_force": {"events": [{"start": start, "end": start + 1.5, "force": 0.3}]}}
    found = diagnose([seen(push, duration=8.0)], BELIEVED, OBSERVER, Settings(("external_force", "coulomb_friction")))
    assert found.verdict == "external_force"
    assert [one.probability for one in found.missing] == [POLICY.surest_in_doubt]


def test_pushes_are_looked_for_beside_a_law_that_hides_them():
    """Of steps: five pushes beside viscous friction were a dead zone and presliding friction, 90 %."""
    found = diagnosed(("external_force", "viscous_friction"), 64030, "speed40k", 20.0)
    assert set(found.found) == {"external_force", "viscous_friction"}
    assert found.whole_model is not None
    starts = [e["start"] for e in found.whole_model.effects["external_force"]["events"]]
    assert starts == pytest.approx([2.484, 5.390, 9.231, 13.241, 17.594], abs=0.01)


@pytest.mark.parametrize(("what", "seed", "duration"), [("slew_limit", 64611, 3.0), ("end_stop", 64800, 20.0)])
def test_pushes_that_leave_more_than_the_sensor_are_half_sure(what, seed, duration):
    """They fit a part of any law: these were external_force, 96 to 99 %."""
    found = diagnosed((what,), seed, "speed40k", duration)
    assert found.verdict == "unknown" or found.probability <= 0.5


def test_pushes_that_leave_what_the_sensor_does_are_sure():
    assert diagnosed(("external_force",), 64740, "speed40k", 3.0).probability > 0.8


def test_pushes_beside_friction_that_a_wandering_speed_turns_round_are_half_sure():
    """Nothing is missing there; of u and d_hat alone it was external_force, 85 %."""
    assert diagnosed((), 63008, "udhat", 20.0).probability <= 0.5
