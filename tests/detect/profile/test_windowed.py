"""Windowed sums against plain loops, however the rows are cut."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.detect.profile.windowed import WindowedSums


@pytest.mark.parametrize("window", [1, 2, 7, 50])
def test_sums_are_those_of_a_plain_loop(window: int) -> None:
    rows = np.random.default_rng(window).normal(size=(120, 3))
    got = WindowedSums(window, 3).feed(rows)
    expected = [[sum(rows[i, c] for i in range(max(k - window + 1, 0), k + 1)) for c in range(3)] for k in range(120)]
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12)


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 30), st.lists(st.integers(0, 90), max_size=6))
def test_the_bits_do_not_depend_on_the_cuts(window: int, cuts: list[int]) -> None:
    rows = np.random.default_rng(7).normal(size=(90, 2))
    sums, edges = WindowedSums(window, 2), sorted({0, *cuts, 90})
    parts = [sums.feed(rows[a:b]) for a, b in itertools.pairwise(edges)]
    np.testing.assert_array_equal(np.vstack(parts), WindowedSums(window, 2).feed(rows))


def test_a_spike_leaves_no_trace() -> None:
    """A running sum that subtracts keeps 1e17 eps of it for ever."""
    rows = np.ones((40, 1))
    rows[5] = 1e17
    assert WindowedSums(10, 1).feed(rows)[15:].tolist() == [[10.0]] * 25
