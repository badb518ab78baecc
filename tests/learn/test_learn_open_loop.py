"""Learning from a resonator that u drives in open loop: what learn and a fit of the values leave is the same."""

import pytest

from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.learn.learning import learn
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle import resonator


def swung(u_hold, lacks=()):
    """A resonator under a u that was sampled, logged as this kind, and the model without these effects."""
    axis = resonator.AXIS
    log = Log(resonator.swung(5, False), resonator.T, "log", u_hold=u_hold)
    known = {"stiffness": axis.stiffness, "viscous_friction": axis.damping, "cubic_stiffness": axis.cubic}
    own = {name: {"coefficient": value} for name, value in known.items() if name not in lacks}
    return prepare(log, ObserverSettings(axis.inertia, 0.005)), PlantModel(axis.inertia, 0.0, own)


def test_what_is_left_for_a_law_is_what_a_fit_of_the_values_leaves():
    """u taken as held is half a sample late, which only a delay below 0 makes up for: no model has that."""
    recording, model = swung("held")
    problem = pose([recording], model, Settings(effects=()))
    wanted = problem.score(Search(problem).refit).heldout_rmse
    assert learn([recording], model).refitted.heldout_rmse == pytest.approx(wanted, rel=0.05)


def test_a_spring_that_hardens_in_open_loop_has_its_number():
    recording, model = swung("sampled", lacks=("cubic_stiffness",))
    found = learn([recording], model)
    assert found.formula is not None
    assert found.formula.effects == ("cubic_stiffness",)
    (number,) = found.formula.parameters.values()
    assert abs(number.value) == pytest.approx(resonator.AXIS.cubic, rel=0.02)
    _, complete = swung("sampled")
    true = pose([recording], complete, Settings(effects=())).errors.of_model(complete)
    assert found.after.rmse < 1.05 * true.rmse < 0.3 * found.refitted.rmse
