"""Questions made ready: white rows, the floor of the sensor, what is of use, candidates, no role for observers."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.effects import catalogue
from dsd_cli.errors import DataError
from dsd_cli.identify.fit.band import structured_share
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.freeform import freeform_fits, rich_residual
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.fit.row_weights import inflation
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.controllers import ControllerSettings, Gains
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.simulation import Measurement, SimulationSettings, simulate
from dsd_cli.signals.log import Log
from tests.identify.comparison_rig import BELIEVED, CONTROLLER, OBSERVER, SINES, T, recorded
from tests.oracle import machines
from tests.oracle.machine_cases import cases

VISCOUS = {"viscous_friction": {"coefficient": 0.02}}


def _log(sensor, effects=None, duration=8.0, seed=0, noise=None, delay=BELIEVED.delay):
    """A log with u and what this sensor measures, with noise."""
    size = noise if noise is not None else {"velocity": 2e-3, "position": 2e-5}[sensor]
    settings = SimulationSettings(
        model=replace(BELIEVED, delay=delay, effects=effects or {}),
        duration=duration,
        sample_time=T,
        observer=OBSERVER,
        controller=CONTROLLER,
        reference=SINES,
        measurement=Measurement(**{f"{sensor}_noise": size}, seed=seed),
    )
    log = simulate(settings)
    return Log({n: log[n] for n in ("t", "u", sensor)}, T, "x")


@pytest.fixture(scope="module")
def problem():
    return pose([prepare(_log("velocity", duration=40.0), OBSERVER)], BELIEVED, Settings())


# -- values -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sensing", ["position"])
def test_load_friction_leaves_the_delay_alone(sensing):
    """Its u at a whole step of delay, beside a drive between two, cost the delay 7 % and eight standard errors."""
    (case,) = cases("load_friction", [80001], sensing=sensing)
    (made,) = machines.run([case])
    effects = {name: dict(values) for name, values in (*case.base, *case.hidden) if name not in ("inertia", "delay")}
    truth = PlantModel(case.inertia, case.delay, effects)
    log = Log(dict(made.channels), float(np.median(np.diff(made.channels["t"]))), "rig")
    recording = prepare(log, ObserverSettings(case.nominal_inertia, case.observer_time_constant))
    posed = pose([recording], truth, Settings(effects=()))
    found = posed.values(Search(posed).refit).estimates
    assert found["delay"].value == pytest.approx(case.delay, rel=0.01)
    assert found["inertia"].value == pytest.approx(case.inertia, rel=0.002)
    assert found["load_friction.coefficient"].value == pytest.approx(effects["load_friction"]["coefficient"], rel=0.002)


# -- noise ------------------------------------------------------------------------------------------------------------


def test_rows_are_white_after_whitening(problem):
    """As far as 25 taps go: no lag is alike by more than a quarter, and rows are counted by what remains."""
    fits = freeform_fits(
        problem.errors.bank, problem.equations, problem.blocks, Search(problem).refit, problem.solver.inertia
    )
    white = problem.equations.whitened(rich_residual(fits))
    correlation = [white[:-k] @ white[k:] / (white @ white) for k in range(1, 15)]
    assert np.abs(correlation).max() < 0.25
    assert np.mean(white**2) == pytest.approx(problem.noise.variance, rel=0.15)
    assert 1.0 <= problem.noise.inflation < 3.0


def test_rows_that_count_twice_are_told():
    rng = np.random.default_rng(1)
    white = rng.normal(size=20_000)
    assert inflation(white) < 1.5
    held = np.repeat(rng.normal(size=2000), 10)  # ten rows that are one
    assert inflation(held) == pytest.approx(10.0, rel=0.3)
    assert inflation(np.diff(white)) == 1.0


@pytest.mark.parametrize("sensor", ["velocity", "position"])
def test_the_true_model_is_at_the_floor_that_the_sensor_leaves(sensor):
    """Mean of 6 logs; the sensor's noise is not told, but estimated from the log. The delay is a whole sample."""
    shares, true = [], replace(BELIEVED, delay=2 * T, effects=VISCOUS)
    for seed in range(6):
        recording = prepare(_log(sensor, VISCOUS, seed=seed, delay=2 * T), OBSERVER)
        posed = pose([recording], true, Settings(effects=()))
        shares.append((posed.errors.of_model(true).rmse / posed.floor) ** 2)
    assert np.sqrt(np.mean(shares)) == pytest.approx(1.0, abs=0.12)


def test_what_is_missing_is_no_noise_once_it_is_found():
    posed = pose([prepare(_log("velocity", VISCOUS, duration=20.0), OBSERVER)], BELIEVED, Settings())
    fit = posed.solver.fit((Term("viscous_friction"),), Search(posed).refit.tap)
    again = posed.measured_again(fit)
    assert again.base == posed.base
    assert again.errors is posed.errors
    white = again.equations.whitened(
        np.asarray(fit.forward @ np.stack(posed.errors.bank.design(fit.terms, fit.tap).rows))
    )
    assert np.mean(white**2) == pytest.approx(again.noise.variance, rel=0.5)


def test_the_structure_of_a_residual_is_that_of_its_spectrum(problem):
    left = problem.errors.residual(Search(problem).refit)
    quiet = structured_share(problem.equations.by_stretch(left), problem.equations.band)
    hidden = {"gravity": {"amplitude": 0.3, "phase": 0.0}}
    heavy = pose([prepare(_log("velocity", hidden, duration=40.0), OBSERVER)], BELIEVED, Settings())
    left = heavy.errors.residual(Search(heavy).refit)
    assert quiet < 0.3
    assert structured_share(heavy.equations.by_stretch(left), heavy.equations.band) > 0.35


# -- observers --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sensor", ["velocity", "position"])
def test_observers_play_no_role_where_d_hat_is_computed(sensor):
    """From 1 ms to 200 ms and any nominal inertia: the same rows to the last bit, and the same values."""
    log, found = _log(sensor, VISCOUS), []
    for tau, nominal in ((0.01, 0.01), (0.001, 1e-4), (0.2, 1.0)):
        recording = prepare(log, ObserverSettings(nominal_inertia=nominal, time_constant=tau))
        posed = pose([recording], replace(BELIEVED, effects=VISCOUS), Settings())
        fit = Search(posed).refit
        rows = [*posed.errors.bank.design(fit.terms, fit.tap).rows, *posed.solver.bank.design(fit.terms, fit.tap).rows]
        gravity = posed.solver.bank.columns(Term("gravity"), 0)
        estimates = posed.values(fit).estimates
        values = np.array([(e.value, e.std_error) for e in estimates.values()])
        found.append((posed.equations.band.hz, fit.tap, np.stack([*rows, *gravity]), values, posed.noise, posed.floor))
    for other in found[1:]:
        assert other[:2] == found[0][:2]
        np.testing.assert_array_equal(other[2], found[0][2])
        np.testing.assert_array_equal(other[3], found[0][3])
        assert other[4:] == found[0][4:]


# -- what is fitted ---------------------------------------------------------------------------------------------------


def test_the_inertia_and_delay_of_the_rig_come_back(problem):
    model = problem.scale.model(Search(problem).refit)
    assert model.inertia == pytest.approx(BELIEVED.inertia, rel=0.01)
    assert model.delay == pytest.approx(BELIEVED.delay, abs=0.1 * T)


class Told:
    """Stands for `Errors`: held-out errors by the effects of a fit, and the rms of u."""

    def __init__(self, force, values):
        self.force, self._values = force, values

    def rmse(self, fit):
        return self._values[fit.terms]


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_what_is_of_use_takes_off_a_share(problem, share):
    before = Search(problem).refit
    after = replace(before, terms=(Term("constant_load"),))
    values = {before.terms: 1.0, after.terms: 1.0 - share * POLICY.least_fall}
    judge = replace(problem, errors=Told(20.0, values))
    assert judge.practical(before, after) is (share > 1.0)
    assert not judge.practical(after, before)


def test_what_is_small_against_the_force_is_of_no_use(problem):
    before = Search(problem).refit
    after = replace(before, terms=(Term("constant_load"),))
    values = {before.terms: 1e-3, after.terms: 5e-4}
    assert not replace(problem, errors=Told(1.0, values)).practical(before, after)


def test_beside_friction_more_must_be_explained(problem):
    """Where the axis turns nobody knows friction to a per cent of u, and a small gain is that error."""
    before = Search(problem).refit
    fall = 0.5 * (POLICY.least_force + POLICY.least_unknown)
    for name, useful in (("constant_load", True), ("coulomb_friction", False)):
        after = replace(before, terms=(Term(name),))
        values = {before.terms: fall, after.terms: 1e-6}
        assert replace(problem, errors=Told(1.0, values)).practical(before, after) is useful


def test_what_is_much_of_the_force_is_of_use_however_loud_the_noise(problem):
    before = Search(problem).refit
    after = replace(before, terms=(Term("constant_load"),))
    force = 1.0
    for explained, useful in ((0.7, False), (1.5, True)):
        fall = (explained * POLICY.much_force * force) ** 2
        values = {before.terms: 1.0, after.terms: float(np.sqrt(1.0 - fall))}
        assert replace(problem, errors=Told(force, values)).practical(before, after) is useful


def test_candidates_are_the_catalogue_less_what_the_model_has():
    model = replace(BELIEVED, effects=VISCOUS)
    recording = recorded(duration=4.0)
    found = pose([recording], model, Settings())
    assert set(found.candidates) == set(catalogue()) - {"viscous_friction"}
    assert found.untestable == {}
    assert pose([recording], model, Settings(effects=("gravity", "viscous_friction"))).candidates == ("gravity",)


def test_pushes_belong_to_one_log():
    logs = [recorded(duration=4.0, seed=seed) for seed in (1, 2)]
    found = pose(logs, BELIEVED, Settings())
    listed = {n for n, e in catalogue().items() if any(p.listed for p in e.parameters)}
    assert listed
    assert set(found.untestable) == listed


def test_long_delays_are_tried_and_rows_begin_after_them():
    slow = replace(BELIEVED, delay=0.05)
    calm = ControllerSettings("pd", Gains(0.3, 0.06), "error")
    found = pose([recorded(duration=6.0, model=slow, controller=calm)], slow, Settings())
    assert found.most_tap * found.solver.bank.tap_time > slow.delay
    assert found.equations.startup >= found.most_tap * found.solver.bank.delay_step
    assert found.scale.model(Search(found).refit).delay == pytest.approx(0.05, abs=0.5 * T)


def test_sample_times_that_differ_are_refused():
    one, other = recorded(duration=3.0), recorded(duration=3.0)
    slow = replace(other, pieces=tuple(replace(p, sample_time=2 * T) for p in other.pieces), name="slow.csv")
    with pytest.raises(DataError, match=r"slow\.csv: 0\.\d+ s between samples"):
        pose([one, slow], BELIEVED, Settings())


def test_a_log_that_is_too_short_is_one_line():
    with pytest.raises(DataError, match="too short") as error:
        pose([prepare(_log("position", duration=0.5), OBSERVER)], PlantModel(0.01, 2.0), Settings())
    assert "\n" not in str(error.value)


def test_an_axis_that_does_not_move_is_one_line():
    log = _log("velocity", duration=4.0, noise=0.0)
    still = Log({**log.channels, "velocity": np.zeros(len(log))}, T, "still.csv")
    with pytest.raises(DataError, match="does not move") as error:
        pose([prepare(still, OBSERVER)], BELIEVED, Settings())
    assert "\n" not in str(error.value)
