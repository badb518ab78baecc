"""Moves, rests, directions, limits; what a sensor shows; what no check can be made of."""

import numpy as np
import pytest

from dsd_cli.identify.checks import check_log
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Log
from tests.identify.checks.rig import COARSE, log_of, only_error, recordings, said, servo
from tests.oracle.machine_motion import reference

T = 0.001


def moving(velocity, u=None):
    t = np.arange(velocity.size) * T
    u = np.gradient(velocity, T) + 0.3 * np.sign(velocity) if u is None else u
    return Log({"t": t, "u": u, "velocity": velocity, "position": np.cumsum(velocity) * T}, T)


def trapezoids(directions, length=0.4, rest=0.2):
    """One move per direction, with rests between them."""
    s = np.linspace(0.0, 1.0, round(length / T))
    move = np.minimum(np.minimum(s, 1.0 - s) * 4.0, 1.0)
    pause = np.zeros(round(rest / T))
    return np.concatenate([np.concatenate([pause, d * move]) for d in directions] + [pause])


def test_moves_are_counted_by_direction_and_rests_are_none():
    did = check_log(moving(trapezoids([1, -1, 1, 1, -1, -1, 1]))).excitation
    assert (did.forward, did.backward) == (4, 3)
    assert did.moving == pytest.approx(7 * 0.4 / (7 * 0.6 + 0.2), abs=0.05)
    assert did.top_speed == pytest.approx(1.0, abs=0.05)
    assert did.travel == pytest.approx(2 * 0.3, rel=0.1)  # 0, 1, 0, 1, 2, 1, 0, 1 moves of 0.3 from the start
    assert did.effects == 2


def test_moves_of_the_machines_are_those_of_their_references():
    """All but the one whose second mass swings: these are moves of their own."""
    for recording in recordings("motion")[:30:6]:
        case = recording.truth
        _, v, _ = reference(case.motion, recording.channels["t"], case.duration, case.seed)
        did = check_log(log_of(recording)).excitation
        assert _runs(v, 0.15) - 1 <= did.stretches <= _runs(v, 0.005) + 1  # one may be cut at the edge of the log


def _runs(v, slowest):
    """Moves of a reference that are faster than this share of the fastest."""
    signs = np.where(np.abs(v) > slowest * np.abs(v).max(), np.sign(v), 0.0)
    return int(np.count_nonzero(signs[np.concatenate([[0], np.flatnonzero(np.diff(signs)) + 1])]))


def test_one_direction_and_few_moves_are_warnings():
    result = check_log(moving(trapezoids([1, 1])))
    assert [one.severity for one in said(result, "one direction only")] == ["warning"]
    assert said(result, "2 moves: too few for an effect")
    assert said(check_log(moving(trapezoids([1, -1] * 4))), "too few") == []


def test_an_axis_at_rest_and_a_constant_u_are_errors():
    c = servo("position").channels
    assert only_error(check_log(log_of(servo("position"), position=np.full(c["u"].size, 1.5)))).channel == "position"
    noise = np.rint(np.random.default_rng(0).normal(size=c["u"].size) * 0.4) * COARSE
    assert check_log(log_of(servo("position"), position=noise)).errors
    assert only_error(check_log(log_of(servo("position"), u=np.ones(c["u"].size)))).what.startswith("u is constant")


def test_a_log_without_a_motion_and_without_d_hat_and_a_short_one():
    c = servo("position").channels
    assert only_error(check_log(Log({"t": c["t"], "u": c["u"]}, T))).what.startswith("neither d_hat")
    short = {name: x[:30] for name, x in c.items()}
    assert "30 samples" in check_log(Log(short, T)).errors[0].what


def test_u_at_its_limit_is_a_note():
    velocity = trapezoids([1, -1] * 4)
    u = np.clip(np.gradient(velocity, T) + 0.3 * np.sign(velocity), -2.0, 2.0)
    (one,) = said(check_log(moving(velocity, u)), "keeps its largest value")
    assert one.severity == "note"
    assert said(check_log(log_of(servo())), "keeps its largest value") == []


def test_the_band_is_where_the_acceleration_stands_above_the_noise():
    """A finer encoder shows more, and the floor is the force that its rounding makes in the band."""
    fine, coarse = servo("position"), {}
    q = fine.channels["position"]
    for counts in (2**12, 2**14, 2**16):
        step = 2.0 * np.pi / counts
        coarse[counts] = check_log(log_of(fine, position=np.rint(q / step) * step))
    bands = [coarse[counts].band_hz for counts in coarse]
    assert bands[0] < bands[1] < bands[2]
    band, error = bands[0], np.rint(q / (2.0 * np.pi / 2**12)) * (2.0 * np.pi / 2**12) - q
    power = np.abs(np.fft.rfft(np.diff(error, 2) / T**2 * np.hanning(len(q) - 2))) ** 2
    hz = np.fft.rfftfreq(len(q) - 2, T)
    size = fine.truth.inertia * np.sqrt(2.0 * np.cumsum(power) / (len(q) - 2) / np.sum(np.hanning(len(q) - 2) ** 2))
    low, high = (float(size[np.searchsorted(hz, width * band)]) for width in (1.0, 2.0))
    assert low < coarse[2**12].floor < high  # the low-pass falls from the end of the band to twice that
    assert "4096 per turn" in said(coarse[2**12], "steps of")[0].what


@pytest.mark.parametrize(("noise", "said"), [(0.0, False), (1e-10, False), (1e-5, True)])
def test_a_noise_that_no_sensor_has_is_none(noise: float, said: bool) -> None:
    """Of a simulation it was said as 3e-12 of a u of 20, which 24 bits do not resolve."""
    t = T * np.arange(3000)
    velocity = np.sin(9.0 * t) + 0.4 * np.sin(31.0 * t)
    position = np.cumsum(velocity) * T + noise * np.random.default_rng(77).standard_normal(t.size)
    log = Log({"t": t, "u": np.gradient(velocity, T), "position": position}, T)
    floor = check_log(log, PlantModel(1.0, 0.0)).floor
    assert (floor is not None) == said


def test_a_position_of_a_few_steps_tells_no_value():
    q = servo("position").channels["position"]
    step = 0.3 * float(np.ptp(q))
    result = check_log(log_of(servo("position"), position=np.rint(q / step) * step))
    assert result.band_hz is None or result.band_hz < 5.0
    assert {one.identified for one in result.parameters} == {"not"}


def test_a_sensor_that_shows_no_acceleration_is_an_error():
    noise = np.random.default_rng(1).normal(size=len(servo("position").channels["u"]))
    assert "no acceleration" in check_log(log_of(servo("position"), position=noise)).errors[0].what


def test_an_inertia_far_from_the_models_is_a_matter_of_units():
    from dsd_cli.plant.model import PlantModel

    wrong = PlantModel(100.0 * servo().truth.inertia, servo().truth.delay)
    (one,) = said(check_log(log_of(servo("velocity")), wrong), "[model] has")
    assert "signals.u_scale" in one.remedy


def test_a_u_that_is_later_than_its_motion_is_said():
    c, late = servo("velocity").channels, 20
    shifted = {name: x[:-late] for name, x in c.items()} | {"u": c["u"][late:]}
    on_time = said(check_log(log_of(servo("velocity"))), "later than the motion")
    early = check_log(Log({**shifted, "u": np.concatenate([np.zeros(late), c["u"][: -2 * late]])}, T))
    (one,) = said(early, "later than the motion")
    assert on_time == []
    expected = late - 1e3 * servo().truth.delay
    assert float(one.what.split()[2]) == pytest.approx(expected, abs=1.5)  # ms
    assert check_log(Log(shifted, T)).errors == ()  # u too early is a delay


def test_of_a_short_log_all_of_the_motion_is_told():
    """A servo's 71 rows: the low-pass had no say of most of them, and what it left moved one way by a twentieth."""
    t = 0.021 * np.arange(71)
    log = Log({"t": t, "u": np.sin(4.0 * t), "position": 0.8 - 0.8 * np.cos(4.0 * t)}, 0.021, "short")
    found = check_log(log).excitation
    assert found.travel == pytest.approx(1.6, rel=0.05)
    assert min(found.forward, found.backward) > 0
