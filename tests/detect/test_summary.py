"""The summary against plain loops over the labels."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.detect import Grid
from dsd_cli.detect import summary as module
from dsd_cli.detect.session import Rows
from dsd_cli.detect.summary import Expectation, Summarizer

GRID = Grid((0.1, 0.2), (0.5, 1.0, 2.0))
STATES = [(delay, inertia) for delay in (0.1, 0.2) for inertia in (0.5, 1.0, 2.0)]


def make_rows(seed: int, n: int = 80) -> Rows:
    rng = np.random.default_rng(seed)
    state = np.repeat(rng.integers(0, 6, n), rng.integers(1, 6, n))[:n].astype(np.int32)
    ll = np.where(rng.uniform(size=n) < 0.2, np.nan, rng.uniform(-20, -1, n))
    confident = np.isfinite(ll) & (rng.uniform(size=n) < 0.5)
    samples = np.where(np.isnan(ll), 0, 10).astype(np.int32)
    return Rows(np.arange(n) * 0.01, state, ll, np.where(np.isnan(ll), np.nan, 0.5), confident, samples)


def truth_of(seed: int, n: int = 80) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed + 1000)
    delay, inertia = rng.choice([0.1, 0.14, 0.16, np.nan], n), rng.choice([0.55, 0.8, 1.3, 1.4, 5.0], n)
    return {"true_delay": delay, "true_inertia": inertia}


def fed(summarizer: Summarizer, rows: Rows, truth: dict[str, np.ndarray], cuts: list[int]) -> Summarizer:
    edges = [0, *sorted(cuts), rows.state.size]
    for begin, end in itertools.pairwise(edges):
        part = slice(begin, end)
        summarizer.add(Rows(*(c[part] for c in rows)), {name: column[part] for name, column in truth.items()})
    return summarizer


def nearest(value, candidates):
    return min(candidates, key=lambda candidate: abs(candidate - value))


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000), cuts=st.lists(st.integers(0, 80), max_size=5))
def test_segments_shares_and_truth(seed, cuts):
    rows, truth = make_rows(seed), truth_of(seed)
    got = fed(Summarizer(GRID, rho=0.3), rows, truth, cuts).result(int(rows.state[-1]))
    n, states = rows.state.size, rows.state.tolist()
    assert got.samples == n
    assert [s.share for s in got.states] == pytest.approx([states.count(i) / n for i in range(6)])
    sure = [state for state, confident in zip(states, rows.confident, strict=True) if confident]
    assert [s.confident_share for s in got.states] == pytest.approx([sure.count(i) / len(sure) for i in range(6)])

    segments: list[list[int]] = []
    for k, state in enumerate(states):
        if k and state == states[k - 1]:
            segments[-1].append(k)
        else:
            segments.append([k])
    assert got.segments_total == len(segments)
    for segment, members in zip(got.segments, segments, strict=True):
        assert (segment.start, segment.end) == (rows.t[members[0]], rows.t[members[-1]])
        assert segment.state == states[members[0]]
        assert segment.values == dict(zip(("delay", "inertia"), STATES[segment.state], strict=True))
        assert segment.confident_share == pytest.approx(sum(rows.confident[k] for k in members) / len(members))

    judged = [k for k in range(n) if math.isfinite(rows.log_likelihood[k])]
    assert got.judged == len(judged)
    squares = [-2 * 0.09 * (rows.log_likelihood[k] + math.log(0.3 * math.sqrt(2 * math.pi))) / 10 for k in judged]
    assert got.residual_rms == pytest.approx(math.sqrt(sum(squares) / len(judged)))
    # sum of r^2 / rho^2 over the window of 10, against the bound 4 M + 4
    explained = [square * 10 / 0.09 <= 4 * 10 + 4 for square in squares]
    assert got.explained_share == pytest.approx(sum(explained) / len(judged))
    right = []
    for k in judged:
        if math.isnan(truth["true_delay"][k]):
            continue
        delay, inertia = STATES[states[k]]
        of_inertia = 1 / nearest(1 / truth["true_inertia"][k], [1 / 0.5, 1.0, 1 / 2.0])
        right.append(delay == nearest(truth["true_delay"][k], [0.1, 0.2]) and inertia == pytest.approx(of_inertia))
    assert got.truth.samples == len(right)
    assert got.truth.share_correct == pytest.approx(sum(right) / len(right))


@settings(deadline=None, max_examples=30)
@given(
    seed=st.integers(0, 10_000),
    cuts=st.lists(st.integers(0, 80), max_size=4),
    after=st.sampled_from([-math.inf, 0.305, 0.7, 9.0]),
    confident_only=st.booleans(),
)
def test_expectations(seed, cuts, after, confident_only):
    rows = make_rows(seed)
    expected = [Expectation("delay", 0.2), Expectation("inertia", 1.0)]
    got = fed(Summarizer(GRID, expected, after, 0.5, confident_only), rows, {}, cuts).result(0)
    for check, axis in zip(got.checks, (0, 1), strict=True):
        of = [
            STATES[rows.state[k]][axis] == check.value
            for k in range(80)
            if math.isfinite(rows.log_likelihood[k])
            and rows.t[k] >= after
            and (rows.confident[k] or not confident_only)
        ]
        assert check.samples == len(of)
        assert check.share == pytest.approx(sum(of) / len(of) if of else 0.0)
        assert check.holds == (bool(of) and sum(of) >= 0.5 * len(of))
    assert got.truth is None


def test_nothing_at_all():
    got = Summarizer(GRID, [Expectation("delay", 0.1)]).result(3)
    assert (got.samples, got.judged, got.residual_rms, got.segments, got.truth) == (0, 0, None, [], None)
    assert got.final == {"delay": 0.2, "inertia": 0.5}
    assert not got.checks[0].holds


def test_chattering_labels_are_counted_but_not_all_kept(monkeypatch):
    monkeypatch.setattr(module, "MOST_SEGMENTS", 10)
    rows = Rows(np.arange(100.0), np.arange(100, dtype=np.int32) % 2, *(np.zeros(100) for _ in range(2)),
                np.zeros(100, dtype=bool), np.full(100, 10))  # fmt: skip
    got = fed(Summarizer(GRID), rows, {}, [7, 50]).result(1)
    assert (got.segments_total, len(got.segments)) == (100, 10)
