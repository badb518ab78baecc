"""Every effect of the catalogue: a log simulated with it and predicted by its true model leaves next to nothing."""

import numpy as np
import pytest

from dsd_cli.effects import catalogue
from dsd_cli.errors import UsageError
from dsd_cli.plant.controllers import ControllerSettings, Gains
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.motion import Plant
from dsd_cli.plant.prediction import predict_d_hat
from dsd_cli.plant.references import Multisine, Trapezoids
from dsd_cli.plant.simulation import Event, SimulationSettings, simulate

#: Samples after which Q has forgotten how it began (10 tau).
SETTLED = 100
PULSES = [{"start": 0.5, "end": 0.7503, "force": 0.4}, {"start": 1.2, "end": 1.21, "force": -0.4}]

#: Effects with values, and the fit in percent that the true model must reach.
CASES = [
    ({"viscous_friction": {"coefficient": 0.5}}, 99.999),
    ({"viscous_friction": {"coefficient": 0.3}, "viscous_asymmetry": {"coefficient": 0.2}}, 99.999),
    ({"quadratic_drag": {"coefficient": 0.5}}, 99.999),
    ({"constant_load": {"force": 0.2}}, 99.999),
    ({"gravity": {"amplitude": 0.5, "phase": 0.3}}, 99.999),
    ({"stiffness": {"coefficient": 5.0}}, 99.999),
    ({"cubic_stiffness": {"coefficient": 20.0}}, 99.999),
    ({"cogging": {"amplitude": 0.2, "periods": 50.0, "phase": 0.4}}, 99.999),
    ({"periodic_disturbance": {"amplitude": 0.2, "frequency": 17.0, "phase": 0.4}}, 99.999),
    ({"periodic_disturbance": {"amplitude": 0.2, "frequency": 150.0, "phase": 0.4}}, 99.999),
    ({"external_force": {"events": PULSES}}, 99.999),
    ({"coulomb_friction": {"level": 0.2}}, 99.999),
    ({"coulomb_friction": {"level": 0.1}, "stribeck_friction": {"excess": 0.1, "velocity": 0.05}}, 99.99),
    ({"load_friction": {"coefficient": 0.3}}, 99.98),
    ({"gain_droop": {"droop": 0.1}}, 99.99),
    ({"presliding_friction": {"level": 0.3, "stiffness": 300.0}}, 99.99),
    ({"presliding_friction": {"level": 0.3, "stiffness": 3000.0}}, 99.97),
    ({"dead_zone": {"width": 0.2}}, 99.999),
    ({"saturation": {"limit": 0.5}}, 99.999),
    ({"actuator_lag": {"time_constant": 0.0005}}, 99.999),
    ({"actuator_lag": {"time_constant": 0.1}}, 99.999),
    ({"flexible_coupling": {"frequency": 5.0, "load_share": 0.8, "damping": 0.1}}, 99.99),
    ({"flexible_coupling": {"frequency": 20.0, "load_share": 0.5, "damping": 0.05}}, 99.97),
    ({"flexible_coupling": {"frequency": 60.0, "load_share": 0.3, "damping": 0.02}}, 99.95),
]
MULTISINE = Multisine((6.0, 13.0, 31.0, 50.0), 0.5, seed=1, start=0.1)
MOVES = Trapezoids(1.0, 2.0, 10.0, 0.2, 0.1)
PD = ControllerSettings("pd", Gains(30.0, 5.0), limit=50.0)
OPEN = ControllerSettings("open_loop")


def fit_percent(y, predicted):
    return 100 * (1 - np.linalg.norm(y - predicted) / np.linalg.norm(y - y.mean()))


def fit_of_the_true_model(model, controller, reference, duration=2.0):
    log = simulate(SimulationSettings(model, duration, controller=controller, reference=reference))
    predicted = predict_d_hat(model, log, ObserverSettings())
    return fit_percent(log["d_hat"][SETTLED:], predicted[SETTLED:])


def test_every_effect_is_tried():
    tried = {name for effects, _ in CASES for name in effects} | {"backlash"}
    assert tried >= set(catalogue())


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.0203])
@pytest.mark.parametrize(("effects", "floor"), CASES, ids=lambda x: "+".join(x) if isinstance(x, dict) else "")
@pytest.mark.parametrize(("controller", "reference"), [(PD, MOVES), (OPEN, MULTISINE)], ids=["moves", "multisine"])
def test_the_true_model_leaves_nothing(delay, effects, floor, controller, reference):
    assert fit_of_the_true_model(PlantModel(0.7, delay, effects), controller, reference) > floor


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.0203])
@pytest.mark.parametrize(
    ("gap", "stiffness", "floor"),
    [(0.02, 300.0, 99.95), (0.02, 2000.0, 99.9), (0.005, 2000.0, 99.9), (0.005, 2e4, 99.4)],
)
def test_backlash_in_moves_leaves_next_to_nothing(delay, gap, stiffness, floor):
    """A load that rattles between the flanks (multisine) is chaotic: its bounces is indistinguishable from samples."""
    model = PlantModel(0.7, delay, {"backlash": {"gap": gap, "load_share": 0.4, "stiffness": stiffness}})
    assert fit_of_the_true_model(model, PD, MOVES) > floor


def test_effects_together():
    effects = {
        "dead_zone": {"width": 0.05},
        "actuator_lag": {"time_constant": 0.005},
        "coulomb_friction": {"level": 0.1},
        "gravity": {"amplitude": 0.5, "phase": 0.0},
        "flexible_coupling": {"frequency": 20.0, "load_share": 0.3, "damping": 0.05},
    }
    assert fit_of_the_true_model(PlantModel(0.7, 0.0203, effects), PD, MOVES) > 99.9


def test_stick_and_slip():
    """A slow pull over a soft spring with Stribeck friction: it sticks, breaks away, and sticks again."""
    effects = {
        "coulomb_friction": {"level": 0.2},
        "stribeck_friction": {"excess": 0.2, "velocity": 0.02},
        "viscous_friction": {"coefficient": 0.3},
    }
    model, pull = PlantModel(0.7, 0.0, effects), ControllerSettings("pd", Gains(8.0, 0.0))
    log = simulate(SimulationSettings(model, 20.0, controller=pull, reference=Trapezoids(5.0, 0.05, 10.0)))
    still = log["velocity"] == 0.0
    assert np.count_nonzero(np.diff(still.astype(int)) == 1) > 3
    predicted = predict_d_hat(model, log, ObserverSettings())
    assert fit_percent(log["d_hat"][SETTLED:], predicted[SETTLED:]) > 99.9


def test_a_flexible_coupling_rings_at_its_resonance():
    """Motor and load left alone after a kick, with no damping: the motor's speed oscillates at the resonance."""
    effects = {"flexible_coupling": {"frequency": 15.0, "load_share": 0.4, "damping": 0.0}}
    plant = Plant(PlantModel(2.0, effects=effects))
    speeds = []
    for k in range(4000):
        plant.advance(k * 1e-3, 100.0 if k < 5 else 0.0, 1e-3)
        speeds.append(plant.velocity)
    free = np.array(speeds[100:])
    spectrum = np.abs(np.fft.rfft((free - free.mean()) * np.hanning(free.size)))
    assert np.argmax(spectrum) / (free.size * 1e-3) == pytest.approx(15.0, abs=0.3)
    assert free.mean() == pytest.approx(100.0 * 5e-3 / 2.0, rel=0.02)  # momentum over the whole inertia
    assert np.ptp(free[-200:]) == pytest.approx(np.ptp(free[:200]), rel=0.02)  # and energy is kept


def test_backlash_comes_to_rest():
    effects = {
        "backlash": {"gap": 0.02, "load_share": 0.4, "stiffness": 2000.0},
        "viscous_friction": {"coefficient": 2.0},
    }
    log = simulate(SimulationSettings(PlantModel(0.7, 0.0, effects), 4.0, controller=PD))
    assert abs(log["velocity"][-1]) < 1e-3
    assert log["position"][-1] == pytest.approx(1.0, abs=1e-3)


def test_a_loop_begins_with_a_settled_command():
    log = simulate(SimulationSettings(PlantModel(0.7, 0.0, {"actuator_lag": {"time_constant": 0.2}}), 1.0))
    assert log["velocity"][1] == pytest.approx(log["u"][0] / 0.7 * 1e-3 * 0.5 * 1e-3 / 0.2, rel=0.01)


def test_an_event_switches_an_effect_on():
    events = (Event(0.5, effects={"saturation": {"limit": 0.1}, "constant_load": {"force": -0.2}}),)
    model = PlantModel(0.7, 0.0, {"saturation": {"limit": 9.0}})
    log = simulate(SimulationSettings(model, 1.0, controller=OPEN, reference=MULTISINE, events=events))
    force = 0.7 * np.diff(log["velocity"]) / 1e-3
    np.testing.assert_allclose(force[:499], log["u"][:499], atol=1e-9)
    np.testing.assert_allclose(force[500:], np.clip(log["u"][500:-1], -0.1, 0.1) - 0.2, atol=1e-9)


def test_share_of_the_load_is_a_share():
    with pytest.raises(UsageError, match="load_share"):
        PlantModel(effects={"flexible_coupling": {"frequency": 5.0, "load_share": 1.2, "damping": 0.1}})
