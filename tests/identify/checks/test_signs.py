"""Whose sign is wrong: on logs of the independent machines, right ones and ones with a channel turned."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.identify.checks import check_log, to_mend_first
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from tests.identify.checks.rig import checked, log_of, observer_of, only_error, recordings, said, servo
from tests.oracle import machines
from tests.oracle.machine_cases import cases
from tests.oracle.rig import RigCase, make

SERVO = Path(__file__).parents[3] / "sample_logs" / "servo-friction.csv"
KINDS = ("motion", "coarse", "dominated")


@pytest.mark.parametrize("kind", KINDS)
def test_a_right_log_is_never_called_wrong(kind):
    for recording in recordings(kind):
        result = checked(recording)
        hidden = [name for name, _ in recording.truth.hidden]
        assert result.errors == (), (hidden, recording.truth.channels)
        assert to_mend_first(result) == ()


@pytest.mark.parametrize("kind", KINDS)
def test_a_turned_u_is_always_said(kind):
    """Friction and weight that are most of u among them."""
    for recording in recordings(kind):
        u = recording.channels["u"]
        error = only_error(check_log(log_of(recording, u=-u, d_hat=None)))
        hidden = [name for name, _ in recording.truth.hidden]
        assert (error.channel, error.remedy) == ("u", "signals.u_sign = -1"), (hidden, recording.truth.channels)


def test_a_sign_that_the_config_turned_is_turned_back():
    turned = log_of(servo("position"), u=-servo("position").channels["u"])
    assert only_error(check_log(turned, factors={"u": -1.0})).remedy == "signals.u_sign = 1"


def test_a_turned_u_is_told_from_a_turned_d_hat_and_a_turned_motion():
    c = servo().channels
    assert only_error(checked(servo(), u=-c["u"])).remedy == "signals.u_sign = -1"
    assert only_error(checked(servo(), d_hat=-c["d_hat"])).remedy == "observer.sign = -1"
    both = only_error(checked(servo(), velocity=-c["velocity"], position=-c["position"]))
    assert both.remedy == "signals.velocity_scale = -1 and signals.position_scale = -1"


def test_observer_sign_is_part_of_the_bargain():
    recording = servo()
    turned = log_of(recording, d_hat=-recording.channels["d_hat"])
    minus = replace(observer_of(recording), sign=-1)
    assert check_log(turned, None, minus).errors == ()
    assert only_error(check_log(log_of(recording), None, minus)).remedy == "observer.sign = 1"


@pytest.mark.parametrize("channel", ["velocity", "position"])
def test_the_one_of_velocity_and_position_that_contradicts_u_is_named(channel):
    recording = servo("velocity")
    error = only_error(check_log(log_of(recording, **{channel: -recording.channels[channel]})))
    assert error.remedy == f"signals.{channel}_scale = -1"


def test_d_hat_and_u_alone_tell_a_wrong_sign_where_the_delay_is_long_enough():
    right = machines.run(cases("none", range(40, 52), sensing="d_hat", duration=5.0))
    told = 0
    for recording in right:
        c = recording.channels
        assert checked(recording).errors == ()
        for turned in ({"u": -c["u"]}, {"d_hat": -c["d_hat"]}):
            errors = checked(recording, **turned).errors
            told += len(errors)
            assert all("observer.sign = -1, or signals.u_sign = -1" in one.remedy for one in errors)
    assert told >= 12  # of 24; the others have a delay of few milliseconds


def test_a_late_sine_is_no_turned_one():
    """Half a period of delay turns a sine round: nothing may be said of it."""
    T, t = 0.001, np.arange(6000) * 0.001
    w, late = 2.0 * np.pi * 4.0, 0.125
    u = np.sin(w * t)
    velocity = -np.cos(w * (t - late - 0.5 * T)) / w
    for sign in (1.0, -1.0):
        result = check_log(Log({"t": t, "u": sign * u, "velocity": velocity}, T))
        assert said(result, "sign") == []


#: Motions that come again half a cycle later with the other sign, over their phase.
SYMMETRIC = {
    "sine": np.sin,
    "square": lambda phase: np.where(np.sin(phase) >= 0.0, 1.0, -1.0),
    "two sines": lambda phase: np.sin(phase) + 0.5 * np.sin(3.0 * phase),
}


def _free(u, late, ahead):
    """A free mass of 1 behind a delay, integrated exactly: u is held; `ahead`: the speed is that after the interval."""
    acts = np.concatenate([np.zeros(late), u])[: u.size]
    velocity = np.cumsum(acts) * 0.001
    return velocity if ahead else np.concatenate([[0.0], velocity[:-1]])


def _signs_of(u, velocity):
    t = np.arange(u.size) * 0.001
    return said(check_log(Log({"t": t, "u": u, "velocity": velocity}, 0.001), with_values=False), "other sign")


@pytest.mark.parametrize("name", SYMMETRIC)
def test_a_right_u_of_a_symmetric_motion_is_never_surely_turned(name):
    for rate, late, ahead in ((9.0, 0, True), (9.0, 0, False), (25.0, 60, False), (46.0, 60, False), (75.4, 0, True)):
        u = SYMMETRIC[name](rate * np.arange(3000) * 0.001)
        assert [one.what for one in _signs_of(u, _free(u, late, ahead)) if one.severity == "error"] == [], rate


def test_a_sine_alone_cannot_say_a_sign_and_a_start_from_rest_can():
    """A turned u, and the same u right and half a cycle late, are one log while the axis swings."""
    t = np.arange(6000) * 0.001
    swing = SYMMETRIC["two sines"](8.0 * np.pi * t)
    (open_,) = _signs_of(-swing, _free(swing, 10, False))
    assert (open_.severity, open_.first) == ("warning", True)
    assert "cannot say" in open_.what
    assert "from rest" in open_.remedy
    assert _signs_of(swing, _free(swing, 10, False)) == []
    started = np.concatenate([np.zeros(1000), swing[:5000]])
    assert [one.severity for one in _signs_of(-started, _free(started, 10, False))] == ["error"]
    assert _signs_of(started, _free(started, 10, False)) == []


def test_an_overhauling_load_that_u_brakes_for_a_while_is_no_wrong_sign():
    """Lowering a weight, then lifting it: u holds against the weight throughout."""
    T, J, weight = 0.001, 0.2, 3.0
    t = np.arange(8000) * T
    a = np.where(np.sin(2.0 * np.pi * 0.25 * t) > 0.0, 1.0, -1.0) * (np.sin(2.0 * np.pi * 2.0 * t) ** 2)
    velocity = -np.cumsum(a) * T
    velocity -= velocity.mean() - 0.05
    u = np.concatenate([J * np.diff(velocity) / T, [0.0]]) + weight
    assert check_log(Log({"t": t, "u": u, "velocity": velocity}, T)).errors == ()


@pytest.mark.parametrize(
    ("seed", "begin", "seconds"), [(41012, 5.728, 1.64), (41012, 8.222, 1.71), (51012, 14.44, 2.54)]
)
def test_a_few_moves_against_falling_friction_are_no_wrong_sign(seed, begin, seconds):
    """One or two moves in which friction turns: late by 0.1 s, u looks turned; and it seems to brake throughout."""
    (rig,) = make([RigCase(what=("stribeck_friction",), sensing="speed40k", seed=seed)])
    first = round(begin / rig.sample_time)
    rows = slice(first, first + round(seconds / rig.sample_time))
    part = {name: rig.channels[name][rows] for name in ("t", "u", "velocity", "position")}
    assert said(check_log(Log(part, rig.sample_time)), "sign") == []


def test_a_handful_of_rows_of_d_hat_is_no_witness():
    """Half a second of a short move, mostly braking; a turned u or d_hat is seen in it all the same."""
    columns = np.genfromtxt(SERVO, delimiter=",", names=True)
    observer = ObserverSettings(0.01, 0.005)
    for first, last in ((1000, 1501), (990, 1360), (180, 680)):
        part = {name: columns[name][first:last] for name in ("t", "u", "d_hat", "position")}
        assert said(check_log(Log(part, 0.001), None, observer), "sign") == []
    part = {name: columns[name][1000:1501] for name in ("t", "u", "d_hat", "position")}
    for turned, remedy in (("u", "signals.u_sign = -1"), ("d_hat", "observer.sign = -1")):
        wrong = Log({**part, turned: -part[turned]}, 0.001)
        assert only_error(check_log(wrong, None, observer)).remedy == remedy


def test_a_u_without_its_direction_is_said_before_all_else():
    """The size of a torque, and the 0 to 255 of a bridge whose direction is in another wire."""
    told = 0
    for recording in recordings("motion")[:8]:
        u = recording.channels["u"]
        for sizes in (np.abs(u), np.round(255.0 * np.abs(u) / np.abs(u).max()), -np.abs(u)):
            result = check_log(log_of(recording, u=sizes, d_hat=None))
            if said(result, "is it a magnitude? where is its direction?"):
                told += 1
                assert to_mend_first(result) == (only_error(result),)
    assert told >= 20  # of 24: that of 5 s of pure inertia may be too near to chance


@pytest.mark.parametrize("kind", KINDS)
def test_a_weight_that_holds_u_on_one_side_takes_no_direction_from_it(kind):
    for recording in recordings(kind):
        u = recording.channels["u"]
        for sign in (1.0, -1.0):
            held = log_of(recording, u=u + sign * 1.2 * np.abs(u).max(), d_hat=None)
            assert check_log(held).errors == (), recording.truth.hidden


def test_a_u_of_one_direction_is_no_magnitude():
    """A spindle that is run up and braked: u is of one sign as its friction is, and so is the speed."""
    T = 0.001
    t = T * np.arange(8000)
    velocity = 20.0 + 8.0 * np.sin(2.0 * np.pi * 0.7 * t) + 3.0 * np.sin(2.0 * np.pi * 2.3 * t)
    u = 0.01 * np.gradient(velocity, T) + 0.02 * velocity + 0.5
    for sizes in (u, np.abs(u - u.mean())):
        assert said(check_log(Log({"t": t, "u": sizes, "velocity": velocity}, T)), "magnitude") == []


def test_half_a_second_tells_a_turned_u():
    """The vote on signs asks for u over all delays, which a log this short has only few of."""
    told = 0
    for recording in recordings("motion"):
        short = {name: x[:500] for name, x in recording.channels.items() if name != "d_hat"}
        log = Log(short, recording.truth.sample_time)
        assert said(check_log(log), "sign") == []
        told += len(said(check_log(replace(log, channels={**short, "u": -short["u"]})), "u has the other sign"))
    assert told >= 16  # of 32; without a weight, friction and springs that hide it in half a second


def test_an_inertia_below_zero_in_a_single_move_asks_for_the_sign_of_u():
    """The encoder's own ripple hides the inertia from the vote, which has a tenth of a second to look at."""
    T, n = 0.002, 310
    s = np.linspace(0.0, 1.0, n)
    q = 3.0 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
    u = 0.01 * np.gradient(np.gradient(q, T), T) + 0.02 * np.gradient(q, T)
    t = T * np.arange(n)
    position = 1e-4 * np.round((q + 3e-4 * np.sin(2.0 * np.pi * 40.0 * t)) / 1e-4)
    right, turned = (
        check_log(Log({"t": t, "u": sign * u, "position": position}, T), PlantModel(0.01)) for sign in (1.0, -1.0)
    )
    assert [one for one in right.findings if "u_sign" in one.remedy] == []
    (one,) = to_mend_first(turned)
    assert one.severity == "warning"
    assert one.remedy.startswith("signals.u_sign = -1, or ")
    assert not any("signals.reference" in other.remedy for other in turned.findings)
