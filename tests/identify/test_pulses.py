"""Rectangular pulses that something pushed: found where they are, and none in noise."""

import numpy as np
import pytest

from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.pulses import MOST_PULSES, _strongest, with_pulses
from dsd_cli.identify.verdict.examination import Examination, Settings
from dsd_cli.signals.log import Log
from tests.identify.comparison_rig import BELIEVED, OBSERVER, T, recorded


def _planted(seed, rows=6000, level=1.0, pulses=3, signs=None):
    """Noise of 1 with pulses of |level| well apart; (x, [(first, behind the last, level)])."""
    rng = np.random.default_rng(seed)
    x, room, truth = rng.normal(size=rows), rows // pulses, []
    for i in range(pulses):
        length = int(rng.integers(60, room // 3))
        start = i * room + int(rng.integers(50, room - length - 50))
        sign = float(rng.choice([-1.0, 1.0])) if signs is None else signs[i]
        height = level * sign * rng.uniform(0.8, 1.3)
        x[start : start + length] += height
        truth.append((start, start + length, height))
    return x, truth


@pytest.mark.parametrize("seed", range(12))
def test_pulses_in_a_residual_are_found_to_within_two_samples(seed):
    x, truth = _planted(seed, level=6.0, signs=(1.0, -1.0, 1.0))
    found = sorted(_strongest(x, 100))
    clear = [p for p in found if abs(p[2]) > 3.0]
    assert len(clear) == len(truth)
    for (a, b, level), (start, end, height) in zip(clear, truth, strict=True):
        assert abs(a - start) <= 2
        assert abs(b + 1 - end) <= 2
        assert level == pytest.approx(height, rel=0.15)


@pytest.mark.parametrize("seed", range(40))
def test_what_the_pulses_add_up_to_is_what_was_planted(seed):
    """Pulses of one sign near each other may come as one and what is taken out of it again."""
    x, truth = _planted(seed, level=6.0)
    wanted, added = np.zeros(len(x)), np.zeros(len(x))
    for start, end, height in truth:
        wanted[start:end] += height
    for a, b, level in _strongest(x, 100):
        added[a : b + 1] += level
    steps = {edge for start, end, _ in truth for edge in (start, end)}
    away = np.array([all(abs(k - edge) > 2 for edge in steps) for k in range(len(x))])
    assert np.abs(added - wanted)[away].max() < 2.0
    assert np.sqrt(np.mean((added - wanted)[away] ** 2)) < 0.5


def test_noise_alone_shows_no_pulse_in_any_of_many_seeds():
    assert [seed for seed in range(200) if _strongest(np.random.default_rng(seed).normal(size=5000), 100)] == []


def test_an_offset_is_no_pulse():
    for seed in range(20):
        assert _strongest(np.random.default_rng(seed).normal(size=4000) + 7.0, 100) == []


def test_no_more_than_a_handful_are_taken():
    x, _ = _planted(1, rows=12_000, level=8.0, pulses=12)
    assert len(_strongest(x, 100)) <= MOST_PULSES


PUSHES = [{"start": 3.0, "end": 4.1, "force": 0.3}, {"start": 7.0, "end": 7.6, "force": -0.2}]


@pytest.fixture(scope="module")
def pushed():
    """An axis without friction under a multisine and the pushes, integrated exactly."""
    rng, J, rows = np.random.default_rng(4), BELIEVED.inertia, 6000
    t = T * np.arange(rows)
    u = sum(0.2 * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in (1.7, 3.1, 5.3, 7.9))
    late, whole = 0.5, 1  # the believed delay of 1.5 samples
    held = np.concatenate([np.full(3, u[0]), u])
    drive = (1 - late) * held[3 - whole : 3 - whole + rows] + late * held[2 - whole : 2 - whole + rows]
    force = sum(p["force"] * ((t >= p["start"] - 1e-9) & (t < p["end"] - 1e-9)) for p in PUSHES)
    velocity = np.concatenate([[0.0], np.cumsum((drive + force)[:-1]) * T / J])
    pole, d_hat, state = np.exp(-T / OBSERVER.time_constant), np.zeros(rows), 0.0
    for k in range(1, rows):
        raw = OBSERVER.nominal_inertia * (velocity[k] - velocity[k - 1]) / T - u[k - 1]
        state = pole * state + (1 - pole) * raw
        d_hat[k] = state
    d_hat = d_hat + 0.02 * rng.normal(size=rows)
    recording = prepare(Log({"t": t, "u": u, "velocity": velocity, "d_hat": d_hat}, T, "log.csv"), OBSERVER)
    return Examination([recording], BELIEVED, OBSERVER, Settings(effects=("external_force",)))


def test_pulses_of_a_simulated_push_come_back_with_their_times_and_forces(pushed):
    fit = with_pulses(pushed, pushed.refit)
    assert fit is not None
    events = pushed.scale.model(fit).effects["external_force"]["events"]
    assert len(events) == len(PUSHES)
    for event, push in zip(sorted(events, key=lambda e: e["start"]), PUSHES, strict=True):
        assert event["start"] == pytest.approx(push["start"], abs=2.0 * T)
        assert event["end"] == pytest.approx(push["end"], abs=2.0 * T)
        assert event["force"] == pytest.approx(push["force"], rel=0.05)
    assert fit.loss < 0.5 * pushed.refit.loss
    assert pushed.search.evidence(fit) > pushed.search.evidence(pushed.refit)


def test_a_log_without_pushes_has_no_pulses():
    for seed in range(6):
        exam = Examination([recorded(seed=seed, duration=5.0)], BELIEVED, OBSERVER, Settings())
        assert with_pulses(exam, exam.refit) is None


def test_every_edge_has_its_price(pushed):
    fit = with_pulses(pushed, pushed.refit)
    (term,) = fit.terms
    one = type(term).of(term.id, {"edges": term.shape["edges"][:1]})
    assert pushed.search.price(fit.terms) > pushed.search.price((one,)) + 10.0
