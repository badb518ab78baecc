"""Rectangular pulses that something pushed: found where they are, and none in noise."""

import numpy as np
import pytest

from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.search.pulses import _apart, _strongest, sharpened, with_pulses
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import Log
from tests.identify.outside_rig import diagnosed
from tests.identify.search_rig import BELIEVED, OBSERVER, T, posed


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
def test_pulses_in_a_residual_are_found_to_within_two_rows(seed):
    x, truth = _planted(seed, level=6.0, signs=(1.0, -1.0, 1.0))
    found = sorted(_strongest(x))
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
    for a, b, level in _strongest(x):
        added[a : b + 1] += level
    steps = {edge for start, end, _ in truth for edge in (start, end)}
    away = np.array([all(abs(k - edge) > 2 for edge in steps) for k in range(len(x))])
    assert np.abs(added - wanted)[away].max() < 2.0
    assert np.sqrt(np.mean((added - wanted)[away] ** 2)) < 0.5


def test_noise_alone_shows_no_pulse_in_any_of_many_seeds():
    assert [seed for seed in range(200) if _strongest(np.random.default_rng(seed).normal(size=5000))] == []


def test_an_offset_is_no_pulse():
    for seed in range(20):
        assert _strongest(np.random.default_rng(seed).normal(size=4000) + 7.0) == []


def test_no_more_than_a_handful_are_taken():
    x, _ = _planted(1, rows=12_000, level=8.0, pulses=12)
    assert len(_strongest(x)) <= POLICY.most_pulses


def test_windows_that_overlap_are_cut_at_each_others_edges():
    assert _apart([(0.0, 4.0), (1.0, 2.0)]) == ((0.0, 1.0), (1.0, 2.0), (2.0, 4.0))
    assert _apart([(0.0, 1.0), (3.0, 4.0)]) == ((0.0, 1.0), (3.0, 4.0))
    assert _apart([]) == ()


PUSHES = [{"start": 3.0, "end": 4.1, "force": 0.3}, {"start": 7.0, "end": 7.6, "force": -0.2}]
NOISE = 0.002  # rad/s


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
    velocity = np.concatenate([[0.0], np.cumsum((drive + force)[:-1]) * T / J]) + NOISE * rng.normal(size=rows)
    recording = prepare(Log({"t": t, "u": u, "velocity": velocity}, T, "log.csv"), OBSERVER)
    return Search(pose([recording], BELIEVED, Settings(effects=("external_force",))))


def test_pulses_of_a_simulated_push_come_back_with_their_times_and_forces(pushed):
    fit = sharpened(pushed, with_pulses(pushed, pushed.refit))
    events = pushed.problem.scale.model(fit).effects["external_force"]["events"]
    assert len(events) == len(PUSHES)
    for event, push in zip(sorted(events, key=lambda e: e["start"]), PUSHES, strict=True):
        assert event["start"] == pytest.approx(push["start"], abs=2.0 * T)
        assert event["end"] == pytest.approx(push["end"], abs=2.0 * T)
        assert event["force"] == pytest.approx(push["force"], rel=0.05)
    assert fit.loss < 0.5 * pushed.refit.loss
    assert pushed.evidence(fit) > pushed.evidence(pushed.refit)


def test_beside_pulses_the_inertia_is_that_of_the_axis(pushed):
    fit = sharpened(pushed, with_pulses(pushed, pushed.refit))
    assert pushed.problem.scale.model(fit).inertia == pytest.approx(BELIEVED.inertia, rel=0.01)
    assert pushed.problem.scale.model(fit).delay == pytest.approx(BELIEVED.delay, abs=2e-4)


def test_a_log_without_pushes_has_no_pulses():
    found = [posed(seed=seed, duration=5.0) for seed in range(6)]
    assert [with_pulses(search, search.refit) for search in found] == [None] * 6


def test_every_edge_has_its_price(pushed):
    fit = sharpened(pushed, with_pulses(pushed, pushed.refit))
    (term,) = fit.terms
    one = type(term).of(term.id, {"edges": term.shape["edges"][:1]})
    assert pushed.price(fit.terms) > pushed.price((one,)) + 10.0


def test_a_level_is_that_of_all_rows_in_every_fold(pushed):
    """The fold that did not see a push cannot know it, and is not to be punished for it."""
    fit = sharpened(pushed, with_pulses(pushed, pushed.refit))
    at = fit.columns_of(fit.terms[0])
    np.testing.assert_array_equal(fit.folds[:, at], np.tile(fit.total[at], (len(fit.folds), 1)))


def test_rows_that_are_not_sure_show_no_pulse_of_their_own():
    """12 seeds: a lean of 20 standard deviations there is none; a push that reaches beyond them keeps its level."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        x, sure = rng.normal(size=4000), np.ones(4000, dtype=bool)
        x[1000:1080] += 20.0
        sure[1000:1080] = False
        assert _strongest(x, sure) == [], f"seed {seed}"
        x[3000:3200] += 5.0
        x[3050:3090] -= 20.0
        sure[3050:3090] = False
        ((a, b, level),) = _strongest(x, sure)
        assert abs(a - 3000) <= 2
        assert abs(b - 3199) <= 2
        assert level == pytest.approx(5.0, abs=0.4)


def test_where_no_row_is_sure_there_is_no_pulse():
    x, _ = _planted(0, level=6.0)
    assert _strongest(x, np.zeros(len(x), dtype=bool)) == []


# -- short logs of an outside rig -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "sensing"), [(20004, "speedloud"), (20009, "speed40k")])
def test_a_few_pushes_of_a_short_log_are_no_set_of_laws(seed, sensing):
    """They were presliding friction and a lag (95 %), a spring and load friction, Stribeck friction."""
    found = diagnosed(("external_force",), seed, sensing, 3.0)
    assert (found.verdict, found.found) == ("external_force", ("external_force",))


@pytest.mark.parametrize(
    ("what", "seed", "sensing"),
    [("root_drag", 31064, "speed40k"), ("end_stop", 31065, "enc4096")],
)
def test_a_law_that_no_catalogue_has_is_no_set_of_pushes(what, seed, sensing):
    """Six pushes explain more of it than any effects do, and leave far more than the sensor."""
    assert diagnosed((what,), seed, sensing, 3.0).verdict != "external_force"


def test_a_trial_at_rest_has_no_pulses():
    """Nothing is left of it."""
    assert _strongest(np.zeros(400)) == []
    assert _strongest(np.zeros(400), np.arange(400) < 30) == []
