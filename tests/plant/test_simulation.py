"""The simulator against a fine-step oracle; events, noise, seeds, controllers and references."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import DataError, UsageError
from dsd_cli.plant.controllers import ControllerSettings, Gains, cdm_gains
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.motion import Plant
from dsd_cli.plant.references import Multisine, Samples, Sine, Step, Trapezoids
from dsd_cli.plant.simulation import Event, Measurement, SimulationSettings, simulate

_path = Path(__file__).parents[1] / "oracle" / "plant_oracle.py"
_spec = importlib.util.spec_from_file_location("plant_oracle", _path)
oracle = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(oracle)

MULTISINE = Multisine((2.0, 9.0), 0.6, seed=1, start=0.05)


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.0203])
@pytest.mark.parametrize(("viscous", "coulomb", "load"), [(0, 0, 0), (0.8, 0, 0.1), (0, 0.4, 0), (0.5, 0.3, 0.1)])
def test_plant_against_a_fine_step_oracle(delay, viscous, coulomb, load):
    effects = {
        "viscous_friction": {"coefficient": viscous},
        "coulomb_friction": {"level": coulomb},
        "constant_load": {"force": load},
    }
    settings = SimulationSettings(
        PlantModel(0.7, delay, effects), 1.5, controller=ControllerSettings("open_loop"), reference=MULTISINE
    )
    log = simulate(settings)
    q, v = oracle.run_plant(log["u"].tolist(), 1e-3, delay, 0.7, viscous, coulomb, load)
    np.testing.assert_allclose(log["velocity"], v, atol=2e-4)
    np.testing.assert_allclose(log["position"], q, atol=2e-4)
    d_hat = oracle.observe_velocity(log["u"], log["velocity"], 1e-3, 1.0, 0.01)
    np.testing.assert_allclose(log["d_hat"][100:], d_hat[100:], atol=1e-4)


def test_friction_stops_exactly_and_stays():
    plant = Plant(PlantModel(2.0, effects={"coulomb_friction": {"level": 1.0}}), velocity=0.3)
    plant.advance(0.0, 0.4, 1.0)  # decelerates with (1.0 - 0.4)/2 = 0.3, so it stops after 1 s, at 0.15
    plant.advance(1.0, 0.4, 1.0)
    assert plant.velocity == pytest.approx(0.0, abs=1e-12)
    assert plant.position == pytest.approx(0.15)
    plant = Plant(PlantModel(2.0, effects={"coulomb_friction": {"level": 1.0}}), velocity=0.3)
    plant.advance(0.0, 0.4, 5.0)
    assert plant.velocity == 0.0


def test_cdm_gains_of_the_paper():
    assert cdm_gains(2.5, 1.0) == pytest.approx((0.4, 1.0))
    kp, kd = cdm_gains(0.3, 2.0, 2.5)
    assert kd / kp == pytest.approx(0.3)
    assert kd**2 / (2.0 * kp) == pytest.approx(2.5)


@pytest.mark.parametrize("derivative", ["output", "error"])
@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3, 1.0])
def test_network_observer_is_stable_for_any_delay(delay, derivative):
    """It leaves the tracking error of a wrong inertia: q settles at Jn/J times r."""
    controller = ControllerSettings(derivative=derivative)
    log = simulate(SimulationSettings(PlantModel(0.8, delay), 25.0, 5e-3, controller=controller, reference=Step(0.3)))
    assert log["position"][-1] == pytest.approx(1 / 0.8, abs=0.02)
    assert abs(log["u"][-1]) < 0.01


def test_network_observer_feeds_back_the_undelayed_nominal_plant():
    """With Q = 1 the loop does not feel delay and inertia: u is that of the nominal plant without delay."""
    observer = ObserverSettings(time_constant=0.0)
    logs = [
        simulate(SimulationSettings(model, 3.0, 1e-3, observer, reference=Step(0.3)))
        for model in (PlantModel(1.0, 0.0), PlantModel(0.6, 0.3))
    ]
    np.testing.assert_allclose(logs[0]["u"], logs[1]["u"], atol=1e-9)


def test_plain_pd_is_unstable_where_the_network_observer_is_not():
    pd = ControllerSettings("pd", Gains(40.0, 10.0))
    with pytest.raises(DataError, match="unstable"):
        simulate(SimulationSettings(PlantModel(1.0, 0.3), 300.0, 5e-3, controller=pd))
    limited = ControllerSettings("pd", Gains(40.0, 10.0), limit=2.0)
    assert np.abs(simulate(SimulationSettings(PlantModel(1.0, 0.3), 10.0, 5e-3, controller=limited))["u"]).max() == 2.0


@pytest.mark.filterwarnings("error")
def test_an_axis_that_swings_beyond_all_numbers_is_said_in_one_line():
    arm = PlantModel(0.01, 0.02, {"gravity": {"amplitude": 0.4, "phase": 0.3}})
    pd = ControllerSettings("pd", Gains(1e3, 1e2))
    with pytest.raises(DataError, match="unstable"):
        simulate(SimulationSettings(arm, 6.0, 1e-3, controller=pd, start=0.3))


def test_standard_observer_rejects_a_load():
    model = PlantModel(1.0, 0.0, {"constant_load": {"force": -0.3}})
    positions = {}
    for kind in ("pd", "observer"):
        log = simulate(SimulationSettings(model, 20.0, 5e-3, controller=ControllerSettings(kind), reference=Step(0.0)))
        positions[kind] = log["position"][-1]
    assert positions["observer"] == pytest.approx(1.0, abs=1e-3)
    assert positions["pd"] == pytest.approx(1.0 - 0.3 / 0.4, abs=1e-2)


def test_events_change_the_plant_at_their_sample():
    events = (Event(1.0, delay=0.4), Event(2.0, inertia=2.0, effects={"viscous_friction": {"coefficient": 1.0}}))
    log = simulate(SimulationSettings(PlantModel(1.0, 0.3), 3.0, reference=Sine(20.0), events=events))
    t = log["t"]
    np.testing.assert_array_equal(log["true_delay"], np.where(t >= 1.0, 0.4, 0.3))
    np.testing.assert_array_equal(log["true_inertia"], np.where(t >= 2.0, 2.0, 1.0))
    raw = np.diff(log["velocity"]) / 1e-3
    k = np.flatnonzero(t == 1.5)[0]
    assert raw[k] == pytest.approx(log["u"][k - 400])
    assert raw[k - 600] == pytest.approx(log["u"][k - 900])


def test_log_has_every_channel_and_a_regular_clock():
    log = simulate(SimulationSettings(PlantModel(), 0.5))
    assert list(log.channels) == [
        "t", "u", "d_hat", "position", "velocity", "reference", "true_delay", "true_inertia",
    ]  # fmt: skip
    assert len(log) == 500
    assert log["t"][3] == 0.003


def test_noise_is_reproducible_and_inside_the_loop():
    def run(seed, **noise):
        measurement = Measurement(seed=seed, **noise)
        return simulate(SimulationSettings(PlantModel(1.0, 0.02), 1.0, measurement=measurement))

    a, b, c = run(1, d_hat_noise=0.1), run(1, d_hat_noise=0.1), run(2, d_hat_noise=0.1)
    for name in a.channels:
        np.testing.assert_array_equal(a[name], b[name])
    assert not np.array_equal(a["d_hat"], c["d_hat"])
    assert not np.array_equal(a["u"], c["u"])
    assert run(1, velocity_noise=0.1)["velocity"].std() > 0.05
    assert run(1, position_noise=0.1)["position"].std() > 0.05


def test_encoder_rounds_position_and_differences_it():
    step = 1e-4
    log = simulate(SimulationSettings(PlantModel(), 2.0, measurement=Measurement(encoder_step=step)))
    counts = log["position"] / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    np.testing.assert_allclose(log["velocity"][1:], np.diff(log["position"]) / 1e-3, atol=1e-9)
    assert log.d_hat_source == "position"


@pytest.mark.parametrize(
    "reference",
    [
        Sine(20.0, 0.5, 0.0),
        Multisine((1.0, 5.0), 0.3, 4),
        Trapezoids(1.0, 0.8, 2.0, 0.3, 0.2),
        Trapezoids(0.1, 9.0, 2.0),
    ],
    ids=lambda r: type(r).__name__,
)
def test_rate_is_the_derivative(reference):
    position, rate = reference.sample(4000, 1e-3)
    np.testing.assert_allclose(np.gradient(position, 1e-3)[1:-1], rate[1:-1], atol=0.02)


def test_step_and_its_rate():
    position, rate = Step(0.3, 2.0).sample(1000, 1e-3)
    assert (position[299], position[300]) == (0.0, 2.0)
    assert rate.sum() * 1e-3 == pytest.approx(2.0)


def test_references_start_where_they_say():
    for reference in (Sine(5.0, start=0.2), Multisine((3.0,), seed=1, start=0.2), Trapezoids(1, 1, 1, start=0.2)):
        position, rate = reference.sample(400, 1e-3)
        assert not position[:200].any()
        assert not rate[:200].any()
        assert position[201:].any()


def test_trapezoids_go_to_and_fro_with_dwell():
    position, rate = Trapezoids(1.0, 0.5, 1.0, 0.5).sample(8000, 1e-3)
    assert (position.min(), position.max()) == (pytest.approx(0.0, abs=1e-9), pytest.approx(1.0))
    assert np.abs(rate).max() == pytest.approx(0.5)
    assert position[2700] == pytest.approx(1.0)
    assert rate[2700] == pytest.approx(0.0)
    assert position[5900] == pytest.approx(0.0)


def test_given_samples_hold_their_last_value():
    position, rate = Samples((0.0, 1.0, 3.0)).sample(5, 0.5)
    np.testing.assert_array_equal(position, [0, 1, 3, 3, 3])
    np.testing.assert_array_equal(rate, [0, 2, 4, 0, 0])


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: PlantModel(inertia=0.0), "inertia"),
        (lambda: PlantModel(delay=-1.0), "delay"),
        (lambda: PlantModel(delay=float("nan")), "delay"),
        (lambda: PlantModel(effects={"glue": {}}), "glue"),
        (lambda: PlantModel(effects={"viscous_friction": {"coef": 1.0}}), "coef"),
        (lambda: PlantModel(effects={"viscous_friction": {}}), "lacks coefficient"),
        (lambda: PlantModel(effects={"coulomb_friction": {"level": -1.0}}), "level"),
        (lambda: ObserverSettings(nominal_inertia=0.0), "nominal_inertia"),
        (lambda: ObserverSettings(sign=2), "sign"),
        (lambda: SimulationSettings(PlantModel(), 0.0), "duration"),
        (lambda: ControllerSettings("lqr"), "kind"),
        (lambda: Trapezoids(1.0, 0.0, 1.0), "speed"),
        (lambda: Samples(()), "reference"),
    ],
)
def test_wrong_settings_are_refused(make, word):
    with pytest.raises(UsageError, match=word):
        make()
