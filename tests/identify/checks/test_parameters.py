"""Which values a log tells: the true machine's values within their errors, and what no such log can tell."""

import numpy as np
import pytest

from dsd_cli.effects import get_effect
from dsd_cli.identify.checks import check_log
from dsd_cli.identify.final_fit import add_effect
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Log
from tests.identify.checks.rig import log_of, model_of, observer_of, recordings, servo
from tests.identify.checks.test_instruments import DAMPING, LEVEL, WEIGHT, J, pendulum
from tests.oracle import machines
from tests.oracle.machine_cases import cases


def by_name(result):
    return {one.name: one for one in result.parameters}


def true_value(recording, name):
    if name in ("inertia", "delay"):
        return getattr(recording.truth, name)
    effect, _, parameter = name.partition(".")
    return dict((*recording.truth.base, *recording.truth.hidden))[effect][parameter]


WEIGHS = {"gravity": {"amplitude": WEIGHT, "phase": 0.0}}
RUBS = {"coulomb_friction": {"level": LEVEL}, "viscous_friction": {"coefficient": DAMPING}}
LAWS = ("coulomb_friction", "gravity", "cogging", "dead_zone", "actuator_lag")


def test_what_is_identified_is_near_the_truth_from_a_model_that_is_a_little_off():
    machine = [case for what in LAWS for case in cases(what, range(60, 63), "plain", "position", duration=6.0)]
    identified = 0
    for recording in machines.run(machine):
        true = model_of(recording)
        off = PlantModel(1.1 * true.inertia, 1.1 * true.delay, {n: _off(n, v) for n, v in true.effects.items()})
        found = by_name(check_log(log_of(recording), off))
        assert {one.identified for one in found.values()} <= {"identified", "weak"}
        for name, one in found.items():
            if one.identified == "identified" and name != "delay":
                identified += 1
                assert one.value == pytest.approx(true_value(recording, name), rel=0.15), name
    assert identified > 30


def _off(effect, values):
    """Factors a fifth too large; shapes, which the forces are not linear in, a thousandth."""
    known = {p.name: p for p in get_effect(effect).parameters}
    return {
        name: value * (1.2 if known[name].linear and known[name].unit != "rad" else 1.001)
        for name, value in values.items()
    }


def test_inertia_and_delay_alone_without_a_model():
    """All but an axis with a second mass, whose motor alone is seen above its resonance."""
    for recording in recordings("motion")[::5]:
        if recording.truth.hidden and recording.truth.hidden[0][0] == "flexible_coupling":
            continue
        found = by_name(check_log(log_of(recording)))
        assert list(found) == ["inertia", "delay"]
        if found["inertia"].identified == "identified":
            assert found["inertia"].value == pytest.approx(recording.truth.inertia, rel=0.1)


def test_what_a_log_without_reversals_cannot_tell_is_tied():
    """One direction only: Coulomb friction and a constant load are one force."""
    T, t = 0.001, np.arange(6000) * 0.001
    velocity = 2.0 + np.sin(2.0 * np.pi * 1.3 * t) + 0.5 * np.sin(2.0 * np.pi * 3.1 * t)
    u = 0.1 * np.gradient(velocity, T) + 0.5 + 1e-3 * np.random.default_rng(0).normal(size=t.size)
    model = PlantModel(0.1, 0.0, {"coulomb_friction": {"level": 0.3}, "constant_load": {"force": -0.2}})
    found = by_name(check_log(Log({"t": t, "u": u, "velocity": velocity}, T), model))
    assert found["inertia"].identified == "identified"
    assert found["coulomb_friction.level"].tied_to == ("constant_load.force",)
    assert found["constant_load.force"].identified == "not"


def test_gravity_of_an_axis_that_hardly_turns_is_not_told():
    recording = servo("velocity")
    true = model_of(recording)
    model = PlantModel(true.inertia, true.delay, {**true.effects, "gravity": {"amplitude": 0.0, "phase": 0.0}})
    found = by_name(check_log(log_of(recording), model))
    assert found["gravity.phase"].identified == "not"  # of an amplitude of 0
    assert found["coulomb_friction.level"].identified == "identified"
    warned = [
        one for one in check_log(log_of(recording), model).findings if "not identifiable from this log" in one.what
    ]
    assert [one.severity for one in warned] == ["warning"]


def test_d_hat_alone_tells_inertia_and_delay_and_effects_weakly_at_best():
    recording = servo("d_hat")
    found = by_name(check_log(log_of(recording), model_of(recording), observer_of(recording)))
    assert found["inertia"].identified == "identified"
    assert found["inertia"].value == pytest.approx(recording.truth.inertia, rel=0.05)
    assert {one.identified for name, one in found.items() if "." in name} <= {"weak", "not"}


def test_nothing_is_identified_on_a_log_that_cannot_answer():
    c = servo("velocity").channels
    result = check_log(log_of(servo("velocity"), u=-c["u"]), model_of(servo("velocity")))
    assert {one.identified for one in result.parameters} == {"not"}


def rubbing(inertia: float, delay: int, level: float, viscous: float) -> Log:
    """A mass that dry and viscous friction brake, led by steps of a drive, 1 ms apart: by plain sums."""
    T, rng = 0.001, np.random.default_rng(11)
    u = np.repeat(rng.choice([-2.0, -1.2, 1.2, 2.0], 160), 50)
    v, speed = np.zeros(u.size), 0.0
    for k in range(1, u.size):
        for _ in range(10):
            force = (u[k - 1 - delay] if k > delay else 0.0) - viscous * speed - level * np.tanh(speed / 0.01)
            speed += 0.1 * T / inertia * force
        v[k] = speed
    return Log({"t": T * np.arange(u.size), "u": u, "velocity": v}, T)


def test_a_delay_that_missing_friction_bends_is_not_identified():
    """With the friction in the model both values are right; without it they are wrong by more than their own errors."""
    inertia, delay = 0.05, 3
    log = rubbing(inertia, delay, level=0.8, viscous=0.4)
    friction = {"coulomb_friction": {"level": 0.8}, "viscous_friction": {"coefficient": 0.4}}
    whole = check_log(log, PlantModel(inertia, 0.003, friction))
    found = by_name(whole)
    assert {one.identified for one in found.values()} == {"identified"}
    assert found["inertia"].value == pytest.approx(inertia, rel=0.03)
    assert found["delay"].value == pytest.approx(0.003, abs=0.0005)
    assert lacking(whole) == []
    bare = check_log(log, PlantModel(inertia, 0.003))
    found = by_name(bare)
    assert found["delay"].identified != "identified"
    for name, true in (("inertia", inertia), ("delay", 0.003)):
        assert abs(found[name].value - true) < 2.0 * found[name].std_error
    (bent,) = lacking(bare)  # without a reference: with friction beside the model hardly anything is left
    assert bent.remedy == "dsd diagnose says which"


def test_a_value_that_a_missing_force_does_not_move_is_not_said_to_be_biased():
    """Friction hides how well both are known; what they are is the same with it, to a thousandth."""
    result = check_log(rubbing(0.05, 0, level=0.1, viscous=0.4), PlantModel(0.05, 0.0))
    found = by_name(result)["delay"]
    assert (found.value, found.beside) == pytest.approx((0.0, 0.0), abs=1e-4)
    (said,) = lacking(result)
    assert said.what.endswith("a force is missing in [model] and widens the +- of inertia and delay")


def test_no_complete_model_is_said_to_bend_a_value():
    for recording in recordings("motion")[:15]:
        said = lacking(check_log(log_of(recording), model_of(recording)))
        assert said == [], recording.truth.hidden


#: rad
NOISES = (1e-6, 1e-4, 5e-4, 3e-3, 1e-2)


@pytest.mark.parametrize("error", NOISES)
@pytest.mark.parametrize("seed", range(3))
def test_no_complete_model_is_said_to_bend_a_value_where_the_controller_answers_noise(error, seed):
    """With and without a reference, also where that is too weak an instrument to show the noise."""
    channels = pendulum(seed, error, 4)
    true = PlantModel(J, 0.0, {**WEIGHS, **RUBS})
    for dropped in ((), ("reference",)):
        log = Log({name: x for name, x in channels.items() if name not in dropped}, 0.002, "log")
        assert lacking(check_log(log, true)) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_reference_shows_that_a_force_is_missing(seed):
    """Friction, of a controller whose sensor is hardly off: the values with it are right."""
    result = check_log(Log(pendulum(seed, 1e-6), 0.002, "log"), PlantModel(J, 0.0, WEIGHS))
    found = by_name(result)
    bends = {name for name in ("inertia", "delay") if found[name].beside is not None and found[name].lacks_force}
    assert bends
    (said,) = lacking(result)
    assert all(f"{name} {found[name].value:.3g}" in said.what for name in bends)
    off = any(abs(found[name].value - found[name].beside) > 1e-3 for name in bends)  # of two the delay is 0 either way
    assert said.what.endswith(f"a force is missing in [model] and {'biases' if off else 'widens the +- of'} delay")
    assert said.remedy == "dsd diagnose says which"


def lacking(result):
    return [one for one in result.findings if "a force is missing in [model] and " in one.what]


def test_values_are_those_that_add_would_write():
    """One engine: what `dsd check` says of a value no command that fits denies."""
    recording = servo("velocity")
    true = model_of(recording)
    off = PlantModel(1.3 * true.inertia, true.delay, true.effects)
    said = by_name(check_log(log_of(recording), off, observer_of(recording)))
    prepared = prepare(log_of(recording), observer_of(recording))
    written = add_effect([prepared], off, observer_of(recording), "inertia").estimates
    assert said.keys() == written.keys()
    for name, one in said.items():
        assert (one.value, one.std_error) == pytest.approx((written[name].value, written[name].std_error)), name


@pytest.mark.parametrize("mean_before", [True, False])
def test_a_u_that_is_the_mean_before_its_stamp_is_one_sample_late(mean_before):
    """As drives log a measured torque: 1 sample was said to be 0.8 and no word of it; one that is held is on time."""
    T, rng, rows = 0.004, np.random.default_rng(21), 3000
    held = np.convolve(rng.standard_normal(rows + 20), np.hanning(21) / 5.0, "valid")[:rows]
    v, q = np.zeros(rows), np.zeros(rows)  # exact: u is held, and nothing but the inertia is there
    for k in range(1, rows):
        a = held[k - 1] / J
        v[k], q[k] = v[k - 1] + a * T, q[k - 1] + v[k - 1] * T + 0.5 * a * T**2
    u = np.concatenate([held[:1], held[:-1]]) if mean_before else held
    log = Log({"t": T * np.arange(rows), "u": u, "position": np.round(q / 1e-5) * 1e-5}, T)
    late = [one for one in check_log(log, PlantModel(J)).findings if one.late]
    assert len(late) == mean_before
    assert all(one.late == pytest.approx(T, rel=0.02) for one in late)
