"""Runs of marks, against a loop over the samples."""

import numpy as np
import pytest

from dsd_cli.signals.runs import runs


def by_loop(marks):
    found, start = [], None
    for k, marked in enumerate([*marks, False]):
        if marked and start is None:
            start = k
        elif not marked and start is not None:
            found.append((start, k))
            start = None
    return found


@pytest.mark.parametrize("seed", range(20))
def test_runs_are_those_of_a_loop(seed):
    rng = np.random.default_rng(seed)
    marks = rng.random(int(rng.integers(1, 60))) < rng.random()
    assert runs(marks) == by_loop(marks.tolist())


def test_none_and_all():
    assert runs(np.zeros(0, dtype=bool)) == []
    assert runs(np.zeros(4, dtype=bool)) == []
    assert runs(np.ones(4, dtype=bool)) == [(0, 4)]
