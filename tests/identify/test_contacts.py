"""Contacts of motor and load, on masses whose impacts an oracle solves exactly, and on axes of the rig."""

import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.effects.driven import driven_motor
from dsd_cli.effects.memory import Coupling
from dsd_cli.identify.fit.contacts import contacts_of, contacts_with
from dsd_cli.identify.fit.pushes import Pushes
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.recordings.spectrum import SensorNoise
from dsd_cli.identify.results import Diagnosis
from dsd_cli.identify.verdict.diagnose import diagnose
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.oracle.impacts import Masses, run

STEP, NOISE = 1e-3, 0.002  # s; rad/s, of a speed sensor
COUNT = 1e-5  # rad


def force(seed: int, size: float, count: int = 15_000) -> np.ndarray:
    """Of a few sines below 3 Hz, for nothing holds the axis in place."""
    rng, t = np.random.default_rng(seed), STEP * np.arange(count)
    lines = zip(rng.uniform(0.4, 3.0, 6), rng.uniform(0.0, 2.0 * math.pi, 6), strict=True)
    return size * sum(np.sin(2.0 * math.pi * hz * t + phase) for hz, phase in lines)


def pushes(push: np.ndarray, speed: np.ndarray, seed: int, scale: float = 1.0) -> Pushes:
    """What the log of a speed sensor says, F being `scale` times what it is taken for."""
    seen = speed + NOISE * np.random.default_rng(seed).standard_normal(len(speed))
    acceleration = np.diff(seen, prepend=seen[:1]) / STEP
    changed = np.gradient(push)
    noise = SensorNoise("velocity", 0.0, (NOISE / STEP) ** 2)
    return Pushes([acceleration], [[scale * push], [changed]], noise, False, STEP, [scale * push])


def rattling(seed: int) -> tuple[Masses, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    inertia, share = float(np.exp(rng.uniform(-6.0, -1.0))), rng.uniform(0.25, 0.65)
    masses = Masses((1.0 - share) * inertia, share * inertia, rng.uniform(0.01, 0.04), rng.uniform(0.2, 0.9))
    push = force(seed, 4.0 * inertia)
    _, speed, side = run(masses, push, STEP)
    return masses, push, speed, side


@pytest.mark.parametrize("seed", range(5))
def test_hard_contacts_tell_both_inertias_and_the_gap(seed):
    masses, push, speed, side = rattling(seed)
    found = contacts_of(pushes(push, speed, seed), 1.1 * (masses.motor + masses.load))[0]
    assert found.off < POLICY.play_off
    assert found.motor == pytest.approx(masses.motor, rel=0.02)
    assert found.inertia == pytest.approx(masses.motor + masses.load, rel=0.01)
    assert found.gap == pytest.approx(masses.gap, rel=0.04)
    pressed = np.flatnonzero(side != 0.0)
    if len(pressed):  # q and the flank, once both are known from the middle of an interval
        off = found.apart[0][pressed] - 0.5 * found.reach[0] * side[pressed]
        assert np.median(np.abs(off)) < 0.05 * found.reach[0]


def test_the_delay_is_told_as_well():
    """F taken two samples late."""
    masses, push, speed, _ = rattling(7)
    late = np.concatenate([np.zeros(2), push[:-2]])
    found = contacts_of(pushes(late, speed, 7), masses.motor + masses.load)[0]
    assert found.changes[0] == pytest.approx(2.0, abs=0.3)


def test_no_play_where_the_axis_is_rigid_or_a_load_swings():
    push = force(3, 0.04)
    rigid = contacts_of(pushes(push, np.cumsum(push) * STEP / 0.01, 3), 0.01)
    assert not rigid or rigid[0].off > POLICY.play_off
    for hz in (8.0, 25.0):
        a = driven_motor(push / 0.006, STEP, Coupling.of(hz, 0.05), 0.4)
        found = contacts_of(pushes(push, np.cumsum(a) * STEP, 3), 0.01)
        assert not found or found[0].off > POLICY.play_off


def test_pushes_of_a_missing_force_are_no_contacts():
    """A sine pushes to either side in turn, and lies about where flanks of a play would; but it pushes in between."""
    push = force(544238, 0.04)
    hidden = 0.39 * float(np.std(push)) * np.sin(2.0 * math.pi * 4.2 * STEP * np.arange(len(push)) + 1.0)
    assert contacts_of(pushes(push, np.cumsum(push + hidden) * STEP / 0.01, 544238), 0.01) == []


def test_what_else_is_missing_is_left_where_the_motor_is_alone():
    """A force that is not in F pushes the motor, and the balance of what remains shows all of it: no row that touches
    the load counts."""
    masses, push, _, _ = rattling(11)
    line = np.exp(2j * math.pi * 10.0 * STEP * np.arange(len(push)))
    hidden = 0.07 * np.std(push)
    _, speed, side = run(masses, push + hidden * line.imag, STEP)
    log = pushes(push, speed, 11)
    found = contacts_with(log, masses.motor, masses.motor + masses.load, masses.gap)
    (weight,) = found.alone(log)
    assert np.mean(weight > 0.0) > 0.1
    assert not np.any(side[weight > 0.0])
    rest = weight * (masses.motor * log.acceleration[0] - push)
    columns = weight[:, None] * np.stack([line.imag, line.real], axis=1)
    assert np.linalg.lstsq(columns, rest, rcond=None)[0] == pytest.approx([hidden, 0.0], abs=0.05 * hidden)


def test_a_stretch_shorter_than_a_window_is_no_trouble():
    masses, push, speed, _ = rattling(11)
    log = pushes(push, speed, 11)
    short = replace(
        log,
        acceleration=[*log.acceleration, log.acceleration[0][:9]],
        forces=[[*by, by[0][:9]] for by in log.forces],
        before=[*log.before, log.before[0][:9]],
    )
    both = masses.motor + masses.load
    whole, found = (contacts_with(x, masses.motor, both, masses.gap) for x in (log, short))
    assert found.gap == pytest.approx(whole.gap, rel=0.02)
    assert [len(x) for x in found.alone(short)] == [len(push), 9]


def test_contacts_of_another_motor_are_none():
    masses, push, speed, _ = rattling(1)
    both = masses.motor + masses.load
    assert contacts_with(pushes(-push, speed, 1), masses.motor, both, masses.gap) is None


@pytest.mark.parametrize(
    ("gap", "inertia", "motor"), [(3.0, 1.0, 1.0), (0.3, 1.0, 1.0), (1.0, 1.3, 1.0), (1.0, 1.0, 1.2)]
)
def test_contacts_of_another_play_are_none(gap, inertia, motor):
    """A value that the log contradicts must not be given the load that the log shows."""
    masses, push, speed, _ = rattling(11)
    both = masses.motor + masses.load
    log = pushes(push, speed, 11)
    assert contacts_with(log, masses.motor, both, masses.gap) is not None
    assert contacts_with(log, motor * masses.motor, inertia * both, gap * masses.gap) is None


def test_a_long_log_takes_little_memory():
    """A dense basis of the slow drift would take 80 MB of these 100 s, and 2 GB of 340 s."""
    masses, _, _, _ = rattling(11)
    push = force(11, 4.0 * (masses.motor + masses.load), 100_000)
    _, speed, _ = run(masses, push, STEP)
    log = pushes(push, speed, 11)
    tracemalloc.start()
    found = contacts_with(log, masses.motor, masses.motor + masses.load, masses.gap)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found is not None
    assert most < 40e6


def asked(gap: float, hidden: float, effects: tuple[str, ...], rows: int = 15_000) -> tuple[Diagnosis, Masses, float]:
    """What is said of a log whose model has the play with `gap` times its true value (none of 0), and the amplitude of
    a force of 10 Hz that it does not have, `hidden` times the spread of u."""
    masses, push, _, _ = rattling(12)
    push = push[:rows]
    amplitude, time = hidden * float(np.std(push)), STEP * np.arange(len(push))
    ends = run(masses, push + amplitude * np.sin(2.0 * math.pi * 10.0 * time), STEP)
    position, speed, _ = np.concatenate([np.zeros((3, 1)), ends], axis=1)[:, :-1]  # u acts from its row on
    speed += NOISE * np.random.default_rng(12).standard_normal(len(speed))
    both = masses.motor + masses.load
    share, rate = masses.load / both, 2.0 * math.pi * 100.0
    play = {"gap": gap * masses.gap, "load_share": share, "stiffness": both * share * (1.0 - share) * rate**2}
    observer = ObserverSettings(both, 0.01)
    log = Log(
        {"t": time, "u": push, "velocity": speed, "position": COUNT * np.round(position / COUNT)}, STEP, "log.csv"
    )
    model = PlantModel(both, 0.0, {"backlash": play} if gap > 0.0 else {})
    return diagnose([prepare(log, observer)], model, observer, Settings(effects)), masses, amplitude


def test_a_gap_given_wrongly_is_named():
    found, masses, _ = asked(3.0, 0.0, ("viscous_friction",))
    named = found.ranking[0]
    assert (found.verdict, named.effect) == ("backlash", "backlash")
    assert named.parameters["gap"].value == pytest.approx(masses.gap, rel=0.1)


def test_a_force_that_is_missing_beside_a_play_has_its_size():
    found, masses, amplitude = asked(1.0, 0.07, ("periodic_disturbance",))
    assert found.verdict == "periodic_disturbance"
    assert found.ranking[0].parameters["amplitude"].value == pytest.approx(amplitude, rel=0.2)
    assert any("the motor is alone in its play" in said for said in found.warnings)
    assert found.ranking[0].all_values["inertia"].value == pytest.approx(masses.motor + masses.load, rel=0.02)
    assert found.ranking[0].all_values["backlash.load_share"].value == pytest.approx(
        masses.load / (masses.motor + masses.load)
    )
    assert all(abs(r) <= 1.0 for *_, r in found.refitted_correlations)


def test_a_load_that_no_simulation_follows_is_named_by_its_contacts():
    """Hard impacts, of a restitution that no spring and damper of the catalogue has."""
    found, masses, _ = asked(0.0, 0.0, ("backlash",), 6000)
    named = found.ranking[0]
    assert (found.verdict, found.found) == ("backlash", ("backlash",))
    assert "contacts lie on both flanks" in named.note
    assert named.parameters["gap"].value == pytest.approx(masses.gap, rel=0.05)
    assert named.parameters["load_share"].value == pytest.approx(masses.load / (masses.motor + masses.load), rel=0.05)
