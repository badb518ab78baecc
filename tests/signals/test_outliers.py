"""The level of a channel and its outliers, against plain loops; no chunking changes them, and real logs have none."""

import itertools
import math
from pathlib import Path

import numpy as np
import pyarrow.csv as pc
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsd_cli.signals.outliers import Level, Limits, Outliers

ROOT = Path(__file__).parents[2]


def naive_levels(x: list[float]) -> list[float]:
    """The definition: the largest power of two that 8 of some 64 successive rows have reached."""
    level, out = 0.0, []
    for row in range(len(x)):
        sizes = sorted(abs(v) for v in x[max(0, row - 63) : row + 1] if math.isfinite(v) and v != 0.0)
        if len(sizes) >= 8:
            level = max(level, 2.0 ** math.floor(math.log2(sizes[-8])))
        out.append(level)
    return out


def in_chunks(x: np.ndarray, cuts: list[int]) -> list[np.ndarray]:
    edges = sorted({0, *(c % (len(x) + 1) for c in cuts), len(x)})
    return [x[a:b] for a, b in itertools.pairwise(edges)]


values = st.one_of(
    st.floats(-4, 4, width=32), st.sampled_from([0.0, math.nan, math.inf, -math.inf, 1e3, -1e9, 1e308, 50.0])
)


@given(st.lists(values, max_size=300), st.lists(st.integers(0, 400), max_size=5), st.integers(0, 10**6))
def test_the_level_is_that_of_the_definition_for_every_chunking(seldom, cuts, seed):
    x = np.concatenate([np.array(seldom), np.random.default_rng(seed).normal(size=200) * 10.0 ** (seed % 7)])
    expected = naive_levels(x.tolist())
    level, seen = Level(), []
    for chunk in in_chunks(x, cuts):
        seen += level.follow(chunk, 4.0)
        assert level.value == (expected[level.rows - 1] if level.rows else 0.0)
    stands_out = [i for i, v in enumerate(x) if 4.0 * expected[i] <= abs(v) < math.inf and v != 0.0]
    assert [row for row, size, at in seen if size >= 4.0 * at] == stands_out


@given(st.lists(values, min_size=1, max_size=200), st.lists(st.integers(0, 400), max_size=5))
def test_outliers_do_not_depend_on_the_chunks(x, cuts):
    x = np.array(x)
    limits = Limits({"u": (-60.0, 2e9)}, 1e5)
    whole, parts = Outliers(limits), Outliers(limits)
    expected = whole.beyond("u", x)
    masks = [np.zeros(len(c), bool) if (m := parts.beyond("u", c)) is None else m for c in in_chunks(x, cuts)]
    np.testing.assert_array_equal(
        np.concatenate(masks) if masks else [], np.zeros(len(x), bool) if expected is None else expected
    )


def test_a_lasting_change_of_any_size_is_no_outlier_for_longer_than_seven_rows():
    x = np.concatenate([np.full(100, 1e-3), np.full(100, 1e9)])
    assert np.flatnonzero(Outliers(Limits(factor=1e5)).beyond("u", x)).tolist() == list(range(100, 107))


@pytest.mark.parametrize("times", [50.0, 1e3])
def test_spikes_that_real_drives_log_stay(times):
    x = np.sin(np.arange(2000) * 0.05)
    x[700] = times
    assert Outliers(Limits(factor=1e5)).beyond("u", x) is None


def test_counts_of_an_encoder_are_no_outliers():
    x = 16_777_216.0 + np.arange(1000)
    assert Outliers(Limits(factor=1e5)).beyond("position", x) is None


@pytest.mark.parametrize("path", sorted((ROOT / "sample_logs").glob("*.[cp][sa][vr]*")), ids=lambda p: p.name)
def test_nothing_of_a_sample_log_is_an_outlier(path):
    if path.suffix not in (".csv", ".parquet"):
        pytest.skip("no log")
    table = pc.read_csv(path) if path.suffix == ".csv" else pq.read_table(path)
    for name in table.column_names:
        column = np.asarray(table[name].to_numpy(), dtype=float)
        assert Outliers(Limits(factor=1e5)).beyond(name, column) is None


@pytest.mark.parametrize("value", [1e308, math.inf, math.nan, 5e-324, 1.7976931348623157e308])
def test_a_column_of_one_extreme_value_comes_to_an_end(value):
    level = Level()
    for _ in range(3):
        level.follow(np.full(100, value), 4.0)
    assert level.value == (2.0 ** (math.frexp(value)[1] - 1) if math.isfinite(value) else 0.0)
