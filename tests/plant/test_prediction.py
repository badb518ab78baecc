"""A log made by the simulator and predicted with its true model leaves nothing; each piece against brute force."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.effects import Channels
from dsd_cli.errors import DataError
from dsd_cli.plant.controllers import ControllerSettings
from dsd_cli.plant.filtering import delay_taps, delayed_mean_irregular
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.observer import observe_log
from dsd_cli.plant.prediction import (
    Sample,
    combine,
    delayed_mean,
    interval_channels,
    interval_forces,
    predict_d_hat,
)
from dsd_cli.plant.references import Multisine, Step
from dsd_cli.plant.simulation import Measurement, SimulationSettings, simulate
from dsd_cli.signals.log import Log

_path = Path(__file__).parents[1] / "oracle" / "plant_oracle.py"
_spec = importlib.util.spec_from_file_location("plant_oracle", _path)
oracle = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(oracle)

DELAYS = (0.0, 0.02, 0.0203, 0.3, 0.29985)
VISCOUS = {"viscous_friction": {"coefficient": 0.5}}
LOAD = {"constant_load": {"force": 0.2}}
COULOMB = {"coulomb_friction": {"level": 0.3}}
MULTISINE = Multisine((1.0, 3.0, 11.0, 20.0), 0.5, seed=1, start=0.1)


def fit_percent(y, predicted):
    return 100 * (1 - np.linalg.norm(y - predicted) / np.linalg.norm(y - y.mean()))


def run(model, reference=MULTISINE, kind="network_observer", **more):
    return simulate(SimulationSettings(model, 3.0, reference=reference, controller=ControllerSettings(kind), **more))


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("effects", [{}, VISCOUS, LOAD, VISCOUS | LOAD], ids=lambda e: "+".join(e) or "bare")
@pytest.mark.parametrize(("kind", "reference"), [("network_observer", Step(0.3)), ("open_loop", MULTISINE)])
def test_the_true_model_leaves_nothing(delay, effects, kind, reference):
    model = PlantModel(0.7, delay, effects)
    log = run(model, reference, kind)
    assert fit_percent(log["d_hat"], predict_d_hat(model, log, ObserverSettings())) > 99.999


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("effects", [COULOMB, COULOMB | VISCOUS | LOAD], ids=lambda e: "+".join(e))
@pytest.mark.parametrize("kind", ["network_observer", "open_loop"])
def test_stick_slip_leaves_nothing(delay, effects, kind):
    model = PlantModel(0.7, delay, effects)
    log = run(model, kind=kind)
    assert (log["velocity"][500:] == 0.0).sum() > 20  # it does stick
    assert fit_percent(log["d_hat"], predict_d_hat(model, log, ObserverSettings())) > 99.99


@pytest.mark.parametrize(
    ("delay", "floor"), [(0.0, 99.99), (0.02, 99.99), (0.0203, 99.8), (0.3, 99.99), (0.29985, 99.9)]
)
def test_from_position_fractional_delays_cost_a_little(delay, floor):
    """The second difference weighs within an interval, the mean over two intervals does not."""
    model = PlantModel(0.7, delay, VISCOUS | LOAD)
    log = run(model, Step(0.3), observe_from="position")
    assert log.d_hat_source == "position"
    assert fit_percent(log["d_hat"], predict_d_hat(model, log, ObserverSettings())) > floor


def test_wrong_models_leave_something():
    log = run(PlantModel(0.7, 0.3, VISCOUS))
    for wrong in (PlantModel(0.7, 0.3), PlantModel(0.8, 0.3, VISCOUS), PlantModel(0.7, 0.31, VISCOUS)):
        assert fit_percent(log["d_hat"], predict_d_hat(wrong, log, ObserverSettings())) < 95


def test_only_the_noise_is_left():
    model = PlantModel(0.7, 0.0203, VISCOUS)
    log = run(model, measurement=Measurement(d_hat_noise=0.02, seed=3))
    residual = log["d_hat"] - predict_d_hat(model, log, ObserverSettings())
    assert residual[50:].std() == pytest.approx(0.02, rel=0.05)
    assert np.abs(np.corrcoef(residual[51:], residual[50:-1])[0, 1]) < 0.06


def test_sign_of_the_log():
    model, observer = PlantModel(0.7, 0.02), ObserverSettings(sign=-1)
    log = run(model, observer=observer)
    assert fit_percent(log["d_hat"], predict_d_hat(model, log, observer)) > 99.999
    np.testing.assert_allclose(log["u"], run(model)["u"])


def test_without_observer_filter_it_is_equation_14():
    u = np.random.default_rng(0).standard_normal(50)
    log = Log({"u": u}, 0.01)
    predicted = predict_d_hat(PlantModel(0.5, 0.03), log, ObserverSettings(), observer_filter=False)
    np.testing.assert_allclose(predicted[3:], 2 * u[:-3] - u[3:])


def test_a_jittering_clock():
    """u held between irregular stamps; velocity of the delayed plant by its exact integral."""
    rng = np.random.default_rng(2)
    t = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 3000))
    u = np.sin(7 * t) - np.sin(7 * t[0])
    delay, inertia = 0.0123, 0.7
    force = delayed_mean_irregular(u, t, delay)
    velocity = np.concatenate([[0.0], np.cumsum(force[1:] * np.diff(t))]) / inertia
    log = observe_log(Log({"t": t, "u": u, "velocity": velocity}, 1e-3), ObserverSettings())
    predicted = predict_d_hat(PlantModel(inertia, delay), log, ObserverSettings())
    assert fit_percent(log["d_hat"], predicted) > 99.999


@pytest.mark.parametrize("delay", [0.0, 0.001, 0.0017, 0.01])
def test_mean_of_the_delayed_u_by_brute_force(delay):
    u, t = np.random.default_rng(1).standard_normal(6), 0.001 * np.arange(6)
    jitter = t + np.array([0, 2, -3, 1, 4, 0]) * 1e-4
    for k in (1, 3, 5):
        expected = oracle.mean_delayed(u, t, delay, k, parts=1000)
        assert delayed_mean(u, delay, 0.001)[k] == pytest.approx(expected, abs=5e-3)
        expected = oracle.mean_delayed(u, jitter, delay, k, parts=1000)
        assert delayed_mean_irregular(u, jitter, delay)[k] == pytest.approx(expected, abs=5e-3)


def test_taps_of_whole_delays_are_whole():
    for n in range(1, 400):
        assert delay_taps(n * 0.001, 0.001) == (n, 0.0)
    whole, fraction = delay_taps(0.0203, 0.001)
    assert (whole, round(fraction, 9)) == (20, 0.3)


def test_channels_in_chunks_need_only_the_previous_sample():
    rng = np.random.default_rng(0)
    v, q = rng.standard_normal((2, 30))
    v[10:14] = 0.0
    whole = interval_channels(v, q, 0.01)
    rest = interval_channels(v[12:], q[12:], 0.01, previous=Sample(v[11], q[11]))
    for a, b in zip(whole, rest, strict=True):
        np.testing.assert_array_equal(a[12:], b)


def test_speed_from_position_alone():
    q = np.array([0.0, 0.1, 0.3, 0.3, 0.2])
    channels = interval_channels(None, q, 0.1)
    np.testing.assert_allclose(channels.velocity, [0.0, 1.0, 2.0, 0.0, -1.0])
    np.testing.assert_array_equal(channels.sign, [np.nan, 1, 1, np.nan, -1])


def test_friction_holds_within_its_budget_and_opposes_motion():
    z = combine(
        np.array([0.2, 2.0, -2.0, 1.0, 1.0]), np.array(0.1), np.array(0.5), np.array([np.nan, np.nan, np.nan, 1, -1])
    )
    np.testing.assert_allclose(z, [0.0, 1.6, -1.4, 0.6, 1.6])
    stop = combine(np.array([1.0, 1.0]), np.array(0.0), np.array(0.5), np.array([1.0, 1.0]), np.array([0.8, 9.0]))
    np.testing.assert_allclose(stop, [0.8, 1.5])  # what explains the change of speed, within the budget


def test_forces_are_the_effects_columns():
    channels = Channels(np.zeros(2), np.zeros(2), np.array([1.0, -2.0]), np.zeros(2))
    force, budget = interval_forces(VISCOUS | LOAD | COULOMB, channels)
    np.testing.assert_allclose(force, [-0.3, 1.2])
    np.testing.assert_allclose(budget, 0.3)


def test_missing_channels_are_named():
    with pytest.raises(DataError, match="viscous_friction needs velocity"):
        predict_d_hat(PlantModel(effects=VISCOUS), Log({"u": [0.0, 1.0]}, 1e-3), ObserverSettings())
    with pytest.raises(DataError, match="no u"):
        predict_d_hat(PlantModel(), Log({"velocity": [0.0, 1.0]}, 1e-3), ObserverSettings())
    assert len(predict_d_hat(PlantModel(effects=LOAD), Log({"u": [0.0, 1.0]}, 1e-3), ObserverSettings())) == 2
