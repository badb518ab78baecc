"""What an adaptive controller predicts, against the simulated plant itself."""

import itertools

import numpy as np
import pytest

from dsd_cli.plant.adaptive import AdaptiveController
from dsd_cli.plant.controllers import ControllerSettings, Gains, Measured
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.motion import Plant
from dsd_cli.plant.predictor import Believed, StatePredictor
from dsd_cli.plant.references import Multisine
from dsd_cli.plant.simulation import SimulationSettings, simulate

T = 1e-3


@pytest.mark.parametrize("delay", [0.0, 0.0004, 0.02, 0.0203])
@pytest.mark.parametrize("inertia", [0.7, 2.0])
def test_the_prediction_is_the_motion_one_delay_later(delay, inertia):
    """Exact for any real L: from each sample the plant is run on for L under the commands that are on their way."""
    reference = Multisine((3.0, 11.0), 0.6, seed=2)
    model = PlantModel(inertia, delay)
    log = simulate(SimulationSettings(model, 0.4, T, controller=ControllerSettings("open_loop"), reference=reference))
    predictor = StatePredictor(T, 0.05)
    predictor.believe(Believed(inertia, delay))
    for k in range(300):
        expected = _moved(log, k, delay, inertia)
        got = predictor.ahead(float(log["position"][k]), float(log["velocity"][k]))
        assert got == pytest.approx(expected, abs=1e-12)
        predictor.sent(float(log["u"][k]))


def _moved(log, k, delay, inertia):
    """Plain integration over [t_k, t_k + L): at t_k + s acts the command of t_k + s - L, 0 before the log."""
    q, v = float(log["position"][k]), float(log["velocity"][k])
    cuts = sorted({0.0, delay, *(s for i in range(60) if 0.0 < (s := i * T + delay - 50 * T) < delay)})
    for a, b in itertools.pairwise(cuts):
        sent = int(np.floor((k * T + 0.5 * (a + b) - delay) / T + 1e-9))
        u = float(log["u"][sent]) if sent >= 0 else 0.0
        q, v = q + v * (b - a) + 0.5 * u / inertia * (b - a) ** 2, v + u / inertia * (b - a)
    return q, v


@pytest.mark.parametrize("delay", [0.0, 0.005, 0.0123])
def test_arrived_is_the_mean_of_the_delayed_command(delay):
    from dsd_cli.plant.filtering import delayed_mean

    u = np.concatenate([np.zeros(40), np.random.default_rng(1).normal(size=200)])
    predictor = StatePredictor(T, 0.0123)
    predictor.believe(Believed(1.0, delay))
    got = []
    for value in u:
        got.append(predictor.arrived())
        predictor.sent(float(value))
    np.testing.assert_allclose(got, delayed_mean(u, delay, T), atol=1e-15)


def test_a_delay_beyond_the_memory_is_refused():
    with pytest.raises(ValueError, match="longer than the memory"):
        StatePredictor(T, 0.01).believe(Believed(1.0, 0.02))


def test_a_right_belief_makes_the_loop_that_of_the_undelayed_plant():
    """The finite-spectrum law: closed on the state one delay ahead, the motion is the undelayed loop's, L later."""
    delay, inertia = 0.1, 0.6
    gains, reference = Gains(4.0, 3.0), 1.0
    controller = AdaptiveController(ControllerSettings("pd", gains), ObserverSettings(1.0, 0.0), T, delay, ramp=0.0)
    controller.adopt(Believed(inertia, delay))
    plant, sent, q = Plant(PlantModel(inertia)), [], []
    for k in range(3000):
        u = controller.step(Measured(reference, 0.0, plant.position, plant.velocity, 0.0))
        sent.append(u)
        plant.advance(k * T, sent[k - 100] if k >= 100 else 0.0, T)
        q.append(plant.position)
    undelayed, expected = Plant(PlantModel(1.0)), []
    for k in range(2900):  # gains times J/Jn on J are the gains on Jn
        undelayed.advance(k * T, gains.kp * (reference - undelayed.position) - gains.kd * undelayed.velocity, T)
        expected.append(undelayed.position)
    np.testing.assert_allclose(q[100:], expected, atol=1e-9)


@pytest.mark.parametrize(("integral", "left"), [(0.0, -0.3 / (0.6 * 4.0)), (2.0, 0.0)])
def test_the_integral_takes_off_what_a_constant_load_leaves(integral, left):
    """Statics: kp J/Jn e = load without an integral; with one, e = 0."""
    settings = ControllerSettings("pd", Gains(4.0, 3.0), integral=integral)
    controller = AdaptiveController(settings, ObserverSettings(1.0, 0.0), T, 0.0, ramp=0.0)
    controller.adopt(Believed(0.6, 0.0))
    plant = Plant(PlantModel(0.6, 0.0, {"constant_load": {"force": -0.3}}))
    for k in range(30_000):
        u = controller.step(Measured(1.0, 0.0, plant.position, plant.velocity, 0.0))
        plant.advance(k * T, u, T)
    assert plant.position - 1.0 == pytest.approx(left, abs=1e-6)


def test_with_the_standard_observer_only_what_the_belief_does_not_explain_is_fed_back():
    """kind = "observer": under a right belief the compensation is the load alone, though L and J are wrong by far."""
    settings, observer = ControllerSettings("observer", Gains(4.0, 3.0)), ObserverSettings(1.0, 0.01)
    model = PlantModel(2.0, 0.02, {"constant_load": {"force": -0.3}})

    class Known:
        longest_delay, ramp = 0.02, 0.0

        def step(self, u, d_hat):
            return Believed(2.0, 0.02)

    log = simulate(SimulationSettings(model, 12.0, T, observer, settings), Known())
    assert log["u"][-1] == pytest.approx(0.3, abs=1e-6)
    assert log["position"][-1] == pytest.approx(1.0, abs=1e-6)
    assert np.isnan(log["adopted_delay"][0])
    assert (log["adopted_inertia"][1:] == 2.0).all()


def test_a_change_of_the_law_does_not_jump():
    controller = AdaptiveController(ControllerSettings("pd", Gains(4.0, 3.0)), ObserverSettings(), T, 0.1, ramp=0.2)
    at = Measured(1.0, 0.0, 0.2, 0.1, 0.0)
    before = controller.step(at)
    controller.adopt(Believed(3.0, 0.1))
    after = [controller.step(at) for _ in range(300)]
    assert after[0] == pytest.approx(before, rel=0.01)
    assert np.abs(np.diff(after)).max() < 0.02 * abs(after[-1] - before)
    assert abs(after[-1] - before) > 1.0
