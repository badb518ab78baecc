"""Sums of products instead of rows: the same fits as least squares on the rows themselves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.identify.fit.blocks import lay_blocks
from dsd_cli.identify.fit.gram import grams, solve, squares, total_gram


def _rows(seed, rows, columns, spread=0.0):
    rng = np.random.default_rng(seed)
    scales = 10.0 ** rng.uniform(-spread, spread, columns)
    x = rng.normal(size=(columns, rows)) * scales[:, None]
    theta = rng.normal(size=columns) / scales
    return np.vstack([theta @ x + 0.3 * rng.normal(size=rows), x])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.integers(30, 150), min_size=1, max_size=3), st.integers(1, 8))
def test_grams_are_products_of_exactly_those_rows(seed, lengths, gap):
    if sum(lengths) < 6 * gap:
        return
    rows = _rows(seed, sum(lengths), 3)
    blocks = lay_blocks(lengths, gap, "x")
    found, block_of = grams(list(rows), blocks), blocks.block_of_rows()
    stretch = np.repeat(np.arange(len(lengths)), lengths)
    places = np.arange(blocks.rows)

    def products(mask):
        return sum((np.outer(rows[:, i], rows[:, i]) for i in np.flatnonzero(mask)), np.zeros((4, 4)))

    np.testing.assert_allclose(found.total, products(places >= 0), atol=1e-9)
    np.testing.assert_allclose(total_gram(list(rows)), found.total, atol=1e-9)
    for b in range(blocks.count):
        np.testing.assert_allclose(found.held_out[b], products(block_of == b), atol=1e-9)
    for fold in range(blocks.folds):
        held = np.flatnonzero(blocks.fold[block_of] == fold)
        near = [any(stretch[j] == stretch[i] and abs(i - j) <= gap for j in held) for i in places]
        np.testing.assert_allclose(found.fitted[fold], products(~np.array(near)), atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6))
def test_solve_is_least_squares_whatever_the_scales_of_the_columns(seed, columns):
    rows = _rows(seed, 200, columns, spread=5.0)
    wanted, residual, _, _ = np.linalg.lstsq(rows[1:].T, rows[0], rcond=None)
    found = solve(total_gram(list(rows))[None])[0]
    size = np.linalg.norm(rows[1:], axis=1)
    np.testing.assert_allclose(found * size, wanted * size, rtol=1e-6, atol=1e-6 * np.linalg.norm(rows[0]))
    assert squares(total_gram(list(rows)), found) == pytest.approx(residual[0], rel=1e-7)


def test_the_ridge_takes_nothing_measurable_from_the_fit():
    rows = _rows(3, 500, 4)
    gram = total_gram(list(rows))
    with_ridge, without = solve(gram[None])[0], solve(gram[None], 0.0)[0]
    np.testing.assert_allclose(with_ridge, without, rtol=1e-7)


def test_two_equal_columns_share_what_one_would_have_and_nothing_overflows():
    rows = _rows(4, 300, 2)
    twice = np.vstack([rows, rows[2:]])
    one, two = solve(total_gram(list(rows))[None])[0], solve(total_gram(list(twice))[None])[0]
    assert two[1] + two[2] == pytest.approx(one[1], rel=1e-6)
    assert np.abs(two).max() <= np.abs(one).max() * 1.01


def test_a_column_that_one_fold_never_saw_is_not_blown_up_there():
    rows = _rows(5, 400, 2)
    rows[2, :200] = 0.0
    unseen, seen = total_gram(list(rows[:, :200])), total_gram(list(rows[:, 200:]))
    found = solve(np.stack([unseen, seen]))
    wanted = [np.linalg.lstsq(part[1:].T, part[0], rcond=None)[0] for part in (rows[:, :200], rows[:, 200:])]
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-9)
    assert found[0, 1] == 0.0


def test_no_column_and_a_column_of_zeros():
    rows = _rows(6, 50, 1)
    assert solve(total_gram([rows[0]])[None]).shape == (1, 0)
    rows[1] = 0.0
    assert solve(total_gram(list(rows))[None])[0, 0] == 0.0


def test_a_ridge_matrix_is_added_to_the_columns_at_unit_length():
    rows = _rows(7, 100, 3)
    penalty = np.diag([0.0, 0.5, 2.0])
    size = np.linalg.norm(rows[1:], axis=1)
    unit = rows[1:] / size[:, None]
    wanted = np.linalg.solve(unit @ unit.T + penalty, unit @ rows[0]) / size
    np.testing.assert_allclose(solve(total_gram(list(rows))[None], penalty)[0], wanted, rtol=1e-9)


def test_squares_are_those_of_the_rows_and_never_negative():
    rows = _rows(8, 80, 2)
    theta = np.array([0.7, -1.1])
    wanted = sum((rows[0, i] - theta @ rows[1:, i]) ** 2 for i in range(80))
    assert squares(total_gram(list(rows)), theta) == pytest.approx(wanted)
    exact = np.vstack([theta @ rows[1:], rows[1:]])
    assert 0.0 <= squares(total_gram(list(exact)), theta) < 1e-10
