"""Velocity against position: units, signs, lateness; wraps; counts; degrees."""

import re

import numpy as np
import pytest

from dsd_cli.identify.checks import check_log
from dsd_cli.identify.checks.channels import in_one
from dsd_cli.identify.checks.results import Finding
from dsd_cli.signals.log import Log
from tests.identify.checks.rig import log_of, model_of, observer_of, only_error, recordings, said, servo

DEGREE, TURN = np.pi / 180.0, 2.0 * np.pi
#: (what the file's unit is of one SI unit for velocity and for position, remedies).
UNITS = {
    "deg/s": ((1.0 / DEGREE, 1.0), ["signals.velocity_scale = 0.0174533"]),
    "rpm": ((60.0 / TURN, 1.0), ["signals.velocity_scale = 0.10472"]),
    "turns/s": ((1.0 / TURN, 1.0), ["signals.velocity_scale = 6.28319"]),
    "degrees": ((1.0, 1.0 / DEGREE), ["signals.position_scale = 0.0174533"]),
    "turns": ((1.0, 1.0 / TURN), ["signals.position_scale = 6.28319"]),
    "mm": ((1.0, 1000.0), ["signals.position_scale = 0.001"]),
    "mm/s": ((1000.0, 1.0), ["signals.velocity_scale = 0.001"]),
    "rpm and degrees": (
        (60.0 / TURN, 1.0 / DEGREE),
        ["signals.velocity_scale = 0.10472", "signals.position_scale = 0.0174533"],
    ),
}


@pytest.mark.parametrize("unit", UNITS)
def test_the_unit_is_named(unit):
    (v, q), remedies = UNITS[unit]
    c = servo("velocity").channels
    result = check_log(log_of(servo("velocity"), velocity=v * c["velocity"], position=q * c["position"]))
    assert [one.remedy for one in result.errors] == remedies


def test_factors_that_are_in_already_are_part_of_the_remedy():
    c = servo("velocity").channels
    turned = log_of(servo("velocity"), velocity=-c["velocity"])
    assert only_error(check_log(turned, factors={"velocity": 0.5})).remedy == "signals.velocity_scale = -0.5"


RAD = np.pi / 180.0


@pytest.mark.parametrize(
    ("factors", "key"),
    [
        ({"position": RAD}, "position_unit"),
        ({"velocity": RAD}, "velocity_unit"),
        ({"velocity": np.pi / 30.0}, "velocity"),
    ],
    ids=["position deg", "velocity deg/s", "velocity rpm"],
)
@pytest.mark.parametrize("witness", ["d_hat", "model", "none"])
def test_a_factor_that_the_config_has_too_much_is_to_be_left_out(factors, key, witness):
    """The columns are in rad and rad/s: d_hat, or the believed inertia, tells which of them is right."""
    c, right = servo("all").channels, servo("all")
    log = log_of(right, **{name: factor * c[name] for name, factor in factors.items()})
    if witness != "d_hat":
        log = log_of(right, d_hat=None, **{name: factor * c[name] for name, factor in factors.items()})
    error = only_error(
        check_log(log, model_of(right) if witness == "model" else None, observer_of(right), factors=factors)
    )
    assert error.remedy.startswith(f"leave out signals.{key}")
    assert ("or the other one has another unit" in error.remedy) == (witness == "none")


@pytest.mark.parametrize("witness", ["d_hat", "model"])
def test_a_factor_that_the_config_lacks_is_named_beside_one_that_it_has(witness):
    """Degrees and degrees per second, and only the position's unit is named."""
    right = servo("all")
    log = log_of(right, velocity=right.channels["velocity"] / RAD, **({} if witness == "d_hat" else {"d_hat": None}))
    model = model_of(right) if witness == "model" else None
    error = only_error(check_log(log, model, observer_of(right), factors={"position": RAD}))
    assert error.remedy == "signals.velocity_scale = 0.0174533"


def test_a_factor_that_is_no_unit_is_said_as_it_is():
    c = servo("velocity").channels
    result = check_log(log_of(servo("velocity"), velocity=1.25 * c["velocity"]))
    (one,) = said(result, "times the slope")
    assert one.severity == "warning"
    assert one.remedy == "signals.velocity_scale = 0.8, or the position is wrong by as much"


def test_right_channels_are_left_alone():
    for recording in recordings("motion"):
        assert [one.what for one in check_log(log_of(recording, d_hat=None)).findings if one.severity != "note"] == []


@pytest.mark.parametrize("tau", [0.004, 0.02])
def test_a_filtered_velocity_is_late_by_its_time_constant(tau):
    c = servo("velocity").channels
    p, late, state = np.exp(-0.001 / tau), np.empty_like(c["velocity"]), 0.0
    for k, v in enumerate(c["velocity"]):
        state = p * state + (1.0 - p) * v
        late[k] = state
    (one,) = said(check_log(log_of(servo("velocity"), velocity=late)), "later than the slope")
    assert one.severity == "warning"
    assert one.remedy.startswith('signals.velocity = ""')
    assert float(one.what.split()[2]) == pytest.approx(1e3 * tau, rel=0.15)  # ms


def test_a_backward_difference_is_not_late():
    position = servo("velocity").channels["position"]
    velocity = np.diff(position, prepend=position[:1]) / 0.001
    assert said(check_log(log_of(servo("velocity"), velocity=velocity)), "later") == []


@pytest.mark.parametrize("turn", [2.0 * np.pi, 360.0, 4096.0])
def test_wraps_are_found_and_undone_for_the_other_checks(turn):
    c = servo("position").channels
    q = c["position"] / (2.0 * np.pi) * turn * 3.0
    result = check_log(log_of(servo("position"), position=np.mod(q, turn)))
    (wraps,) = said(result, "wraps")
    assert wraps.what.startswith(f"position wraps: it jumps by {turn:.6g}")
    assert wraps.severity == "note"
    assert result.errors == ()
    assert result.band_hz == pytest.approx(check_log(log_of(servo("position"), position=q)).band_hz, rel=0.2)


def test_a_new_zero_and_single_wrong_positions_are_said():
    q = servo("position").channels["position"].copy()
    q[3000:] += 0.5
    q[[700, 4000]] += [30.0, -12.0]
    result = check_log(log_of(servo("position"), position=q))
    (jump,) = said(result, "position jumps")
    assert "1 time(s) as no axis can, first in sample 3000" in jump.what
    (wrong,) = said(result, "off by themselves")
    assert wrong.what.startswith("2 position(s) are off by themselves, first in sample 700")


def test_counts_and_degrees_are_seen_without_a_velocity():
    q = servo("position").channels["position"] / (2.0 * np.pi)
    counts = check_log(log_of(servo("position"), position=np.rint(q * 65536.0)))
    (one,) = said(counts, "whole numbers")
    assert one.remedy == "signals.position_scale = 6.28319 / counts per turn"
    degrees = check_log(log_of(servo("position"), position=np.rint(q * 65536.0) * (360.0 / 65536.0)))
    assert [one.remedy for one in said(degrees, "in degrees")] == ["signals.position_scale = 0.0174533"]
    radians = check_log(log_of(servo("position"), position=np.rint(q * 65536.0) * (2.0 * np.pi / 65536.0)))
    assert said(radians, "in degrees") == []
    assert "65536 per turn" in said(radians, "steps of")[0].what


def test_a_velocity_that_is_another_signal_is_said():
    rng = np.random.default_rng(0)
    other = np.convolve(rng.normal(size=len(servo("velocity").channels["u"])), np.ones(50) / 50.0, "same")
    result = check_log(log_of(servo("velocity"), velocity=other))
    assert said(result, "not the slope of position")[0].severity == "error"


@pytest.mark.parametrize(("hz", "growth"), [(27.9, 0.36), (63.0, 0.0)])
def test_an_axis_that_swings_at_one_frequency_has_the_sign_it_has(hz, growth):
    """Half a period later both agree as well, with the other sign: an unstable loop was "velocity_scale = -1". Beyond
    the band of the comparison nothing is left to compare: "velocity is not the slope of position" was said."""
    t = 0.001 * np.arange(18_000)
    w, size = 2.0 * np.pi * hz, np.exp(growth * t)
    velocity = w * size * np.cos(w * t) + np.random.default_rng(1).normal(size=t.size)
    log = Log({"t": t, "u": -size * np.cos(w * t), "position": size * np.sin(w * t), "velocity": velocity}, 0.001, "x")
    assert [one.what for one in check_log(log).findings if "slope" in one.what] == []


def test_a_tone_with_the_other_sign_is_still_said():
    t = 0.001 * np.arange(12_000)
    position = (1.0 + 0.3 * np.sin(0.9 * t)) * np.sin(2.0 * np.pi * 14.0 * t)
    log = Log({"t": t, "u": -position, "position": position, "velocity": -np.gradient(position, 0.001)}, 0.001, "x")
    (one,) = said(check_log(log), "other sign than the slope")
    assert one.remedy.startswith("signals.velocity_scale = -1")


ONE_WAY = {
    "ramp": lambda t: 0.5 * t,
    "run-up": lambda t: 3.0 * (1.0 - np.exp(-np.maximum(t - 0.5, 0.0))),
    "trapezoid": lambda t: np.clip(np.minimum(2.0 * (t - 1.0), 2.0 * (9.0 - t)), 0.0, 4.0),
    "turning with a ripple": lambda t: 3.0 + 0.05 * np.sin(132.0 * t),
}


@pytest.mark.parametrize("late", [0.0, 0.014])
@pytest.mark.parametrize("turning", ONE_WAY)
def test_a_velocity_of_an_axis_that_turns_one_way_is_as_late_as_it_is(turning, late):
    """Its displacement has the sign and the factor; in a ramp a lag and an offset of the velocity are one: nothing is
    said: "position is 42.8 ms later". Of a run-up 14 ms were unsaid, of a ripple "the other sign" was."""
    t, rng = 0.002 * np.arange(5000), np.random.default_rng(0)
    position, velocity = np.cumsum(ONE_WAY[turning](t)) * 0.002, ONE_WAY[turning](t + 0.001 - late)
    channels = {"t": t, "u": rng.normal(size=t.size), "velocity": velocity, "position": position}
    slope = [one for one in check_log(Log(channels, 0.002, "x")).findings if "slope" in one.what or "later" in one.what]
    if late == 0.0 or turning == "ramp":
        assert [one.what for one in slope] == []
        return
    (one,) = slope
    assert float(one.what.split()[2]) == pytest.approx(14.0, abs=0.6)  # ms
    assert one.what.startswith("velocity is")


@pytest.mark.parametrize("other", ["velocity", "position"])
def test_the_other_sign_and_another_size_are_one_remedy(other):
    """Neither alone mends a motor's speed in the other direction beside the position behind its gear."""
    c = servo("velocity").channels
    turned = {name: -c[name] if name == other else c[name] for name in ("velocity", "position")}
    turned["velocity"] = 80.0 * turned["velocity"]
    error = only_error(check_log(log_of(servo("velocity"), **turned)))
    scales = dict(re.findall(r"signals\.(\w+)_scale = ([-\d.e]+)", error.remedy))
    mended = {name: float(scales.get(name, 1.0)) * values for name, values in turned.items()}
    assert check_log(log_of(servo("velocity"), **mended)).errors == ()


def test_a_size_beside_a_sign_that_nothing_can_tell_is_two_findings():
    """A symmetric motion with a velocity in rpm ended with an IndexError: the finding about its sign turns nothing."""
    sized = Finding("velocity is in rpm", "velocity", "error", 0.9, multiply=(("velocity", 0.1),), ratio=9.55)
    doubt = Finding(
        "like any sine, this motion cannot say which", "u", "warning", 0.9, "record other moves", first=True
    )
    turned = Finding("velocity has the other sign", "velocity", "error", 0.9, multiply=(("velocity", -1.0),))
    assert in_one([sized], [doubt]) == [sized, doubt]
    (both,) = in_one([sized], [turned])
    assert both.multiply == (("velocity", 0.1), ("velocity", -1.0))
