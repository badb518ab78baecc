"""The oracle's cases against what they promise: an excited hidden effect, measured as said, known to the last digit."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.oracle import machines, plant_oracle
from tests.oracle.machine_cases import EFFECT_IDS, STRANGER_IDS, cases, pairs

T = 0.001
FILES = sorted(Path(machines.__file__).parent.glob("machine*.py"))
SHORT = {"duration": 2.0}  # s; integrating one machine costs what integrating fifty costs


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.name)
def test_oracle_knows_nothing_of_the_package(path):
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            names.add(str(node.module).split(".")[0])
    assert names <= {"numpy", "tests", "collections", "dataclasses", "typing", "zlib"}
    assert len(path.read_text("utf-8").splitlines()) <= 300


def short(what, **options):
    return cases(what, [1], **SHORT | options)[0]


def test_d_hat_of_the_log_is_the_plain_observer_of_its_velocity():
    log = machines.run([short("gravity")])[0]
    case, channels = log.truth, log.channels
    tau = case.observer_time_constant
    plain = plant_oracle.observe_velocity(channels["u"], channels["velocity"], T, case.nominal_inertia, tau)
    settled = round(40 * tau / T)
    np.testing.assert_allclose(channels["d_hat"][settled:], plain[settled:], atol=1e-9 * log.drive_rms)


def test_constant_load_is_hidden_in_d_hat_by_its_own_size():
    case = short("constant_load", base=["viscous_friction"])
    log = machines.run([case])[0]
    force = abs(dict(case.hidden)["constant_load"]["force"])
    assert log.hidden_rms == pytest.approx(force * case.nominal_inertia / case.inertia, rel=1e-6)


def test_noise_floor_is_the_noise_asked_for():
    logs = machines.run([short("none", sensing=s, noise=0.02) for s in machines.SENSINGS])
    for log, low, high in zip(logs, (0.7, 0.7, 0.5, 0.7), (1.4, 1.4, 1.4, 1.4), strict=True):
        assert low < log.noise_floor / (0.02 * log.drive_rms) < high


def test_noise_free_log_has_no_noise_floor():
    quiet = replace(short("none"), velocity_noise=0.0, encoder_step=0.0)
    log = machines.run([quiet, replace(quiet, channels="position"), replace(quiet, channels="d_hat")])
    assert [entry.noise_floor for entry in log] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("sensing", machines.SENSINGS)
def test_log_holds_only_what_this_sensing_measures(sensing):
    log = machines.run([short("coulomb_friction", sensing=sensing, duration=0.5)])[0]
    assert set(log.channels) == {"t", *machines.SENSINGS[sensing]}
    assert all(len(values) == 500 and np.isfinite(values).all() for values in log.channels.values())
    assert log.channels["t"][0] == pytest.approx(0.0, abs=1e-12)


def test_nothing_hidden_leaves_nothing_hidden():
    bases = [(), ("viscous_friction",), ("coulomb_friction", "viscous_friction"), ("gravity", "cogging")]
    for log in machines.run([short("none", base=base) for base in bases]):
        assert log.hidden_rms < 1e-9 * log.drive_rms
        assert log.ratio == pytest.approx(1.0)


def test_same_seed_same_log_alone_or_among_others():
    every = [name for name in (*EFFECT_IDS, *STRANGER_IDS) if name != "coulomb_friction"]
    chosen = [cases(what, [1], duration=0.6)[0] for what in ("coulomb_friction", *every)]
    together, again = machines.run(chosen), machines.run(cases("coulomb_friction", [1], duration=0.6))[0]
    for name, values in again.channels.items():
        np.testing.assert_array_equal(values, together[0].channels[name])
    other = machines.run(cases("coulomb_friction", [2], duration=0.6))[0]
    assert not np.allclose(other.channels["u"], again.channels["u"])


@pytest.fixture(scope="module")
def excited():
    """One integration of every effect, plain and moderate, the sensings taking turns."""
    senses, chosen = list(machines.SENSINGS), {}
    for i, what in enumerate([*EFFECT_IDS, *STRANGER_IDS, *pairs()]):
        for seed, amplitude in enumerate(("plain", "moderate")):
            chosen[what, amplitude, seed] = cases(what, [seed], amplitude, senses[(i + seed) % 4], duration=4.0)[0]
    return dict(zip(chosen, machines.run(list(chosen.values())), strict=True))


@pytest.mark.parametrize("what", [*EFFECT_IDS, *STRANGER_IDS, *pairs()], ids=str)
def test_every_case_is_excited_by_the_size_it_says(what, excited):
    for (name, amplitude, seed), log in excited.items():
        if name == what:
            low, high = {"plain": (0.12, 0.95), "moderate": (0.03, 0.45)}[amplitude]
            low *= 0.4 if name == "backlash" else 1.0  # its gap is kept small
            assert log.ratio > 1.05, (amplitude, seed)
            assert low < log.hidden_rms / log.drive_rms < high, (amplitude, seed)
            assert log.tracking_rms < 0.2, (amplitude, seed)  # the loop holds the machine


def test_recordings_pass_many_cogging_periods_and_slow_and_fast_speeds(excited):
    for (what, _, _), log in excited.items():
        p = dict(log.truth.hidden)
        if what == "cogging" and "position" in log.channels:
            assert np.ptp(log.channels["position"]) * p["cogging"]["periods"] > 7 * 2 * np.pi
        if what == "stribeck_friction" and "velocity" in log.channels:
            speed = np.abs(log.channels["velocity"]) / p["stribeck_friction"]["velocity"]
            assert np.mean((speed > 0.1) & (speed < 1.0)) > 0.03
            assert np.mean(speed > 2.0) > 0.03
        if what == "saturation":
            assert 0.01 < np.mean(np.abs(log.channels["u"]) > p["saturation"]["limit"]) < 0.3


def test_unknown_name_is_refused():
    with pytest.raises(ValueError, match="no such effect"):
        cases("coulomb", [1])
