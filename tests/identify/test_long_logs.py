"""Long recordings are searched in excerpts and judged on all rows; a motion that drifts is found beside the effects."""

from dataclasses import replace

import numpy as np
import pytest

from bench.hidden_cases import Job, prepared
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.path_estimate import without_drift
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import excerpts, with_part
from dsd_cli.identify.search.drift_search import searched
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.task import Task, posed
from dsd_cli.identify.verdict.diagnose import diagnose
from tests.identify.outside_rig import asked
from tests.identify.search_rig import BELIEVED, OBSERVER, T, seen
from tests.oracle import machines
from tests.oracle.rig import RigCase, make, make_exact

LONG = 60.0
#: Where what is asked is which rows are judged.
FEW = Settings(("coulomb_friction", "viscous_friction", "stiffness", "external_force", "periodic_disturbance"))
#: What a position or a speed that drifts takes for each other.
SPRINGS = Settings(("stiffness", "cubic_stiffness", "gravity", "constant_load", "coulomb_friction", "viscous_friction"))
OF_PLACE = Settings(("cogging", "stiffness", "gravity", "periodic_disturbance", "coulomb_friction", "viscous_friction"))
OF_SPEED = Settings(
    (
        *("stribeck_friction", "coulomb_friction", "viscous_friction", "viscous_asymmetry", "presliding_friction"),
        *("quadratic_drag", "constant_load", "load_friction"),
    )
)


@pytest.fixture(scope="module")
def long():
    return seen({"coulomb_friction": {"level": 0.05}}, duration=LONG)


def test_a_short_recording_is_its_own_excerpt():
    recordings = (seen(duration=5.0), seen(duration=5.0, seed=1))
    assert all(a is b for a, b in zip(excerpts(recordings), recordings, strict=True))


def test_an_excerpt_is_a_stretch_of_the_log_as_it_is(long):
    (part,) = excerpts([long])
    assert part.samples == POLICY.searched_samples < long.samples
    (piece,) = part.pieces
    first = round((piece["t"][0] - long.pieces[0]["t"][0]) / T)
    for name in ("u", "velocity", "acceleration", "t"):
        np.testing.assert_array_equal(piece[name], long.pieces[0][name][first : first + len(piece)])


def test_what_is_posed_anew_is_judged_on_all_rows(long):
    """The rows, and nearly the error, of a problem that was posed on all of them in the first place."""
    there = BELIEVED.changed(effects={**BELIEVED.effects, "coulomb_friction": {"level": 0.05}})
    few, all_rows = posed([long], there, Settings(), there.delay), Search(pose([long], there, Settings()))
    assert few.excerpt is not None
    assert few.problem.blocks.rows == pytest.approx(all_rows.problem.blocks.rows, rel=0.3)  # of another band
    assert few.problem.blocks.rows > 1.4 * few.excerpt.problem.blocks.rows  # 30,000 samples, 20,000 of them searched
    left, expected = (x.problem.errors.rmse(x.refit) for x in (few, all_rows))
    assert left == pytest.approx(expected, rel=0.3)


def test_an_excerpt_is_where_the_axis_moves(long):
    """At rest for 40 s, then the moves of the last 20 s: those are what the search must see."""
    still = long.pieces[0]
    channels = {name: x.copy() for name, x in still.channels.items()}
    for name in ("u", "velocity", "acceleration"):
        channels[name][: round(40.0 / T)] = 0.0
    channels["position"][: round(40.0 / T)] = 0.0
    (part,) = excerpts([replace(long, pieces=(replace(still, channels=channels),))])
    assert part.pieces[0]["t"][-1] > LONG - 1.0


@pytest.mark.parametrize("at", [0.5, 30.0, 59.5])
def test_a_part_that_is_added_lies_around_its_time_and_no_sample_is_there_twice(long, at):
    parts = excerpts([long])
    (more,) = with_part(parts, [long], 0, at)
    assert any(p["t"][0] <= at <= p["t"][-1] for p in more.pieces)
    stamps = np.concatenate([p["t"] for p in more.pieces])
    assert np.all(np.diff(stamps) > 0.0)
    assert set(parts[0].pieces[0]["t"]) <= set(stamps)


def test_all_rows_are_judged_and_their_values_are_truer(long):
    found = diagnose([long], BELIEVED, OBSERVER, FEW)
    assert found.verdict == "coulomb_friction"
    assert found.samples == long.samples
    level = found.ranking[0].parameters["level"]
    assert level.value == pytest.approx(0.05, abs=4.0 * level.std_error)
    (part,) = excerpts([long])
    short = diagnose([part], BELIEVED, OBSERVER, FEW).ranking[0].parameters["level"]
    assert abs(level.value - 0.05) < 0.5 * abs(short.value - 0.05)


def test_what_a_wrong_value_may_be_instead_is_sought_in_the_excerpt(long, monkeypatch):
    """No scan for what else it may be goes over all rows, but for what the excerpt leaves open."""
    scanned, scan = [], Search._at_best_starts
    monkeypatch.setattr(Search, "_at_best_starts", lambda x, *a: scanned.append((x.problem, x.allowed)) or scan(x, *a))
    there = BELIEVED.changed(effects={**BELIEVED.effects, "coulomb_friction": {"level": 0.03}})
    searches = []
    found = diagnose([long], there, OBSERVER, FEW, on_found=lambda search, _: searches.append(search))
    assert found.verdict == "coulomb_friction"
    rows = searches[0].excerpt.problem.blocks.rows
    assert all(not allowed for problem, allowed in scanned if problem.blocks.rows > 1.2 * rows)
    assert any(allowed for problem, allowed in scanned if problem.blocks.rows <= 1.2 * rows)


def test_of_what_is_surely_not_there_the_excerpt_has_the_values_and_all_rows_the_errors(long):
    asked, searches = Settings(("coulomb_friction", "stiffness", "quadratic_drag")), []
    found = diagnose([long], BELIEVED, OBSERVER, asked, on_found=lambda search, _: searches.append(search))
    (search,) = searches
    named, best, surely_not = (c for c in found.ranking if c.effect in asked.effects)
    assert surely_not.probability < 1.0 - POLICY.surest
    for one in (named, best, surely_not):
        fit = search.fit((*search.base, Term(one.effect)), search.refit.tap)
        (value,) = one.parameters.values()
        of = search.values if one is named else search.problem.values
        by_all = of(fit).estimates[f"{one.effect}.{next(iter(one.parameters))}"]
        assert one.heldout_rmse_after == pytest.approx(search.problem.score(fit).heldout_rmse, rel=1e-3)
        assert (value.std_error > 1.2 * by_all.std_error) is (one is surely_not)


def test_what_happens_outside_the_excerpt_is_seen(long):
    """A push of 1.5 s where the search did not look: the noise of u tells it from everything that was found."""
    (part,) = excerpts([long])
    first, last = part.pieces[0]["t"][[0, -1]]
    start = 0.5 * first if first > LONG - last else 0.5 * (last + LONG)
    push = {"external_force": {"events": [{"start": start, "end": start + 1.5, "force": 0.3}]}}
    found = diagnose([seen(push, duration=LONG)], BELIEVED, OBSERVER, FEW)
    assert found.verdict == "external_force"


def test_a_period_is_that_of_all_rows():
    """An excerpt tells the frequency to a fraction of 1 / 20 s: over 60 s a side lobe would be as far off."""
    hidden = {"periodic_disturbance": {"amplitude": 0.03, "frequency": 3.21, "phase": 0.4}}
    found = diagnose([seen(hidden, duration=LONG)], BELIEVED, OBSERVER, FEW)
    assert found.verdict == "periodic_disturbance"
    assert found.ranking[0].parameters["frequency"].value == pytest.approx(3.21, abs=0.1 / LONG)


@pytest.mark.parametrize(("what", "seed"), [("gravity", 20), ("cogging", 20)])
def test_forces_tell_where_a_reconstructed_motion_was(what, seed):
    log, exact = make_exact(RigCase(what=(what,), seed=seed, sensing="udhat"))
    recording, model, _ = asked(log)
    true = exact.motion.q[exact.motion.t >= 0.0]
    search, _ = searched(Task((recording,), model, Settings()))

    def off(piece):
        return float(np.std(piece["position"] - true[: len(piece)]))

    assert off(search.problem.recordings[0].pieces[0]) < 0.6 * off(recording.pieces[0])


@pytest.mark.parametrize(("what", "seed"), [("cubic_stiffness", 4000), ("stiffness", 4001)])
def test_a_spring_whose_zero_nobody_logged_is_one_spring(what, seed):
    """The position is integrated twice from an unknown start: where the spring is at rest, its force tells."""
    (log,) = make([RigCase(what=(what,), seed=seed, sensing="udhat")])
    recording, model, observer = asked(log)
    found = diagnose([recording], model, observer, SPRINGS)
    assert (found.verdict, found.found) == (what, (what,))
    assert found.probability <= POLICY.even
    coefficient = found.ranking[0].parameters["coefficient"]
    assert coefficient.value == pytest.approx(log.truth["effects"][what]["coefficient"], rel=0.02)


def test_rests_tell_a_reconstructed_speed_where_friction_holds_the_axis():
    """A third of the rests were taken for creeping, which friction drove: "unknown", 90 %."""
    case = RigCase(what=("stribeck_friction",), seed=64020, sensing="udhat")
    log, exact = make_exact(case)
    recording, model, observer = asked(log)
    piece = recording.pieces[0]
    true = np.interp(piece["t"], exact.motion.t, exact.motion.v)
    assert np.sqrt(np.mean((piece["velocity"] - true) ** 2)) < 0.004 * np.std(true)
    found = diagnose([recording], model, observer, OF_SPEED)
    assert found.verdict == "stribeck_friction"
    for name, truth in log.truth["effects"]["stribeck_friction"].items():
        assert found.ranking[0].parameters[name].value == pytest.approx(truth, rel=0.02)


def test_a_logged_motion_does_not_drift():
    (log,) = make([RigCase(what=("gravity",), seed=20, sensing="enc4096")])
    recording, model, _ = asked(log)
    assert recording.walk == 0.0
    search, whole = searched(Task((recording,), model, Settings()))
    (same,) = without_drift(search.problem, whole, [recording])
    assert all(a is b for a, b in zip(same.pieces, recording.pieces, strict=True))


@pytest.mark.parametrize(("hidden", "seed"), [((), 11), (("constant_load",), 15)])
def test_a_speed_that_is_off_by_a_constant_is_no_constant_load_of_viscous_friction(hidden, seed):
    """d_hat tells accelerations: beside viscous friction a constant speed and a constant force are one and the same."""
    (log,) = machines.run([Job("singles", hidden, seed, sensing="d_hat").case()])
    recording, model, observer = prepared(log)
    assert tuple(model.effects) == ("viscous_friction",)
    found = diagnose([recording], model, observer, OF_SPEED)
    assert found.verdict == "none"
    assert found.probability <= 0.5  # a load and a constant speed have even odds
    (tied,) = [c for c in found.ranking if c.untestable]
    assert (tied.effect, "log the position" in tied.untestable) == ("constant_load", True)
