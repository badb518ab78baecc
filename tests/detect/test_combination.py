"""Eq. 12: the mean of the candidates, weighted by p^N, against plain loops; when it is worth something."""

import math

import numpy as np
import pytest

from dsd_cli.detect import Grid, Transition
from tests.detect.test_against_oracle import BACKENDS, JN, STATES, TAU, engine, recording
from tests.oracle import detect_oracle as oracle
from tests.paper.runs import run

STAY = [[0.6 if i == j else 0.4 / 11 for j in range(12)] for i in range(12)]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("n", [1, 4])
def test_the_estimate_is_eq_12(backend, n):
    t, u, d = recording(4, noise=1.0)
    rows = oracle.log_likelihoods(t, u.tolist(), d.tolist(), STATES, JN, TAU, 0.8, 2)
    labels = engine(
        backend, method="combination", average=n, window=2, rho=0.8, initial=3, confidence=0.0,
        transition=Transition(stay=0.6),
    ).run(u, d)  # fmt: skip
    expected = oracle.averaged(rows, STAY, 3, STATES, n)
    assert labels.state.tolist() == expected
    decided, seen, founded = [3] * n, [], 0
    for k, row in enumerate(rows):
        if row is None:
            continue
        seen.append(row[0])
        recent = seen[-n:]
        top = max(max(r) for r in recent)
        p = [STAY[decided[-n]][i] * sum(math.exp(r[i] - top) for r in recent) / len(recent) for i in range(12)]
        decided.append(expected[k])
        for axis, value, flag in (
            (0, labels.estimates.delay, labels.estimates.delay_confident),
            (1, labels.estimates.inertia, labels.estimates.inertia_confident),
        ):
            if flag[k]:
                founded += 1
                assert value[k] == pytest.approx(sum(s[axis] * x for s, x in zip(STATES, p, strict=True)) / sum(p))
    assert founded > 50


def test_chunks_give_the_same_bits():
    _, u, d = recording(4, noise=1.0)
    whole = engine("numpy", method="combination", average=3, rho=0.8).run(u, d)
    parts = engine("numpy", method="combination", average=3, rho=0.8)
    got = [parts.run(u[a:b], d[a:b]).estimates for a, b in ((0, 1), (1, 30), (30, 200), (200, 260))]
    for column, pieces in zip(whole.estimates, zip(*got, strict=True), strict=True):
        np.testing.assert_array_equal(np.concatenate(pieces), column)


def test_values_that_are_no_neighbours_are_not_combined():
    """The paper: "only in the case where the outputs ... have monotonic relationship". u repeats after 0.2 s."""
    grid = Grid((0.0, 0.05, 0.1, 0.2), (1.0, 2.0))
    u = np.sin(2.0 * np.pi * np.arange(600) / 20.0)
    _, w = oracle.predictions((0.01 * np.arange(600)).tolist(), u.tolist(), 0.0, TAU)
    labels = engine("numpy", grid, method="combination", window=20, rho=0.3).run(u, JN * np.array(w) - np.array(w))
    assert not labels.estimates.delay_confident.any()
    assert labels.estimates.inertia_confident[100:].all()
    np.testing.assert_allclose(labels.estimates.inertia[100:], 1.0, atol=0.01)


@pytest.mark.parametrize(("inertia", "label"), [(0.6, 0.5), (0.7, 1.0)])
def test_between_candidates_it_is_nearer_than_the_label_where_rho_is_as_large_as_the_misfit(inertia, label):
    """Fig. 7's sine with rho = 30: "can improve the identification of true k"; with the paper's rho it is the label."""
    given = (f"model.inertia={inertia}", 'detector.method="combination"', "simulate.duration=2")
    found = run("paper-sine", *given, "detector.rho=30")
    late = found.t > 1.0
    assert set(found.labels.inertia[late]) == {label}
    error = abs(found.labels.estimates.inertia[late].mean() - inertia)
    assert error < 0.8 * abs(label - inertia)
    assert found.labels.estimates.delay[late] == pytest.approx(0.3, abs=1e-3)
    sharp = run("paper-sine", *given, "detector.rho=10").labels.estimates.inertia
    assert np.abs(sharp[late] - label).max() < 0.01
