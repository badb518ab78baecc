"""Held-out blocks: every row once, and no fitted row within the gap of what is judged, counted row by row."""

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from dsd_cli.errors import DataError
from dsd_cli.identify.fit.blocks import condensed, lay_blocks
from dsd_cli.identify.policy import POLICY

LENGTHS = st.lists(st.integers(1, 400), min_size=1, max_size=4)


def _laid(lengths, gap):
    """Too short to be laid is another example: hypothesis counts those, and fails if they are too many."""
    try:
        return lay_blocks(lengths, gap, "log.csv")
    except DataError:
        reject()


def _stretch_of_rows(lengths):
    return [i for i, length in enumerate(lengths) for _ in range(length)]


def _segment(blocks, i):
    return slice(blocks.starts[i], [*blocks.starts, blocks.rows][i + 1])


@settings(max_examples=80, deadline=None)
@given(LENGTHS, st.integers(1, 30))
def test_every_row_is_in_exactly_one_segment_and_its_block(lengths, gap):
    blocks = _laid(lengths, gap)
    seen = np.zeros(sum(lengths), dtype=int)
    block_of = np.full(sum(lengths), -1)
    assert len(blocks.starts) == 3 * blocks.count
    for i in range(len(blocks.starts)):
        rows = _segment(blocks, i)
        assert rows.start <= rows.stop
        seen[rows] += 1
        block_of[rows] = i // 3
    assert blocks.rows == sum(lengths)
    assert (seen == 1).all()
    np.testing.assert_array_equal(blocks.block_of_rows(), block_of)
    stretches = np.array(_stretch_of_rows(lengths))
    for block in range(blocks.count):
        assert len(set(stretches[block_of == block])) == 1, "a block over two stretches"


@settings(max_examples=80, deadline=None)
@given(LENGTHS, st.integers(1, 30))
def test_exactly_the_rows_within_the_gap_of_what_is_held_out_are_left_out(lengths, gap):
    blocks = _laid(lengths, gap)
    stretches, block_of = np.array(_stretch_of_rows(lengths)), blocks.block_of_rows()
    places = np.arange(blocks.rows)
    for fold in range(blocks.folds):
        weight = blocks.fitted(fold)
        fitted = np.zeros(blocks.rows)
        for i, w in enumerate(weight):
            fitted[_segment(blocks, i)] = w
        held = blocks.fold[block_of] == fold
        assert held.any()
        for row in places:
            beside = held & (stretches == stretches[row]) & (np.abs(places - row) <= gap)
            assert fitted[row] == (0.0 if beside.any() else 1.0), f"row {row}, fold {fold}"


@settings(max_examples=60, deadline=None)
@given(LENGTHS, st.integers(1, 30))
def test_folds_take_turns_and_every_block_is_held_out_once(lengths, gap):
    blocks = _laid(lengths, gap)
    assert 2 <= blocks.folds <= POLICY.folds
    assert blocks.fold.tolist() == [b % min(POLICY.folds, blocks.count) for b in range(blocks.count)]
    sizes = np.bincount(blocks.block_of_rows())
    own = [i for i in range(blocks.count) if blocks.before[i] or blocks.after[i]]
    usual = min(POLICY.block_gaps * gap, sum(lengths) // POLICY.folds)
    assert all(sizes[i] >= usual for i in own), "a block that is mostly gap"


def test_rows_of_another_stretch_are_no_neighbours():
    count = POLICY.folds
    blocks = lay_blocks([40] * count, 20, "log.csv")
    assert blocks.count == count
    for fold in range(count):
        np.testing.assert_array_equal(blocks.fitted(fold), np.repeat(np.arange(count) != fold, 3))


@pytest.mark.parametrize(("lengths", "gap"), [([59], 10), ([1], 1), ([20, 20], 10), ([100], 100)])
def test_too_short_is_an_error_that_names_the_rows(lengths, gap):
    with pytest.raises(DataError) as error:
        lay_blocks(lengths, gap, "log.csv")
    assert "log.csv" in str(error.value)
    assert f"{sum(lengths)} independent samples" in str(error.value)
    assert str(2 * POLICY.block_gaps * gap) in str(error.value)
    assert "\n" not in str(error.value)


@settings(max_examples=30, deadline=None)
@given(LENGTHS, st.integers(1, 30))
def test_rows_of_blocks_and_of_fits_are_counted(lengths, gap):
    blocks = _laid(lengths, gap)
    block_of = blocks.block_of_rows()
    assert blocks.block_rows.tolist() == [int(np.sum(block_of == b)) for b in range(blocks.count)]
    for fold, count in enumerate(blocks.fitted_rows):
        rows = [_segment(blocks, i) for i, w in enumerate(blocks.fitted(fold)) if w > 0.0]
        assert count == sum(r.stop - r.start for r in rows)


def test_the_shortest_log_that_is_long_enough():
    assert lay_blocks([60], 10, "log.csv").count == 5


def test_a_short_log_has_a_block_for_each_fold():
    """Of two halves one speeds up and the other slows down, and neither tells what the other does."""
    assert [lay_blocks([rows], 5, "log.csv").count for rows in (30, 41, 74, 75, 90)] == [5, 5, 5, 5, 6]


@pytest.mark.parametrize("length", [3, 2048, 2049, 7001])
def test_condensed_rows_have_the_same_inner_products(length):
    rows = np.random.default_rng(length).normal(size=(4, length)) * [[1e-6], [1.0], [1.0], [1e6]]
    rows[2] = rows[1] + 1e-7 * rows[2]
    found = condensed(rows)
    assert found.shape[1] <= 4 * (length // 2048 + 1)
    sizes = np.linalg.norm(rows, axis=1)
    np.testing.assert_allclose(
        found @ found.T / np.outer(sizes, sizes), rows @ rows.T / np.outer(sizes, sizes), atol=1e-13
    )
    apart = np.linalg.norm(found[2] - found[1])  # which a Gram matrix would have lost
    assert apart == pytest.approx(np.linalg.norm(rows[2] - rows[1]), rel=1e-6)
