"""Rows of the balance: means over the weight of the acceleration, by loops and closed forms; the truth leaves noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.fit.band import HALF, band_of
from dsd_cli.identify.fit.bank import Bank, drive
from dsd_cli.identify.fit.blocks import lay_blocks
from dsd_cli.identify.fit.equations import equations_of
from dsd_cli.identify.fit.errors import Errors
from dsd_cli.identify.fit.stretches import MEAN_OF_MIDDLES
from dsd_cli.identify.fit.values import coefficients_of, terms_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.plant.controllers import ControllerSettings, Gains
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.references import Multisine, Trapezoids
from dsd_cli.plant.simulation import Measurement, SimulationSettings, simulate
from dsd_cli.signals.log import Log
from dsd_cli.signals.passes import passed

T, J, STARTUP = 0.002, 0.012, 40
OBSERVER = ObserverSettings(nominal_inertia=0.01, time_constant=0.008)
SINES = Multisine((1.7, 3.1, 5.3, 7.9), 0.4, seed=3)
MOVES = Trapezoids(distance=1.5, speed=6.0, acceleration=60.0, dwell=0.6, start=0.1)
SENSORS = {"velocity": "position", "position": "velocity"}
"""What is measured, and what must not be in the log then."""

APPLIED = {"viscous_friction": {"coefficient": 0.03}, "gravity": {"amplitude": 0.2, "phase": 0.4}}
FRICTION = {"coulomb_friction": {"level": 0.15}, "stribeck_friction": {"excess": 0.1, "velocity": 1.0}}
BY_ROLE = {
    "none": {},
    "applied": APPLIED,
    "command": {"dead_zone": {"width": 0.05}},
    "lag": {"actuator_lag": {"time_constant": 0.006}},
    "load": {"flexible_coupling": {"frequency": 25.0, "load_share": 0.3, "damping": 0.02}},
    "load_friction": {"load_friction": {"coefficient": 0.2}},
    "presliding": {"presliding_friction": {"level": 0.12, "stiffness": 6.0}},
}


def _log(effects, delay, sensor, reference=SINES, duration=4.0, measurement=None):
    """A log that holds u and what this sensor measures, no d_hat."""
    settings = SimulationSettings(
        model=PlantModel(J, delay, effects),
        duration=duration,
        sample_time=T,
        observer=OBSERVER,
        controller=ControllerSettings("pd", Gains(9.0, 0.6), "error"),
        reference=reference,
        measurement=measurement or Measurement(),
    )
    log = simulate(settings)
    kept = {n: x for n, x in log.channels.items() if n not in ("d_hat", SENSORS[sensor])}
    return Log(kept, T, "x")


def _equations(log, startup=STARTUP, hz=None, restarts=()):
    band = None if hz is None else band_of(hz, T)
    return equations_of([prepare(log, OBSERVER, restarts)], startup, band)


def _left(equations, model):
    """(r, u) as rows: drive less columns times coefficients, mixed over the two whole steps of delay by hand."""
    bank, terms = Bank(equations), terms_of(model)
    tap, theta = coefficients_of(model, terms, bank.tap_time)
    rows = bank.design(terms, tap).rows
    return rows[0] - sum(c * x for c, x in zip(theta, rows[1:], strict=True)), rows[0]


def _share(left, whole):
    return math.sqrt(float(np.mean(left**2)) / float(np.mean(whole**2)))


# -- the weight of the acceleration -----------------------------------------------------------------------------------


def _mean_of_middles(x):
    return passed(x, MEAN_OF_MIDDLES, 2)


def _held_mean(u, start, end, delay, weight, parts=400):
    """Mean of a held u(t - delay) from start to end (in samples) under a weight, by brute force."""
    at = start + (np.arange(parts) + 0.5) / parts * (end - start)
    values = np.array([u[min(max(math.floor(x), 0), len(u) - 1)] for x in at - delay / T])
    w = weight((at - start) / (end - start))
    return float(values @ w / w.sum())


def _box(share):
    return np.ones_like(share)


def _hat(share):
    return 1.0 - np.abs(2.0 * share - 1.0)


@pytest.fixture(scope="module", params=SENSORS)
def exact(request):
    return request.param, _equations(_log(APPLIED, 0.0047, request.param, duration=3.0))


@pytest.mark.parametrize("samples", [0.0, 3.0, 2.35, 0.5])
def test_a_held_u_is_its_mean_over_the_interval_however_late(exact, samples):
    _, equations = exact
    (stretch,), (found,) = equations.stretches, drive(equations, (), samples * T)
    u = stretch.log["u"]
    for k in range(20, len(u), 97):
        assert found[k] == pytest.approx(_held_mean(u, k - 1, k, samples * T, _box), abs=2.0 / 400 * np.ptp(u))
        whole, part = math.floor(samples), samples % 1.0
        assert found[k] == pytest.approx((1 - part) * u[k - 1 - whole] + part * u[k - 2 - whole], abs=1e-12)


@pytest.mark.parametrize("samples", [0.0, 3.0])
def test_beside_a_second_difference_u_counts_under_a_hat_over_both_intervals(exact, samples):
    sensor, equations = exact
    (stretch,), (late,) = equations.stretches, drive(equations, (), samples * T)
    found, u = stretch.acting(late, smooth=False, held=False), stretch.log["u"]
    assert stretch.two_intervals is (sensor == "position")
    for k in range(20, len(u) - 1, 97):
        wanted = _held_mean(u, k - 1, k + 1, samples * T, _hat) if sensor == "position" else u[k - 1 - int(samples)]
        assert found[k] == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("samples", [3.0, 2.35, 0.5, 0.0])
def test_a_restless_u_counts_under_the_hat_however_late(samples):
    u = np.random.default_rng(4).normal(size=200)
    channels = {"t": T * np.arange(200), "u": u, "position": np.sin(0.05 * np.arange(200))}
    recording = prepare(Log(channels, T, "x"), OBSERVER)
    equations = equations_of([recording], 5, band_of(125.0, T))
    (stretch,) = equations.stretches
    found = stretch.commanded(u, samples * T, held=False)
    wanted = [_held_mean(u, k - 1, k + 1, samples * T, _hat) for k in range(20, 180)]
    np.testing.assert_allclose(found[20:180], wanted, atol=0.02)


@pytest.mark.parametrize("samples", [3.0, 2.999, 2.35, 0.5, 0.0])
def test_where_friction_holds_no_u_counts_however_late(samples):
    """Each of both intervals by itself: at 2.999 samples a rest that begins or ends there leaves what it does at 3."""
    rng = np.random.default_rng(8)
    u, free = rng.normal(size=200), (rng.random(200) < 0.6).astype(float)
    channels = {"t": T * np.arange(200), "u": u, "position": np.sin(0.05 * np.arange(200))}
    (stretch,) = equations_of([prepare(Log(channels, T, "x"), OBSERVER)], 5, band_of(125.0, T)).stretches
    found = replace(stretch, free=free).commanded(u, samples * T, held=True)
    rising, falling = (
        [0.5 * _held_mean(u, k - 1, k, samples * T, ramp) * free[k] for k in range(20, 181)]
        for ramp in (lambda share: share, lambda share: 1.0 - share)
    )
    np.testing.assert_allclose(found[20:180], np.array(rising[:-1]) + falling[1:], atol=0.02)


@pytest.mark.parametrize("samples", [0.0, 0.4, 3.0, 5.7])
@pytest.mark.parametrize("how", ["measured", "jitter"])
def test_a_u_that_is_not_held_on_the_clock_counts_under_the_hat_however_late(how, samples):
    """A sine of a twentieth of the sample rate, 2000 points under each hat; as a staircase it would lack 0.8 %."""
    w, rng = 2 * math.pi * 0.05 / T, np.random.default_rng(7)
    t = T * np.arange(1500) if how == "measured" else np.cumsum(T * (1.0 + 0.3 * rng.uniform(-1, 1, 1500)))
    log = Log(
        {"t": t, "u": np.sin(w * t), "position": np.sin(9.0 * t)}, T, "x", u_hold={"jitter": "held"}.get(how, "sampled")
    )
    (stretch,) = equations_of([prepare(log, OBSERVER)], 5, band_of(100.0, T)).stretches
    step, found = stretch.log.sample_time, stretch.commanded(stretch.log["u"], samples * stretch.log.sample_time, False)
    offsets = (np.arange(2000) + 0.5) / 1000.0 - 1.0
    at = stretch.log["t"][20:-20, None] - (samples + offsets) * step
    acts = np.sin(w * at) if how == "measured" else np.sin(w * t)[np.searchsorted(t, at, side="right") - 1]
    wanted = acts @ (1.0 - np.abs(offsets)) / 1000.0
    gain = float(found[20:-20] @ wanted) / float(wanted @ wanted)
    assert abs(gain - 1.0) < 0.15 * (w * T) ** 2 / 12.0


def test_the_acceleration_is_the_plain_difference_of_what_was_measured(exact):
    sensor, equations = exact
    (stretch,) = equations.stretches
    x, a = stretch.log[sensor], stretch.acceleration
    for k in range(5, len(x) - 1, 61):
        wanted = (x[k] - x[k - 1]) / T if sensor == "velocity" else (x[k + 1] - 2 * x[k] + x[k - 1]) / T**2
        assert a[k] == pytest.approx(wanted, rel=1e-9, abs=1e-9 * np.abs(a).max())


#: Leading relative errors, as a multiple of w^4 (w: angle per sample), of the mean of four, of the middle of four, and
#: of the mean of three middles; 1.3 leaves room for the next order at an eighth of the sample rate.
OF_MEAN, OF_MIDDLE, OF_MIDDLES, NEXT = 11 / 720, 3 / 128, 1 / 288 - 1 / 1920, 1.3


def _sine(sensor, angle):
    """(stretch of an axis that moves as sin(angle k), its speed as a function of the time in samples)."""
    k = np.arange(600)
    speed = np.sin(angle * k + 0.3)
    position = T * -np.cos(angle * k + 0.3) / angle
    channels = {"t": k * T, "u": np.ones(len(k)), sensor: {"velocity": speed, "position": position}[sensor]}
    (stretch,) = equations_of([prepare(Log(channels, T, "x"), OBSERVER)], STARTUP, band_of(20.0, T)).stretches
    return stretch, k


@pytest.mark.parametrize("share", [1 / 8, 1 / 16, 1 / 32])
@pytest.mark.parametrize("sensor", SENSORS)
def test_smooth_columns_are_means_of_sines_up_to_an_eighth_of_the_sample_rate(sensor, share):
    """Mean over (k-1, k), or under the hat over (k-1, k+1), of sin(w t): a sinc, or its square, times the middle."""
    angle = 2 * math.pi * share
    stretch, k = _sine("velocity", angle)
    stretch = replace(stretch, two_intervals=sensor == "position")
    box = math.sin(angle / 2) / (angle / 2)
    middle = np.sin(angle * (k - 0.5) + 0.3)
    inner = slice(10, -10)
    allowed = NEXT * angle**4
    np.testing.assert_allclose(stretch.mean.velocity[inner], (box * middle)[inner], atol=OF_MEAN * allowed)
    np.testing.assert_allclose(stretch.middle.velocity[inner], middle[inner], atol=OF_MIDDLE * allowed)
    np.testing.assert_allclose(_mean_of_middles(middle)[inner], (box * middle)[inner], atol=OF_MIDDLES * allowed)
    column = _mean_of_middles(stretch.middle.velocity)
    found = stretch.acting(column, smooth=True, held=False)
    wanted = box**2 * np.sin(angle * k + 0.3) if sensor == "position" else box * middle
    orders = OF_MIDDLE + OF_MIDDLES + (OF_MEAN if sensor == "position" else 0.0)
    np.testing.assert_allclose(found[inner], wanted[inner], atol=orders * allowed)


@pytest.mark.parametrize("sensor", SENSORS)
def test_at_an_eighth_of_the_sample_rate_a_column_is_off_by_less_than_two_percent(sensor):
    """And by the midpoint rule, which is what the weights are for, by more than twice that."""
    angle = 2 * math.pi * POLICY.highest_share
    stretch, k = _sine("velocity", angle)
    stretch = replace(stretch, two_intervals=sensor == "position")
    box = math.sin(angle / 2) / (angle / 2)
    power, place = (2, k) if sensor == "position" else (1, k - 0.5)
    wanted = box**power * np.sin(angle * place + 0.3)
    found = stretch.acting(_mean_of_middles(stretch.middle.velocity), smooth=True, held=False)
    assert np.abs(found - wanted)[10:-10].max() < 0.02
    assert np.abs(np.sin(angle * place + 0.3) - wanted)[10:-10].max() > 0.024


# -- the true model leaves nothing but noise --------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0.0, 0.006, 0.0047], ids=["none", "whole", "fraction"])
@pytest.mark.parametrize("role", BY_ROLE)
@pytest.mark.parametrize("sensor", SENSORS)
def test_the_true_model_leaves_nothing_of_an_exact_log(role, delay, sensor):
    equations = _equations(_log(BY_ROLE[role], delay, sensor))
    left, u = _left(equations, PlantModel(J, delay, BY_ROLE[role]))
    allowed = {"load": 2e-2, "load_friction": 4e-3}.get(role, 1e-8 if role in ("none", "command", "lag") else 2e-4)
    if sensor == "position" and delay == 0.0047:
        allowed = max(allowed, 5e-4)  # a second difference weighs what changes within an interval
    assert _share(left, u) < allowed


@pytest.mark.parametrize("sensor", SENSORS)
def test_with_friction_nothing_is_left_but_beside_starts_stops_and_turns(sensor):
    log = _log(FRICTION, 0.0047, sensor, MOVES)
    equations = _equations(log)
    left, u = _left(equations, PlantModel(J, 0.0047, FRICTION))
    (stretch,) = equations.stretches
    v = stretch.log["velocity"]
    slow = np.abs(v) <= 0.05  # rad/s; Stribeck friction of 1 rad/s is steep there, too
    reach = equations.band.half + 3
    clear = np.convolve(slow, np.ones(2 * reach + 1), "same") < 0.5
    rows = equations.of_rows([clear.astype(float)]) > 0.5
    assert rows.mean() > 0.15
    assert _share(left[rows], u) < 2e-3
    assert _share(left[equations.kept], u[equations.kept]) < 2e-2


NOISES = {"velocity": Measurement(velocity_noise=2e-3), "position": Measurement(position_noise=2e-5)}


@pytest.mark.parametrize("role", ["none", "viscous", "command"])
@pytest.mark.parametrize("sensor", SENSORS)
def test_of_noisy_logs_the_true_model_leaves_what_the_sensor_adds(sensor, role):
    """The floor in closed form: the differenced white noise through the taps, variance by variance; mean of 8 logs."""
    effects = {"viscous_friction": {"coefficient": 0.03}} if role == "viscous" else BY_ROLE[role]
    differences, ratios = ([1.0, -1.0] if sensor == "velocity" else [1.0, -2.0, 1.0]), []
    for seed in range(8):
        noise = replace(NOISES[sensor], seed=seed)
        equations = _equations(_log(effects, 0.006, sensor, duration=5.0, measurement=noise))
        left, u = _left(equations, PlantModel(J, 0.006, effects))
        size = noise.velocity_noise / T if sensor == "velocity" else noise.position_noise / T**2
        variance = float(np.sum(np.convolve(equations.band.taps, differences) ** 2))
        ratios.append(float(np.mean(left**2)) / (variance * (J * size) ** 2))
        assert _share(left, u) < 0.1, "else the test would not see the physics"
    assert math.sqrt(np.mean(ratios)) == pytest.approx(1.0, abs=0.1)


# -- rows, stretches, whitening ---------------------------------------------------------------------------------------


def test_rows_are_low_passed_samples_stretch_by_stretch():
    equations = _equations(_log(APPLIED, 0.0, "velocity", duration=4.0), hz=20.0, restarts=[800])
    taps, half, step = equations.band.taps, equations.band.half, equations.band.step
    made, wanted = [], []
    for stretch in equations.stretches:
        x = np.random.default_rng(len(stretch.log)).normal(size=len(stretch.log))
        made.append(x)
        for centre in range(STARTUP + half, len(x) - half, step):
            wanted.append(sum(taps[half + i] * x[centre + i] for i in range(-half, half + 1)))
    assert len(equations.stretches) == 2
    np.testing.assert_allclose(equations.plain(made), wanted, atol=1e-12)
    assert sum(equations.lengths) == len(wanted)
    assert [len(x) for x in equations.by_stretch(np.array(wanted))] == equations.lengths


def test_what_happens_before_the_start_of_a_stretch_is_in_no_row():
    equations = _equations(_log(APPLIED, 0.0, "velocity", duration=3.0), hz=20.0)
    x = np.random.default_rng(1).normal(size=len(equations.stretches[0].log))
    y = np.where(np.arange(len(x)) < STARTUP, 1e9, x)
    np.testing.assert_array_equal(equations.plain([y]), equations.plain([x]))


def test_whitening_is_that_filter_over_the_rows_of_each_stretch():
    equations = _equations(_log(APPLIED, 0.0, "velocity", duration=4.0), hz=20.0, restarts=[800])
    taps = np.cos(0.3 * np.arange(-HALF, HALF + 1)) / (1.0 + np.arange(-HALF, HALF + 1) ** 2)
    white = equations.with_whitening(taps)
    rows = np.random.default_rng(2).normal(size=sum(equations.lengths))
    wanted = []
    for part in equations.by_stretch(rows):
        for k in range(len(part)):
            wanted.append(sum(taps[HALF - i] * part[min(max(k + i, 0), len(part) - 1)] for i in range(-HALF, HALF + 1)))
    np.testing.assert_allclose(white.whitened(rows), wanted, atol=1e-12)
    np.testing.assert_array_equal(equations.whitened(rows), rows)


def test_with_friction_all_forces_count_as_nothing_at_rest_and_without_it_they_do_not():
    equations = _equations(_log(FRICTION, 0.0, "velocity", MOVES))
    (stretch,) = equations.stretches
    raw = np.random.default_rng(0).normal(size=len(stretch.log))
    other = np.where(stretch.free > 0.0, raw, 1e6)
    assert 0.2 < stretch.free.mean() < 0.95
    np.testing.assert_array_equal(equations.acting([other], False, True), equations.acting([raw], False, True))
    assert np.abs(equations.acting([other], False, False)).max() > 1e5


def test_rows_that_are_mostly_rest_do_not_count_and_those_that_slide_do():
    equations = _equations(_log(FRICTION, 0.0, "velocity", MOVES))
    (stretch,) = equations.stretches
    taps, half = equations.band.taps, equations.band.half
    centres = equations.band.centres(STARTUP, len(stretch.log))
    for row in range(0, len(centres), 7):
        share = float(taps @ stretch.free[centres[row] - half : centres[row] + half + 1])
        assert equations.kept[row] == (share > POLICY.least_free)
    v = stretch.log["velocity"]
    sliding = [k for k in range(1, len(v)) if abs(v[k]) > 1.0 and abs(v[k - 1]) > 1.0]
    assert (stretch.free[sliding] == 1.0).all()
    np.testing.assert_array_equal(stretch.sign[sliding], np.sign(v[sliding]))


def test_stretches_too_short_for_a_row_are_left_out():
    log = _log(APPLIED, 0.0, "velocity", duration=3.0)
    both = _equations(log, startup=20, hz=25.0, restarts=[300])
    one = _equations(log, startup=240, hz=25.0, restarts=[300])
    assert [len(s.log) for s in both.stretches] == [300, 1200]
    assert [len(s.log) for s in one.stretches] == [1200]
    assert both.lengths[1] > one.lengths[0]


def test_each_recording_has_its_own_band_whitening_and_rows_as_if_it_were_alone():
    quiet = prepare(_log({}, 0.0, "position"), OBSERVER)
    loud = prepare(_log({}, 0.0, "position", measurement=Measurement(position_noise=1e-4)), OBSERVER)
    alone, both = [equations_of([r], STARTUP) for r in (quiet, loud)], equations_of([quiet, loud], STARTUP)
    assert alone[1].band.hz < alone[0].band.hz == both.band.hz
    assert both.lengths == [*alone[0].lengths, *alone[1].lengths]
    taps = [np.array([k, 1.0, k]) for k in (-0.2, 0.3)]
    taps = [np.pad(x, HALF - 1) for x in taps]
    rows = both.with_whitening(*taps).whitened(both.acceleration())
    one_by_one = [e.with_whitening(x).whitened(e.acceleration()) for e, x in zip(alone, taps, strict=True)]
    np.testing.assert_array_equal(rows, np.concatenate(one_by_one))


def test_a_crawl_has_no_wider_band_than_the_log_that_moves():
    """Noise between 6 and 12 Hz in a log at a hundredth of the speed is no motion that the fast one would not show."""
    fast = prepare(_log(APPLIED, 0.0, "position", measurement=Measurement(position_noise=1e-5)), OBSERVER)
    (piece,) = fast.pieces
    own = equations_of([fast], STARTUP).band.hz
    t = piece["t"]
    q = 1e-2 * (piece["position"] - piece["position"][0]) + 1e-3 * np.sin(2.0 * np.pi * 2.0 * own * t)
    slow = prepare(Log({"t": t, "u": 1e-2 * piece["u"], "position": q}, T, "slow"), OBSERVER)
    assert equations_of([slow], STARTUP).band.hz > 1.5 * own
    assert [b.hz for b in equations_of([slow, fast], STARTUP).bands] == [own, own]


def test_a_jittered_clock_leaves_little_more():
    """Stamps that jitter by a fifth: the motion is a sine of known acceleration, u what a held command needs for it."""
    rng = np.random.default_rng(5)
    t = np.cumsum(T * (1.0 + 0.2 * rng.uniform(-1, 1, 2500)))
    w = 2 * math.pi * 1.3
    v = 3.0 * np.sin(w * t)
    u = J * np.append(np.diff(v) / np.diff(t), 0.0)
    equations = _equations(Log({"t": t, "u": u, "velocity": v}, T, "x"), hz=20.0)
    left, whole = _left(equations, PlantModel(J, 0.0, {}))
    assert np.ptp(np.diff(equations.stretches[0].log["t"])) < 1e-9
    assert _share(left, whole) < 1e-3


def test_the_score_of_the_true_model_is_the_rms_of_what_it_leaves():
    equations = _equations(_log(APPLIED, 0.006, "velocity", measurement=NOISES["velocity"]))
    left, u = _left(equations, PlantModel(J, 0.006, APPLIED))
    bank = Bank(equations)
    score = Errors(bank, lay_blocks(equations.lengths, 5, "x")).of_model(PlantModel(J, 0.006, APPLIED))
    assert score.rmse == pytest.approx(math.sqrt(float(np.mean(left**2))), rel=1e-9)
    assert score.relative_error_percent == pytest.approx(100.0 * _share(left, u), rel=1e-2)
