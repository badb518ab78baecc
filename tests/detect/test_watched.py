"""What is remembered of a detection for its picture: against brute force, in memory that does not grow."""

import random
from itertools import pairwise

import numpy as np
import pytest

from dsd_cli.cli.labelling import cleaner_for
from dsd_cli.cli.plan import detection_plan
from dsd_cli.cli.simulate import simulation_settings
from dsd_cli.detect.session import Session
from dsd_cli.detect.tracks import COLUMNS, COLUMNS_OF_LINES, Means, Onward, Track
from dsd_cli.detect.watched import WatchedSession
from dsd_cli.files.template import load_template
from dsd_cli.plant.simulation import simulate


def test_a_track_of_any_length_keeps_its_peaks_evenly() -> None:
    """Chunks of any size: every column of 2^k rows has its lowest and its highest value, the first as the last."""
    track, draw, n = Track(), random.Random(1), 300_007
    x = [draw.gauss(0.0, 1.0) for _ in range(n)]
    gap = range(120_000, 121_000)
    for k in gap:
        x[k] = float("nan")
    begin = 0
    while begin < n:
        end = min(begin + draw.randrange(1, 9_000), n)
        track.add(np.arange(begin, end, dtype=float), np.array(x[begin:end]))
        begin = end
    t, shown = track.line()
    assert t.size <= 2 * COLUMNS_OF_LINES + 10
    assert (np.diff(t) > 0.0).all()
    assert np.isnan(shown[(t >= gap[0]) & (t <= gap[-1])]).all()
    assert np.isnan(shown).sum() >= 10
    rows = 32
    kept = dict(zip(t.tolist(), shown.tolist(), strict=True))
    for begin in range(0, n - rows, rows):
        part = {k: x[k] for k in range(begin, begin + rows) if k not in gap}
        if len(part) == rows:
            assert kept[min(part, key=part.get)] == min(part.values())
            assert kept[max(part, key=part.get)] == max(part.values())


def test_a_short_track_is_as_it_was_and_an_interruption_breaks_it() -> None:
    track = Track()
    track.interrupt()
    track.add(np.arange(3.0), np.array([1.0, 2.0, 1.0]))
    track.interrupt()
    track.add(np.arange(2.0, 4.0), np.array([5.0, 6.0]))
    t, x = track.line()
    assert t.tolist() == [0.0, 1.0, 2.0, 2.0, 2.0, 3.0]
    assert np.array_equal(x, [1.0, 2.0, 1.0, np.nan, 5.0, 6.0], equal_nan=True)


@pytest.mark.parametrize("n", [1, 7, 2 * COLUMNS, 2 * COLUMNS + 1, 50_003])
def test_means_over_columns_are_those_of_plain_loops(n: int) -> None:
    draw = random.Random(n)
    x, means, begin = [draw.random() for _ in range(n)], Means(1), 0
    while begin < n:
        size = draw.randrange(1, 4_000)
        part = x[begin : begin + size]
        means.add(np.arange(begin, begin + len(part), dtype=float), np.array(part)[:, None])
        begin += size
    times, found = means.columns()
    edges = [*(int(t) for t in times), n]
    assert edges[0] == 0
    assert len(set(np.diff(edges[:-1]).tolist())) <= 1
    expected = [sum(x[a:b]) / (b - a) for a, b in pairwise(edges)]
    assert found[:, 0].tolist() == pytest.approx(expected)
    assert times.size <= 2 * COLUMNS + 1


def test_stamps_that_begin_anew_go_on() -> None:
    onward = Onward()
    assert onward.placed(np.array([5.0, 6.0])).tolist() == [5.0, 6.0]
    assert onward.placed(np.array([7.0, 8.0])).tolist() == [7.0, 8.0]
    assert onward.placed(np.array([0.0, 1.0])).tolist() == [8.0, 9.0]
    assert onward.restarts == [8.0]


@pytest.mark.parametrize("method", ["dsd", "imm", "viterbi", "profile"])
def test_the_prediction_and_the_likelihoods_are_those_of_brute_force(method: str) -> None:
    """d_hat of the chosen state is (Jn/J) u(t - L) - u(t) through Q, by a loop over samples and states."""
    config = load_template("paper-sine").override(["simulate.duration=1.5", f'detector.method="{method}"'])
    log = simulate(simulation_settings(config))
    plan = detection_plan(config, {name: name for name in log.channels}, {}, "a.csv")
    watched, plain = (kind(plan, cleaner_for(config, plan)) for kind in (WatchedSession, Session))
    values = {name: log[name] for name in ("u", "d_hat")}
    rows = [*watched.feed(log["t"], values), *watched.finish()]
    same = [*plain.feed(log["t"], values), *plain.finish()]
    state = np.concatenate([part.state for part in rows])
    assert np.array_equal(state, np.concatenate([part.state for part in same]))
    for part in rows:
        watched.watch(part, {})
    seen = watched.seen()
    predicted = brute_force(log["u"], state, plan.grid)
    t, shown = seen.lines["predicted"]
    assert np.array_equal(t, log["t"])
    known = np.isfinite(shown)
    assert known.sum() > 900
    np.testing.assert_allclose(shown[known], predicted[known], atol=1e-6)
    np.testing.assert_allclose(seen.lines["unexplained"][1][known], (log["d_hat"] - predicted)[known], atol=1e-6)
    assert np.array_equal(seen.lines["delay"][1], plan.grid.axes["delay"][state])
    likely = seen.likelihoods[1]
    np.testing.assert_allclose(likely[np.isfinite(likely[:, 0])].sum(axis=1), 1.0)
    assert np.nanargmax(likely[-1]) == plan.grid.index(delay=0.3, inertia=1.0)


def brute_force(u: np.ndarray, state: np.ndarray, grid: object) -> np.ndarray:
    """Q { (1/J) u(t - L) } - Q { u } for each state, Q of 0.01 s at 1 ms, u before the log held."""
    pole, paths = float(np.exp(-0.1)), []
    for delay, inertia in zip(grid.axes["delay"], grid.axes["inertia"], strict=True):
        taps, z, w, path = round(delay / 1e-3), u[0], u[0], []
        for k in range(len(u)):
            z = pole * z + (1.0 - pole) * u[max(k - 1 - taps, 0)]
            w = pole * w + (1.0 - pole) * u[max(k - 1, 0)]
            path.append(z / inertia - w)
        paths.append(path)
    return np.array(paths)[state, np.arange(len(u))]
