"""A log made ready: where each channel is from, what cannot be had, pieces, signs, and motion out of u and d_hat."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import earlier
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.recordings.sensor import net_force
from dsd_cli.plant.controllers import ControllerSettings, Gains
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.references import Multisine, Trapezoids
from dsd_cli.plant.simulation import Measurement, SimulationSettings, simulate
from dsd_cli.signals.log import Log

T = 0.001
OBSERVER = ObserverSettings(nominal_inertia=0.01, time_constant=0.01)
MODEL = PlantModel(0.01, 0.003, {"coulomb_friction": {"level": 0.1}, "viscous_friction": {"coefficient": 0.01}})
MOVES = Trapezoids(distance=1.5, speed=6.0, acceleration=60.0, dwell=0.4, start=0.3)


def simulated(observer=OBSERVER, reference=MOVES, source="velocity", **noise):
    return simulate(
        SimulationSettings(
            model=MODEL,
            duration=6.0,
            sample_time=T,
            observer=observer,
            controller=ControllerSettings("pd", Gains(9.0, 0.6), "error"),
            reference=reference,
            measurement=Measurement(**noise),
            observe_from=source,
        )
    )


def only(log, *names):
    """As a file has them: its d_hat is logged, unless it is known to come from position."""
    source = "position" if log.d_hat_source == "position" else "logged"
    return Log({name: log[name] for name in ("t", "u", *names)}, log.sample_time, "log.csv", source)


@pytest.fixture(scope="module")
def exact():
    return simulated()


@pytest.fixture(scope="module")
def noisy(exact):
    rng = np.random.default_rng(3)
    levels = {"velocity": 0.01, "position": 1e-4, "d_hat": 0.005}
    loud = {name: exact[name] + level * rng.normal(size=len(exact)) for name, level in levels.items()}
    return Log({**exact.channels, **loud}, T, "log.csv", "velocity")


def test_exact_channels_are_logged_ones(exact):
    found = prepare(only(exact, "d_hat", "velocity", "position"), OBSERVER)
    assert found.provenance["u"] == found.provenance["d_hat"] == found.provenance["position"] == "logged"
    assert found.missing == {}
    assert found.samples == len(exact)
    assert found.sample_time == T
    np.testing.assert_array_equal(found.pieces[0]["u"], exact["u"])
    np.testing.assert_array_equal(found.pieces[0]["d_hat"], exact["d_hat"])


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("velocity",), {"d_hat": "computed from velocity", "position": "integrated from velocity"}),
        (("position",), {"d_hat": "computed from position", "velocity": "from position"}),
        (("velocity", "position"), {"d_hat": "computed from velocity", "velocity": "smoothed", "position": "logged"}),
        (("d_hat", "velocity"), {"d_hat": "logged", "position": "integrated from velocity", "velocity": "smoothed"}),
        (("d_hat",), {"velocity": "reconstructed from u and d_hat"}),
    ],
)
def test_every_channel_says_where_it_is_from(noisy, names, words):
    found = prepare(only(noisy, *names), OBSERVER)
    assert {name: found.provenance[name] for name in words} == words
    assert found.provenance["u"] == "logged"
    for piece in found.pieces:
        assert {"t", "u", "d_hat", "velocity"} <= set(piece.channels)
        assert all(np.isfinite(x).all() for name, x in piece.channels.items() if name != "turning")


@pytest.mark.parametrize("names", [("velocity",), ("position",), ("velocity", "position")])
def test_motion_out_of_noisy_channels_is_the_true_one(noisy, exact, names):
    piece = prepare(only(noisy, *names), OBSERVER).pieces[0]
    error = (piece["velocity"] - exact["velocity"])[60:-60]
    assert np.std(error) < (0.006 if "velocity" in names else 0.02 * np.std(exact["velocity"]))
    drift = (piece["position"] - exact["position"])[60:-60]
    assert np.std(drift) < 2e-4 + 0.002 * np.ptp(exact["position"])


@pytest.mark.parametrize("reference", [MOVES, Multisine((1.7, 3.1, 5.3), 0.3, seed=3, start=0.3)])
def test_speed_out_of_u_and_d_hat_of_an_axis_that_starts_at_rest(reference):
    log = simulated(reference=reference)
    found = prepare(only(log, "d_hat"), OBSERVER)
    piece = found.pieces[0]
    error = piece["velocity"] - log["velocity"]
    assert np.std(error) < 0.02 * np.std(log["velocity"])
    assert abs(error.mean()) < 0.02 * np.std(log["velocity"])
    if "position" in piece:
        moved = log["position"] - log["position"][0]
        assert np.sqrt(np.mean((piece["position"] - piece["position"][0] - moved) ** 2)) < 0.15 * np.std(moved)


def test_speed_out_of_noisy_d_hat_is_right_up_to_its_noise():
    """White noise s on d_hat is tau s / Jn on the speed; smoothing may only lower that."""
    s = 0.002
    log = simulated(d_hat_noise=s, seed=5)
    piece = prepare(only(log, "d_hat"), OBSERVER).pieces[0]
    expected = OBSERVER.time_constant * s / OBSERVER.nominal_inertia
    error = piece["velocity"] - log["velocity"]
    slow = np.polyval(np.polyfit(log["t"], error, 1), log["t"])  # what integrating adds
    assert np.std(error - slow) < 3.0 * expected
    assert np.sqrt(np.mean(error**2)) < 0.05 * np.std(log["velocity"])


def test_a_position_that_would_drift_away_is_missing_and_says_why():
    log = simulated(d_hat_noise=0.3, seed=5)
    found = prepare(only(log, "d_hat"), OBSERVER)
    assert "position" not in found.pieces[0]
    assert "position" not in found.provenance
    assert "position" in found.missing
    assert "drift" in found.missing["position"]


@pytest.mark.parametrize("names", [("d_hat", "velocity", "position"), ("velocity",), ("d_hat",)])
def test_logs_of_the_other_sign_become_those_of_eq_13(names):
    other = replace(OBSERVER, sign=-1)
    log, turned = simulated(), simulated(observer=other)
    np.testing.assert_allclose(turned["d_hat"], -log["d_hat"], atol=1e-9)
    plus, minus = prepare(only(log, *names), OBSERVER), prepare(only(turned, *names), other)
    for name in ("d_hat", "velocity"):
        np.testing.assert_allclose(minus.pieces[0][name], plus.pieces[0][name], atol=1e-6)


def test_net_force_is_what_accelerates(exact):
    force = net_force(prepare(exact, OBSERVER).pieces[0], OBSERVER)
    wanted = [0.01 * (exact["velocity"][k] - exact["velocity"][k - 1]) / T for k in range(1, len(exact))]
    assert force[0] == 0.0
    np.testing.assert_allclose(force[2:], wanted[1:], atol=1e-8 * np.abs(wanted).max())


def test_net_force_from_position_is_a_second_difference():
    log = simulated(source="position")
    force = net_force(prepare(log, OBSERVER).pieces[0], OBSERVER)
    q = log["position"]
    wanted = [0.01 * (q[k] - 2 * q[k - 1] + q[k - 2]) / T**2 for k in range(3, len(q))]
    np.testing.assert_allclose(force[3:], wanted, atol=1e-7 * np.abs(wanted).max())


def test_restarts_make_pieces_and_scraps_are_dropped(exact):
    found = prepare(exact, OBSERVER, restarts=[2000, 2030, 4000])
    assert [len(p) for p in found.pieces] == [2000, 1970, 2000]
    assert found.samples == 5970
    np.testing.assert_array_equal(found.pieces[1]["u"], exact["u"][2030:4000])
    np.testing.assert_array_equal(found.pieces[2]["t"], exact["t"][4000:])


def test_no_motion_leaks_over_a_restart(exact):
    alone = prepare(Log({n: x[3000:] for n, x in only(exact, "velocity").channels.items()}, T), OBSERVER)
    both = prepare(only(exact, "velocity"), OBSERVER, restarts=[3000])
    for name in ("d_hat", "velocity", "position"):
        np.testing.assert_allclose(both.pieces[1][name], alone.pieces[0][name], atol=1e-9)


def test_a_log_without_stamps_gets_them():
    u = np.sin(0.01 * np.arange(500))
    found = prepare(Log({"u": u, "velocity": np.cos(0.01 * np.arange(500))}, T), OBSERVER, restarts=[200])
    np.testing.assert_allclose(found.pieces[1]["t"], T * np.arange(200, 500))


def test_the_rest_speed_is_what_noise_creep_or_the_config_ask_for(exact, noisy):
    found = prepare(exact, OBSERVER)
    assert found.rest_speed == pytest.approx(POLICY.creep_share * np.sqrt(np.mean(exact["velocity"] ** 2)), rel=0.05)
    assert prepare(exact, OBSERVER, rest_speed=0.7).rest_speed == 0.7
    loud = prepare(noisy, OBSERVER).rest_speed
    assert 0.2 * POLICY.rest_deviations * 0.01 < loud < 1.2 * POLICY.rest_deviations * 0.01


@pytest.mark.parametrize(
    ("channels", "said"),
    [({"velocity": np.ones(200)}, "no u"), ({"u": np.ones(200)}, "neither velocity nor position")],
)
def test_what_is_lacking_is_one_line(channels, said):
    with pytest.raises(DataError, match=said) as error:
        prepare(Log(channels, T, "log.csv"), OBSERVER)
    assert str(error.value).startswith("log.csv")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("rows", [0, 1, 49])
def test_too_few_samples_are_an_error(rows):
    log = Log({"u": np.ones(rows), "velocity": np.ones(rows)}, T, "log.csv")
    with pytest.raises(DataError, match=f"{rows} samples"):
        prepare(log, OBSERVER)


@pytest.mark.parametrize("names", [("d_hat", "velocity"), ("d_hat", "velocity", "position")])
@pytest.mark.parametrize(
    ("turned", "said"),
    [
        (("d_hat",), "set observer.sign"),
        (("u",), "u has the other sign"),
        (("velocity", "position"), "velocity or position has the other sign"),
    ],
)
def test_a_wrong_sign_is_seen_and_named(noisy, names, turned, said):
    log = only(noisy, *names)
    wrong = {name: -x if name in turned else x for name, x in log.channels.items()}
    with pytest.raises(DataError, match=said) as error:
        prepare(replace(log, channels=wrong), OBSERVER)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("noise", [0.0, 0.05, 5.0])
def test_right_signs_are_never_refused(exact, noise):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        loud = {n: exact[n] + noise * np.std(exact[n]) * rng.normal(size=len(exact)) for n in ("d_hat", "velocity")}
        log = only(exact, "d_hat", "velocity")
        assert prepare(replace(log, channels={**log.channels, **loud}), OBSERVER).samples == len(log)


def test_jittered_stamps_are_put_onto_a_regular_clock(exact):
    """The motion between the samples is that of the axis, to the accuracy of a spline over its bends."""
    rng = np.random.default_rng(1)
    t, q = exact["t"], exact["position"]
    stamps = t + np.concatenate([[0.0], 0.3 * T * rng.uniform(-1, 1, len(t) - 2), [0.0]])
    fine = np.interp(stamps, t, q)
    found = prepare(Log({"t": stamps, "u": exact["u"], "position": fine}, T, "log.csv"), OBSERVER)
    piece = found.pieces[0]
    np.testing.assert_allclose(np.diff(piece["t"]), found.sample_time, rtol=1e-9)
    assert np.std(piece["position"] - np.interp(piece["t"], t, q)) < 1e-4 * np.std(q)


def test_the_acceleration_is_that_of_the_axis_whatever_is_logged(exact):
    """Slow enough for means over one interval and two to be alike; steps of friction are left out."""
    wanted = np.gradient(exact["velocity"], exact["t"])
    calm = np.abs(np.gradient(wanted, exact["t"])) < 0.05 * np.abs(np.gradient(wanted, exact["t"])).max()
    calm = np.convolve(~calm, np.ones(9), "same") < 0.5
    calm[:300] = False
    for names in (("velocity",), ("position",), ("d_hat",), ("d_hat", "velocity", "position")):
        found = prepare(only(exact, *names), OBSERVER).pieces[0]["acceleration"]
        assert np.sqrt(np.mean((found - wanted)[calm] ** 2)) < 0.03 * np.std(wanted), names


def test_a_held_u_that_acted_earlier_is_its_mean_over_what_was_each_interval():
    rng, step, finer = np.random.default_rng(4), 0.01, 100
    u, t = rng.standard_normal(400), step * np.arange(400)
    recording = prepare(Log({"t": t, "u": u, "velocity": np.sin(3.0 * t)}, step), ObserverSettings(0.1, 0.02))
    (moved,) = earlier(recording, 2.25 * step).pieces
    held = np.repeat(u, finer)[int(2.25 * finer) :]  # between the samples, too
    means = held[: len(moved) * finer].reshape(-1, finer).mean(axis=1)
    np.testing.assert_allclose(moved["u"], means, atol=1e-12)
    np.testing.assert_array_equal(moved["t"], t[: len(moved)])
    assert len(moved) == len(t) - 3
