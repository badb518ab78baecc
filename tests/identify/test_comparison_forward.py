"""The model run forward: exact where the log is its own, drifting where it is not, one line where it diverges."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.identify.compare.forward import closed_loop, open_loop, run_forward
from dsd_cli.plant.controllers import ControllerSettings, Gains
from dsd_cli.plant.model import PlantModel
from tests.identify.comparison_rig import BELIEVED, CONTROLLER, MOVES, OBSERVER, T, recorded

FRICTION = {"viscous_friction": {"coefficient": 0.02}, "coulomb_friction": {"level": 0.1}}
WHOLE = replace(BELIEVED, delay=2 * T)


@pytest.mark.parametrize("model", [WHOLE, BELIEVED], ids=["whole-samples", "fraction"])
@pytest.mark.parametrize("effects", [{}, FRICTION], ids=["free", "friction"])
def test_a_log_of_the_model_itself_comes_back_in_open_loop(model, effects):
    truth = replace(model, effects=effects)
    recording = recorded(effects, reference=MOVES, noise=0.0, duration=2.0, model=model)
    found = run_forward([recording], truth, OBSERVER)
    position, velocity = found.open_loop
    assert (position.channel, velocity.channel) == ("position", "velocity")
    assert position.max_error < 2e-3
    assert velocity.fit_percent > 99.5
    assert found.closed_loop == ()
    assert found.not_closed == "the config has no [simulate.controller]"


def test_and_in_closed_loop():
    """Only the rate of the reference, which no log has, is not the true one; without it they agree."""
    steady = ControllerSettings("pd", Gains(9.0, 0.6), "output")
    for controller, least in ((steady, 99.999), (CONTROLLER, 99.7)):
        recording = recorded(FRICTION, reference=MOVES, noise=0.0, duration=2.0, controller=controller)
        found = run_forward([recording], replace(BELIEVED, effects=FRICTION), OBSERVER, controller)
        assert found.main[0] == "closed_loop"
        assert found.closed_loop[0].fit_percent > least


def test_without_its_friction_the_open_loop_drifts_and_the_closed_one_does_not():
    recording = recorded(FRICTION, reference=MOVES, noise=0.0, duration=6.0)
    found = run_forward([recording], BELIEVED, OBSERVER, CONTROLLER)
    assert found.open_loop[0].rmse > 5.0 * found.closed_loop[0].rmse
    assert found.open_loop[0].fit_percent < 0.0


def test_the_figures_are_those_of_plain_loops():
    recording = recorded(FRICTION, reference=MOVES, noise=0.0, duration=1.0)
    piece = recording.pieces[0]
    found = run_forward([recording], BELIEVED, OBSERVER, CONTROLLER)
    for rows, run in (
        (found.open_loop, open_loop(piece, BELIEVED)),
        (found.closed_loop, closed_loop(piece, BELIEVED, OBSERVER, CONTROLLER)),
    ):
        for row in rows:
            e = [a - b for a, b in zip(piece[row.channel], run[row.channel], strict=True)]
            mean = sum(piece[row.channel]) / len(e)
            spread = sum((x - mean) ** 2 for x in piece[row.channel])
            power = sum(x * x for x in e)
            assert row.rmse == pytest.approx((power / len(e)) ** 0.5)
            assert row.max_error == pytest.approx(max(map(abs, e)))
            assert row.bias == pytest.approx(sum(e) / len(e))
            assert row.fit_percent == pytest.approx(100 * (1 - (power / spread) ** 0.5))


def test_a_force_alone_moves_it_by_half_a_t_squared():
    recording = recorded({}, noise=0.0, duration=2.0)
    piece = recording.pieces[0]
    pushed = open_loop(piece, replace(BELIEVED, effects={"constant_load": {"force": 0.01}}))
    free = open_loop(piece, BELIEVED)
    t = piece["t"] - piece["t"][0]
    np.testing.assert_allclose(pushed["position"] - free["position"], 0.5 * t**2, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(pushed["velocity"] - free["velocity"], t, rtol=1e-6, atol=1e-9)


def test_a_model_that_runs_away_is_one_line():
    recording = recorded({}, reference=MOVES, duration=4.0)
    spring = PlantModel(0.01, effects={"stiffness": {"coefficient": -50.0}})
    with pytest.raises(DataError, match="runs away"):
        run_forward([recording], spring, OBSERVER)
    with pytest.raises(DataError, match="runs away"):
        run_forward([recording], BELIEVED, OBSERVER, ControllerSettings("pd", Gains(9e4, 0.0), "error"))
