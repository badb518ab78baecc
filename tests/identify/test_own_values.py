"""Whether the model's own values are wrong: named where they are, silent where they are right or nothing told them."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.results import DELAY, INERTIA
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.identify.verdict.own_values import own_values
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.identify.search_rig import BELIEVED, T, posed
from tests.oracle.rig import RigCase, make

#: Amplitude and pulsation of the sines of a speed.
SLOW, FEW = ((0.3, 2.3), (0.25j, 5.1), (0.15, 9.0)), ((0.3, 4.3), (0.2, 17.0))
FRICTION = {"coulomb_friction": {"level": 0.08}}


def asked(model, names=(), effects=None, **more):
    return own_values(posed(effects, names, model, duration=6.0, **more))


@pytest.fixture(scope="module")
def right():
    return asked(BELIEVED)


def test_values_that_are_right_are_not_blamed(right):
    assert right.wrong == ""
    assert right.probability == 0.0
    assert {c.effect for c in right.candidates} == {INERTIA, DELAY}
    assert all(c.probability == 0.0 for c in right.candidates)
    assert right.refitted.heldout_rmse == pytest.approx(right.score.heldout_rmse, rel=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_in_noise_of_other_seeds_they_are_not_blamed_either(seed):
    assert asked(BELIEVED, seed=10 + seed).wrong == ""


def test_what_is_certain_but_of_no_use_is_not_blamed():
    """An inertia that is 0.1 % off shows in a log without noise, and changes nothing that anybody would see."""
    believed = replace(BELIEVED, inertia=1.001 * BELIEVED.inertia)
    assert asked(believed, noise=1e-5).wrong == ""


@pytest.mark.parametrize(
    ("wrong", "believed"),
    [
        (INERTIA, replace(BELIEVED, inertia=1.3 * BELIEVED.inertia)),
        (INERTIA, replace(BELIEVED, inertia=0.8 * BELIEVED.inertia)),
        (DELAY, replace(BELIEVED, delay=BELIEVED.delay + 4 * T)),
        (DELAY, replace(BELIEVED, delay=0.0)),
    ],
    ids=["heavier", "lighter", "later", "earlier"],
)
def test_one_wrong_value_is_named_and_put_right(wrong, believed):
    found = asked(believed)
    assert found.wrong == wrong
    assert found.probability > 0.9
    first = found.candidates[0]
    assert first.effect == wrong
    assert first.probability == found.probability
    assert first.parameters[wrong].value == pytest.approx(getattr(BELIEVED, wrong), rel=0.02, abs=0.2 * T)
    assert getattr(first.model, wrong) == first.parameters[wrong].value
    assert first.rmse_after < 0.5 * found.score.rmse
    assert found.refitted.heldout_rmse < 0.5 * found.score.heldout_rmse


def test_a_candidate_changes_its_one_value_and_nothing_else():
    believed = replace(BELIEVED, inertia=1.3 * BELIEVED.inertia, delay=BELIEVED.delay + 4 * T, effects=FRICTION)
    for candidate in asked(believed, effects=FRICTION).candidates:
        changed = replace(candidate.model, **{candidate.effect: getattr(believed, candidate.effect)})
        assert changed == believed


def test_a_wrong_value_of_an_effect_is_blamed_on_that_effect():
    believed = replace(BELIEVED, effects={"coulomb_friction": {"level": 0.2}})
    found = asked(believed, effects=FRICTION)
    first = found.candidates[0]
    assert (found.wrong, first.effect) == ("coulomb_friction", "coulomb_friction")
    assert first.parameters["level"].value == pytest.approx(FRICTION["coulomb_friction"]["level"], rel=0.03)
    assert (first.heldout_rmse_before, first.heldout_rmse_after) == (
        found.score.heldout_rmse,
        found.refitted.heldout_rmse,
    )


def test_the_least_of_one_value_is_where_a_fine_grid_has_it():
    """Errors of 200 inertias, one by one."""
    search = posed(None, (), replace(BELIEVED, inertia=1.3 * BELIEVED.inertia), duration=6.0)
    (found,) = (c for c in own_values(search).candidates if c.effect == INERTIA)
    grid = BELIEVED.inertia * np.geomspace(0.7, 1.6, 200)
    errors = [search.problem.errors.of_model(replace(search.problem.model, inertia=x)).rmse for x in grid]
    assert found.rmse_after <= min(errors) * (1.0 + 1e-9)
    assert found.parameters[INERTIA].value == pytest.approx(grid[int(np.argmin(errors))], rel=0.005)


def test_another_delay_that_a_lag_explains_as_well_says_so():
    """A lag of a few ms looks like so much more delay at these frequencies, and the other way round."""
    later = replace(BELIEVED, delay=BELIEVED.delay + 2 * T)
    with_lag = own_values(posed(None, ("actuator_lag",), BELIEVED, plant=later, duration=6.0, noise=0.02))
    without = own_values(posed(None, ("gravity",), BELIEVED, plant=later, duration=6.0, noise=0.02))
    assert with_lag.wrong == without.wrong == DELAY
    assert with_lag.candidates[0].indistinguishable_from == ("actuator_lag",)
    assert without.candidates[0].indistinguishable_from == ()


def knowing(problem, **told):
    """The candidates of a problem of whose values this is told."""
    solver, known = problem.solver, replace(problem.solver.known, **told)
    solver = type(solver)(solver.bank, problem.blocks, solver.inertia, known)
    return own_values(Search(replace(problem, solver=solver)))


@pytest.mark.parametrize(
    ("name", "bounds"),
    [(DELAY, (0.0, 0.5 * BELIEVED.delay)), (INERTIA, (0.5 * BELIEVED.inertia, 0.8 * BELIEVED.inertia))],
)
def test_a_candidate_stays_within_the_bounds_that_were_told(name, bounds):
    found = knowing(posed(None, (), duration=6.0).problem, bounds={name: bounds})
    (own,) = (c for c in found.candidates if c.effect == name)
    assert bounds[0] * (1.0 - 1e-9) <= own.parameters[name].value <= bounds[1] * (1.0 + 1e-9)


def test_held_values_are_no_candidates():
    problem = posed(None, (), replace(BELIEVED, inertia=1.3 * BELIEVED.inertia), duration=6.0).problem
    found = knowing(problem, fixed={INERTIA: problem.model.inertia})
    assert [c.effect for c in found.candidates] == [DELAY]
    assert found.wrong != INERTIA


@pytest.mark.parametrize(("factor", "verdict"), [(1.0, "none"), (1.2, "gravity")])
def test_the_zero_of_a_reconstructed_position_is_nothing_against_the_model(factor, verdict):
    """Of u and d_hat alone: the phase of a known weight was "wrong", 85 to 99 %; its amplitude still may be."""
    (log,) = make([RigCase(what=(), seed=62013, sensing="udhat")])
    gravity = dict(log.truth["effects"]["gravity"])
    gravity["amplitude"] *= factor
    observer = ObserverSettings(log.observer["nominal_inertia"], log.observer["time_constant"])
    model = PlantModel(log.truth["inertia"], log.truth["delay"], {"gravity": gravity})
    found = diagnose([prepare(Log(log.channels, log.sample_time, "log"), observer)], model, observer)
    assert found.verdict == verdict
    assert any("gravity.phase: the position was put together from u and d_hat" in w for w in found.warnings)


@pytest.mark.parametrize("back", [False, True], ids=["one way", "to and fro"])
def test_of_moves_one_way_another_load_is_friction_as_well(back):
    """u = J a + F: with the load of the model as given, friction makes up for the rest, unless the axis goes back."""
    rng, t = np.random.default_rng(12), 0.002 * np.arange(4000)
    speed = 2.0 * (0.0 if back else 1.0) + 0.7 * np.sin(2.3 * t) + 0.6 * np.sin(7.1 * t + 1.0)
    force = 0.05 * np.gradient(speed, t) + 0.5
    log = Log({"t": t, "u": force + 1e-3 * rng.normal(size=4000), "velocity": speed}, 0.002, "log", u_hold="sampled")
    model, observer = PlantModel(0.05, 0.0, {"constant_load": {"force": -0.2}}), ObserverSettings(0.05, 0.01)
    asked = Settings(effects=("coulomb_friction", "viscous_friction", "quadratic_drag"))
    found = diagnose([prepare(log, observer)], model, observer, asked)
    named = next(c for c in found.ranking if c.effect == found.verdict)
    assert found.verdict == "constant_load"
    assert ("coulomb_friction" in named.indistinguishable_from) != back
    assert (found.probability > 0.9) == back


def test_a_right_value_is_not_called_wrong_for_what_is_missing():
    """u = J a + B v + F sgn v, with B as given and F missing, which any other B takes a part of: B was wrong, 50 %."""
    rng, t = np.random.default_rng(13), 0.002 * np.arange(4000)
    speed = 0.7 * np.sin(2.3 * t) + 0.6 * np.sin(7.1 * t + 1.0)
    force = 0.05 * np.gradient(speed, t) + speed + 0.3 * np.sign(speed)
    log = Log({"t": t, "u": force + 1e-3 * rng.normal(size=4000), "velocity": speed}, 0.002, "log", u_hold="sampled")
    model, observer = PlantModel(0.05, 0.0, {"viscous_friction": {"coefficient": 1.0}}), ObserverSettings(0.05, 0.01)
    asked = Settings(effects=("coulomb_friction", "constant_load"))
    found = diagnose([prepare(log, observer)], model, observer, asked)
    assert (found.verdict, found.probability) == ("coulomb_friction", 0.99)
    assert {c.effect: c.probability for c in found.ranking}["viscous_friction"] == 0.0


@pytest.mark.parametrize(("waves", "lag", "verdict"), [(SLOW, 0.025, INERTIA), (FEW, 0.012, DELAY)])
def test_friction_that_is_late_is_no_inertia(waves, lag, verdict):
    """tau w' + w = u, w = J a + B v: of a lagging valve u has B tau a beside J a, and J was wrong, 99 %."""
    rng, t = np.random.default_rng(14), 0.002 * np.arange(4000)
    speed, slope, bend = (np.real(sum(a * (1j * w) ** k * np.exp(1j * w * t) for a, w in waves)) for k in range(3))
    inertia, viscous = 0.15, 18.0
    u = inertia * (slope + lag * bend) + viscous * (speed + lag * slope)
    channels = {"t": t, "u": u + 0.02 * rng.normal(size=4000), "velocity": speed}
    model = PlantModel(inertia, 0.0, {"viscous_friction": {"coefficient": viscous}})
    observer = ObserverSettings(inertia, 0.01)
    recording = prepare(Log(channels, 0.002, "log", u_hold="sampled"), observer)
    found = diagnose([recording], model, observer, Settings(effects=("coulomb_friction", "actuator_lag")))
    (own,) = (c for c in found.ranking if c.effect == INERTIA)
    assert own.probability <= 0.5
    assert found.verdict == verdict
    assert verdict == DELAY or own.indistinguishable_from == ("actuator_lag",)
