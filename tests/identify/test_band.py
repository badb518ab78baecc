"""The low-pass has no phase, rows stand at their centres, and the band ends where the sensor's noise begins."""

import math

import numpy as np
import pytest

from dsd_cli.identify.fit.band import HALF, ROWS_PER_BAND_HZ, band_of, chosen_band, passed_variance
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.spectrum import SensorNoise

T = 0.001
BANDS = (4.0, 18.0, 60.0, 125.0)


def _symmetric(rng):
    taps = rng.normal(size=HALF + 1)
    return np.concatenate([taps[:0:-1], taps])


@pytest.mark.parametrize("hz", BANDS)
def test_a_sine_passes_without_phase_at_the_centre_of_its_row(hz):
    band, k = band_of(hz, T), np.arange(8000)
    centres = band.centres(100, len(k))
    for share in (0.1, 0.5, 1.0):
        w = 2 * math.pi * share * hz * T
        gain = sum(h * math.cos(w * (i - band.half)) for i, h in enumerate(band.taps))
        for phase in (0.0, 0.7, 2.0):
            np.testing.assert_allclose(
                band.rows(np.sin(w * k + phase), 100), gain * np.sin(w * centres + phase), atol=1e-9
            )


@pytest.mark.parametrize("hz", BANDS)
def test_within_the_band_all_passes_and_beyond_twice_the_end_nothing(hz):
    """What lies beyond twice its end folds back into the band; between the two it does not."""
    band = band_of(hz, T)
    tones = np.exp(2j * np.pi * np.outer(np.linspace(0.0, 0.5 / T, 4001) * T, np.arange(-band.half, band.half + 1)))
    gain, at = np.abs(tones @ band.taps), np.linspace(0.0, 0.5 / T, 4001)
    assert gain[0] == pytest.approx(1.0)
    assert gain[at <= 0.8 * hz].min() > 0.97
    assert gain[at <= hz].min() > 0.7
    assert gain[at >= 2.1 * hz].max(initial=0.0) < 0.01
    assert 1.0 / (band.step * T) >= ROWS_PER_BAND_HZ * hz * 0.999


def test_the_gain_is_that_of_the_taps_at_angles_of_rows():
    band = band_of(20.0, T)
    angles = band.angles(50)
    assert ((angles > 0.0) & (angles < math.pi)).all()
    for angle, found in zip(angles, band.gain(angles), strict=True):
        response = sum(h * np.exp(1j * angle / band.step * i) for i, h in enumerate(band.taps))
        assert found == pytest.approx(abs(response), abs=1e-12)


def test_rows_reach_neither_before_the_first_nor_beyond_the_last_sample():
    band = band_of(25.0, T)
    for count in (2 * band.half, 2 * band.half + 1, 400, 401, 403):
        x = np.zeros(count + 40)
        x[:40] = np.nan
        rows = band.rows(x, 40)
        assert len(rows) == len(band.centres(40, len(x)))
        assert np.isfinite(rows).all()
    assert len(band.rows(np.ones(10), 0)) == 0


KINDS = {"velocity": [1.0, -1.0], "position": [1.0, -2.0, 1.0], "d_hat": [1.0 / 0.3, -0.7 / 0.3]}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("hz", [18.0, 60.0, 125.0])
@pytest.mark.parametrize("white", [True, False], ids=["plain", "whitened"])
def test_the_variance_of_sensor_noise_in_a_row_is_the_passed_one(kind, hz, white):
    """In closed form: sum of squares of the whole impulse response from the white noise to a row."""
    band, noise = band_of(hz, T), SensorNoise(kind, 0.7, 4.0)
    taps = np.ones(1) if white else _symmetric(np.random.default_rng(3))
    spread = np.zeros((len(taps) - 1) * band.step + 1)
    spread[:: band.step] = taps
    whole = np.convolve(np.convolve(KINDS[kind], band.taps), spread)
    assert passed_variance(taps, band, noise) == pytest.approx(4.0 * float(whole @ whole), rel=0.01)


@pytest.mark.parametrize("kind", KINDS)
def test_and_that_of_noise_made_by_chance(kind):
    """Noise from `made`, through `rows`, some 10,000 rows: the variance is known to 2 % or better."""
    band, noise = band_of(40.0, T), SensorNoise(kind, 0.7, 4.0)
    made = noise.made(100_000, np.random.default_rng(8))
    rows = band.rows(made, 0)
    assert float(np.mean(rows**2)) == pytest.approx(passed_variance(np.ones(1), band, noise), rel=0.05)
    direct = np.convolve(np.random.default_rng(9).normal(size=100_000), KINDS[kind], "valid") * 2.0
    assert float(np.var(direct)) == pytest.approx(float(np.var(made)), rel=0.03)


def _narrow(hz, seed, size=1.0, count=60_000):
    """Noise-like motion without anything above `hz`: the acceleration of 200 sines."""
    rng = np.random.default_rng(seed)
    t = T * np.arange(count)
    return size * sum(
        np.sin(2 * np.pi * f * t + p) for f, p in zip(rng.uniform(0.2, hz, 200), rng.uniform(0, 6.3, 200), strict=True)
    )


@pytest.mark.parametrize("hz", [8.0, 25.0, 60.0])
def test_the_band_ends_where_the_motion_does(hz):
    """The noise there is a thousandth of the motion: 100 (200 sines) over the share of the spectrum that they fill."""
    density = 100.0 / (2 * hz * T)
    bend = 2.0 - 2.0 * math.cos(2 * math.pi * hz * T)
    noise = SensorNoise("position", 0.0, 1e-3 * density / bend**2)
    a = _narrow(hz, 1) + noise.made(60_000, np.random.default_rng(2))
    assert chosen_band([a], noise, T).hz == pytest.approx(hz, rel=0.15)


def test_more_noise_makes_the_band_narrower():
    """White acceleration of density 1 against noise of density s d^2: they are 100 apart where d = 0.1 / sqrt(s)."""
    rng = np.random.default_rng(4)
    motion = rng.normal(size=200_000)
    for scale in (0.5, 5.0, 50.0):
        noise = SensorNoise("position", 0.0, scale)
        angle = math.acos(1.0 - 0.05 / math.sqrt(scale))  # 2 - 2 cos w = 0.1 / sqrt(scale)
        found = chosen_band([motion], noise, T)
        assert found.hz == pytest.approx(angle / (2 * math.pi * T), rel=0.1)


def test_the_band_is_never_wider_than_means_are_exact_nor_narrower_than_a_short_log_allows():
    motion = np.random.default_rng(5).normal(size=20_000)
    assert chosen_band([motion], SensorNoise("velocity", 0.0, 1e-20), T).hz == pytest.approx(POLICY.highest_share / T)
    loud = SensorNoise("velocity", 0.0, 1e20)
    assert chosen_band([motion], loud, T).hz == POLICY.least_band_hz
    assert chosen_band([motion[:3000]], loud, T).hz == pytest.approx(POLICY.least_band_periods / 3.0)


@pytest.mark.parametrize("hz", [2.0, 7.3, 62.0, 125.0])
def test_the_gain_where_frequencies_fold_is_that_of_every_single_one(hz):
    band = band_of(hz, 1e-3)
    angle, folds = band.angles(16), band.folded_gain(16)
    assert folds.shape == (band.step, 16)
    for i, found in enumerate(folds):
        np.testing.assert_allclose(found, band.gain(i * np.pi + (angle if i % 2 == 0 else np.pi - angle)), atol=1e-13)
