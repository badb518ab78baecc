"""Whether a verdict stands on either half of the data, and in other bands: halves that are made to differ."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.verdict.contradictions import Contradiction, beside_told
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.identify.verdict.stability import with_stability
from tests.identify.search_rig import BELIEVED, OBSERVER, seen
from tests.report.examples import DIAGNOSIS

VISCOUS = 0.02
SETTINGS = Settings(effects=("viscous_friction", "coulomb_friction", "constant_load", "gravity"))


@pytest.fixture(scope="module")
def recording():
    return seen({"viscous_friction": {"coefficient": VISCOUS}})


@pytest.fixture(scope="module")
def found(recording):
    return diagnose([recording], BELIEVED, OBSERVER, SETTINGS)


def with_friction(recording, law):
    """The same motion with another friction in its second half: u less the one that was there, and with the other."""
    (piece,) = recording.pieces
    u, v = piece["u"].copy(), piece["velocity"]
    half = len(u) // 2
    u[half:] += (law(v) - VISCOUS * v)[half:]
    return replace(recording, pieces=(replace(piece, channels={**piece.channels, "u": u}),))


def test_what_both_halves_and_bands_need_is_as_sure_as_before(recording, found):
    again = with_stability(found, [recording], BELIEVED, SETTINGS)
    assert (found.verdict, again.probability) == ("viscous_friction", found.probability)
    assert found.probability > POLICY.surest_in_doubt
    assert [(one.verdict, one.same) for one in again.stability] == 4 * [("viscous_friction", True)]


@pytest.mark.parametrize(
    ("law", "named"), [(np.zeros_like, "none"), (lambda v: 0.1 * np.sign(v), "coulomb_friction")], ids=["none", "dry"]
)
def test_a_half_without_it_or_with_another_in_its_place_makes_it_less_sure(recording, found, law, named):
    again = with_stability(found, [with_friction(recording, law)], BELIEVED, SETTINGS)
    first, second = again.stability[:2]
    assert (first.same, second.same, second.verdict) == (True, False, named)
    assert again.probability == POLICY.surest_in_doubt


def test_what_no_part_bears_out_is_rather_not_there(found):
    """A lag at 90 % that neither half of a log, nor half or twice its band, had any use for: it was the noise of d_hat
    that comes back in u."""
    again = with_stability(found, [seen({})], BELIEVED, SETTINGS)
    assert [one.same for one in again.stability] == 4 * [False]
    assert again.probability < 0.5


def test_where_nothing_is_missing_a_half_in_which_something_is_makes_it_less_sure(recording, found):
    nothing = replace(found, verdict="none", found=(), whole_model=None, model=BELIEVED)
    again = with_stability(nothing, [with_friction(recording, np.zeros_like)], BELIEVED, SETTINGS)
    assert [(one.verdict, one.same) for one in again.stability[:2]] == [("viscous_friction", False), ("none", True)]
    assert again.probability == POLICY.surest_in_doubt


def test_single_events_are_asked_of_no_part():
    pushes = replace(DIAGNOSIS, verdict="external_force", probability=0.99)
    again = with_stability(pushes, (), BELIEVED, Settings())
    assert (again.probability, again.stability) == (POLICY.surest_in_doubt, ())


def test_all_that_is_said_of_a_verdict_is_as_sure_as_the_verdict(found):
    again = with_stability(found, [seen({})], BELIEVED, SETTINGS)
    said = [one.probability for one in (*again.ranking, *again.missing) if one.effect == again.verdict]
    assert max(said) == again.probability
    nothing = replace(found, verdict="none", found=(), missing=(), whole_model=None, model=BELIEVED)
    again = with_stability(nothing, [seen({"viscous_friction": {"coefficient": VISCOUS}})], BELIEVED, SETTINGS)
    assert [one.same for one in again.stability] == 4 * [False]
    assert again.unexplained.probability >= 1.0 - again.probability > 0.5


def test_beside_a_value_that_the_log_contradicts_the_set_is_no_surer_than_the_verdict(found):
    again = beside_told(found, [Contradiction.of("inertia", "held", "is held at 2; this log alone says 1")])
    said = [one.probability for one in (again, *again.ranking, *again.missing)]
    assert again.missing
    assert max(said) == POLICY.even
    assert beside_told(found, ["a warning"]) == found
