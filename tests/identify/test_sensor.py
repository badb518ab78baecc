"""What the acceleration is measured by: the right mean of the true one, and the quieter of the sensors."""

import numpy as np
import pytest

from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.recordings.sensor import PREFERENCE, with_acceleration
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.signals.log import Log

T, ROWS = 0.001, 6000
OBSERVER = ObserverSettings(nominal_inertia=0.02, time_constant=0.008)
t = T * np.arange(ROWS)
PARTS = ((3.0, 1.3, 0.4), (0.7, 6.1, 2.0), (0.2, 11.0, 1.0))  # rad, Hz, phase


def _motion(order, at=t):
    """The true position (0), speed (1) or acceleration (2)."""
    return sum(a * (2 * np.pi * f) ** order * np.sin(2 * np.pi * f * at + p + order * np.pi / 2) for a, f, p in PARTS)


u = 0.5 * np.sin(2 * np.pi * 1.3 * t) + 0.2 * np.sin(2 * np.pi * 6.1 * t)


def _d_hat(kind):
    """By eq. 13, sample by sample, out of the true motion."""
    q, v, pole, state, found = _motion(0), _motion(1), np.exp(-T / OBSERVER.time_constant), 0.0, np.zeros(ROWS)
    for k in range(1, ROWS):
        if kind == "velocity":
            a = (v[k] - v[k - 1]) / T
        else:
            a = (q[k] - 2.0 * q[k - 1] + q[k - 2]) / T**2 if k > 1 else 0.0
        state = pole * state + (1.0 - pole) * (OBSERVER.nominal_inertia * a - u[k - 1])
        found[k] = state
    return found


def _log(source="logged", **channels):
    return Log({"t": t, "u": u, **channels}, T, "log.csv", source)


MIDDLE = slice(300, -300)  # where a filter that starts from 0 has settled


def test_from_speed_it_is_the_mean_over_the_interval_that_ends_there():
    recording = prepare(_log(velocity=_motion(1)), OBSERVER)
    assert recording.sensor.kind == "velocity"
    assert not recording.sensor.two_intervals
    wanted = (_motion(1) - _motion(1, t - T)) / T
    np.testing.assert_allclose(recording.pieces[0]["acceleration"][1:], wanted[1:], atol=1e-9 * np.abs(wanted).max())


def test_from_position_it_is_a_hat_over_the_two_intervals_beside_the_sample():
    recording = prepare(_log(position=_motion(0)), OBSERVER)
    assert recording.sensor.kind == "position"
    assert recording.sensor.two_intervals
    fine = np.linspace(-1.0, 1.0, 2001)
    hat = (1.0 - np.abs(fine)) / np.sum(1.0 - np.abs(fine))
    wanted = [hat @ _motion(2, t[k] + T * fine) for k in range(1, ROWS - 1, 97)]
    found = recording.pieces[0]["acceleration"][1 : ROWS - 1 : 97]
    np.testing.assert_allclose(found, wanted, atol=1e-6 * np.abs(wanted).max())


@pytest.mark.parametrize("source", ["logged", "position"])
def test_from_d_hat_the_filter_of_the_observer_is_undone(source):
    """Whatever tau and Jn: the acceleration is that of the axis."""
    kind = "position" if source == "position" else "velocity"
    piece = Log({"t": t, "u": u, "d_hat": _d_hat(kind)}, T, "log.csv", source)
    (found,), sensor = with_acceleration([piece], OBSERVER)
    assert sensor.kind == "d_hat"
    assert sensor.two_intervals is (source == "position")
    wanted = _motion(2) if source == "position" else (_motion(1) - _motion(1, t - T)) / T
    np.testing.assert_allclose(
        found["acceleration"][MIDDLE], wanted[MIDDLE], atol=(1e-2 if source == "position" else 1e-6) * np.ptp(wanted)
    )


def test_a_d_hat_that_we_computed_is_no_sensor():
    recording = prepare(_log(velocity=_motion(1), position=_motion(0)), OBSERVER)
    assert recording.provenance["d_hat"].startswith("computed")
    assert recording.sensor.kind != "d_hat"


def _noise_at(kind, size, hz=30.0):
    """Density of the acceleration at that frequency for white noise of that size, by the transfer function."""
    z = np.exp(-2j * np.pi * hz * T)
    return size**2 * abs((1.0 - z) / T) ** (4 if kind == "position" else 2)


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_a_position_is_preferred_until_its_noise_is_far_louder(factor):
    rng, speed_noise = np.random.default_rng(1), 0.05
    ratio = factor * PREFERENCE["position"] / PREFERENCE["velocity"]
    position_noise = speed_noise * np.sqrt(ratio * _noise_at("velocity", 1.0) / _noise_at("position", 1.0))
    log = _log(
        velocity=_motion(1) + speed_noise * rng.normal(size=ROWS),
        position=_motion(0) + position_noise * rng.normal(size=ROWS),
    )
    found = prepare(log, OBSERVER).sensor
    assert found.kind == ("position" if factor < 1.0 else "velocity")


@pytest.mark.parametrize("seed", range(3))
def test_the_noise_of_an_encoder_is_a_twelfth_of_its_step_squared(seed):
    step = 2.0 * np.pi / 4096.0
    place = _motion(0) + np.random.default_rng(seed).uniform(0, step)
    found = prepare(_log(position=step * np.round(place / step)), OBSERVER).sensor
    assert found.noise.scale * T**4 == pytest.approx(step**2 / 12.0, rel=0.15)


def test_the_noise_of_a_speed_is_its_variance_per_step_squared():
    speed = _motion(1) + 0.05 * np.random.default_rng(2).normal(size=ROWS)
    found = prepare(_log(velocity=speed), OBSERVER).sensor
    assert found.noise.scale * T**2 == pytest.approx(0.05**2, rel=0.1)


@pytest.mark.parametrize("tau", [0.001, 0.2])
@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_the_observer_does_not_change_what_we_measure(tau, factor):
    log = _log(position=np.round(_motion(0), 3))
    usual = prepare(log, OBSERVER)
    other = prepare(log, ObserverSettings(factor * OBSERVER.nominal_inertia, tau))
    assert other.sensor.kind == usual.sensor.kind
    assert other.sensor.noise.scale == usual.sensor.noise.scale
    for name in ("acceleration", "velocity", "position"):
        np.testing.assert_array_equal(other.pieces[0][name], usual.pieces[0][name])
    assert other.rest_speed == usual.rest_speed


# -- noise is read where it is: not where a spline took it off, nor where jolts are ----------------------------------


def _jittered(share=0.3):
    return np.cumsum(T * (1.0 + share * np.random.default_rng(8).uniform(-1, 1, ROWS)))


def test_an_encoder_on_irregular_stamps_keeps_its_noise_and_is_smoothed_as_on_regular_ones():
    """A spline takes half off its highest frequencies: read there, the noise seemed small, and a window of five
    samples already too wide, so that the speed was 35 times as loud and a quarter of the log a rest."""
    step, at = 2.0 * np.pi / 8192.0, _jittered()
    regular = prepare(_log(position=step * np.round(_motion(0) / step)), OBSERVER)
    log = Log({"t": at, "u": u, "position": step * np.round(_motion(0, at) / step)}, T, "log.csv")
    found = prepare(log, OBSERVER)
    assert found.sensor.noise.scale * T**4 == pytest.approx(step**2 / 12.0, rel=0.2)
    assert found.speed_noise < 2.0 * regular.speed_noise
    assert found.rest_speed < 2.0 * regular.rest_speed


def test_white_noise_on_irregular_stamps_is_read_as_it_was_logged():
    at, size = _jittered(), 0.05
    log = Log(
        {"t": at, "u": u, "velocity": _motion(1, at) + size * np.random.default_rng(2).normal(size=ROWS)}, T, "log.csv"
    )
    found = prepare(log, OBSERVER).sensor
    assert found.noise.scale * T**2 == pytest.approx(size**2, rel=0.15)
    assert found.sure.scale * T**2 == pytest.approx(size**2, rel=0.15)


def test_jolts_are_no_noise_of_the_sensor():
    """Ten sudden changes of the speed, as a kick makes them, reach as far up as noise does; most samples show none."""
    size, speed = 1e-3, _motion(1)
    for k in range(10):
        speed[300 + 550 * k :] += 0.2 * (-1) ** k
    found = prepare(_log(velocity=speed + size * np.random.default_rng(3).normal(size=ROWS)), OBSERVER).sensor
    assert found.noise.scale * T**2 > 3.0 * size**2
    assert found.sure.scale * T**2 == pytest.approx(size**2, rel=0.2)
