"""A planned motion through the sensor of a log: counts, their noise, and what is known of the speed."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.design.inverse import Path
from dsd_cli.design.seen import as_logged, as_seen, times_white
from dsd_cli.identify.fit.band import band_of
from dsd_cli.identify.recordings.recording import Recording, prepare
from dsd_cli.identify.recordings.spectrum import SensorNoise
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.signals.log import Array, Log

T, COUNT = 0.001, 2.0 * np.pi / 4096.0
_t = T * np.arange(8000)
WHITE = np.eye(1, 25, 12)[0]


@pytest.fixture(scope="module")
def template() -> Recording:
    """Of an encoder; u is no matter here."""
    position = COUNT * np.round(0.8 * np.sin(2.0 * np.pi * 0.7 * _t) / COUNT)
    log = Log({"t": _t, "u": np.sin(_t), "position": position}, T, "log")
    return prepare(log, ObserverSettings(0.01, 0.01))


def seen(template: Recording, position: Array) -> tuple[Recording, Path]:
    path = Path.of(position, 0.004)
    found = as_seen(template, path, np.zeros(len(position)), 0.0)
    assert found is not None
    return found, path


def test_the_position_is_counted_at_the_samples_of_the_log(template: Recording) -> None:
    found, path = seen(template, 0.5 * np.sin(np.pi * 0.004 * np.arange(1000)))
    (piece,) = found.pieces
    assert piece.sample_time == pytest.approx(T)
    counts = np.diff(piece["position"]) / COUNT
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    np.testing.assert_allclose(piece["position"], np.interp(piece["t"], path.times, path.position), atol=0.51 * COUNT)


def test_counts_that_pass_more_slowly_than_the_band_ends_are_no_white_noise(template: Recording) -> None:
    """At 0.02 rad/s 13 counts pass in a second, a line within 20 Hz, whose power is that of a saw-tooth's harmonics; at
    1 rad/s they are 650 lines away from it."""
    t = 0.004 * np.arange(2000)
    band = band_of(20.0, T)
    crawl, fast = (seen(template, x) for x in (0.02 * t, 0.6 * np.sin(2.0 * t)))
    k = np.arange(1, 8)
    w = 2.0 * np.pi * k * (0.02 / COUNT)
    lines = float(np.sum(0.5 * (COUNT / (np.pi * k) * w**2 * band.gain(w * T * band.step)) ** 2))
    w = 2.0 * np.pi * np.arange(0.01, 80.0, 0.01)
    white = (
        2.0 * T * crawl[0].sensor.noise.scale * T**4 * 0.01 * float(np.sum((w**2 * band.gain(w * T * band.step)) ** 2))
    )
    assert times_white(*crawl, band, WHITE) == pytest.approx(lines / white, rel=0.2)
    assert lines / white > 5.0
    assert times_white(*fast, band, WHITE) < 2.0


def test_in_a_crawl_the_speed_is_known_less_well(template: Recording) -> None:
    t = 0.004 * np.arange(2000)
    crawl, fast = (seen(template, x)[0] for x in (0.02 * t, 0.6 * np.sin(2.0 * t)))
    assert crawl.speed_noise > 0.1 * 0.02
    assert fast.speed_noise < 0.1 * 1.2
    assert np.isfinite(fast.pieces[0]["turning"]).any()


def test_what_has_neither_position_nor_speed_is_not_shown(template: Recording) -> None:
    drifting = replace(template, provenance={"velocity": "reconstructed from u and d_hat"})
    assert as_seen(drifting, Path.of(np.zeros(500), 0.004), np.zeros(500), 0.0) is None


def test_by_a_logged_d_hat_only_its_noise_is_heard(template: Recording) -> None:
    sensor = replace(template.sensor, noise=SensorNoise("d_hat", 0.9, 4.0))
    logged = replace(template, sensor=sensor)
    path = Path.of(0.6 * np.sin(0.008 * np.arange(2000)), 0.004)
    assert as_seen(logged, path, np.zeros(2000), 0.0) is None
    (piece,) = as_logged(logged, path, np.zeros(2000), 0.0).pieces
    off = piece["acceleration"][2:-2] - np.interp(piece["t"], path.times, path.acceleration)[2:-2]
    # white noise of variance 4 through the inverse of the filter: (1 + p^2) / (1 - p)^2
    assert np.var(off) == pytest.approx(4.0 * (1.0 + 0.81) / 0.01, rel=0.1)


def test_a_logged_speed_is_there_again_though_the_counts_of_a_slow_log_showed_a_quieter_one() -> None:
    """Of the next motion, which is fast, it may be the better of the two."""
    random, quiet = np.random.default_rng(3), COUNT / 100.0
    crawl = 0.02 * _t + 0.01 * np.sin(_t)
    speed = np.gradient(crawl, T) + 0.002 * random.standard_normal(len(_t))
    position = quiet * np.round(crawl / quiet)
    log = prepare(
        Log({"t": _t, "u": np.sin(_t), "position": position, "velocity": speed}, T, "log"), ObserverSettings(0.01, 0.01)
    )
    assert log.provenance["velocity"] == "from position"
    assert log.logged_speed_noise == pytest.approx(0.002, rel=0.1)
    found, _ = seen(log, 0.6 * np.sin(40.0 * 0.004 * np.arange(2000)))
    assert found.provenance["velocity"] in ("smoothed", "logged")
