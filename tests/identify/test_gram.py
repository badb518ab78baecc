"""Sums of products instead of rows: the same fits as least squares on the rows themselves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.identify.fit.blocks import grams, lay_blocks, solve, squares, total_gram, without_noise


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


# -- noise in the columns ---------------------------------------------------------------------------------------------


def _covariance(seed, columns, noisy, size):
    """Covariance of noise in `noisy` of the columns, of about that standard deviation, and its root."""
    rng = np.random.default_rng(seed)
    root = np.zeros((columns, columns))
    root[np.ix_(noisy, noisy)] = size * (np.eye(len(noisy)) + 0.4 * rng.normal(size=(len(noisy), len(noisy))))
    return root @ root.T, root


def test_the_gram_without_noise_is_that_of_the_clean_columns_in_the_mean():
    """300 draws of noise of known covariance in two of three columns; the mean is known to a fraction of its bias."""
    clean = _rows(11, 400, 3)
    noise, root = _covariance(12, 3, [0, 2], 0.4)
    rng, wanted = np.random.default_rng(13), total_gram(list(clean))
    found = []
    for _ in range(300):
        rows = clean.copy()
        rows[1:] += root @ rng.normal(size=(3, 400))
        found.append(without_noise(total_gram(list(rows)), noise, 400))
    mean, error = np.mean(found, axis=0), np.std(found, axis=0) / np.sqrt(len(found))
    assert (np.abs(mean - wanted) <= 4.5 * error + 1e-9).all()
    bias = 400 * noise[np.ix_([0, 2], [0, 2])]
    assert (np.abs(bias).max() > 8.0 * error).all(), "else bias would not be seen"


def test_coefficients_without_noise_are_unbiased_and_with_it_they_are_not():
    """300 draws: noise of a third of a column pulls its coefficient down by a tenth; the correction puts that right."""
    rng, both = np.random.default_rng(14), []
    x = rng.normal(size=(2, 400))
    noise = np.diag([0.1, 0.0])
    for _ in range(300):
        y = np.array([2.0, -1.0]) @ x + 0.2 * rng.normal(size=400)
        seen = x + np.sqrt(noise) @ rng.normal(size=(2, 400))
        gram = total_gram([y, *seen])
        both.append([solve(gram[None])[0], solve(without_noise(gram, noise, 400)[None])[0]])
    plain, corrected = np.mean(both, axis=0)
    error = np.std(both, axis=0)[1] / np.sqrt(300)
    assert plain[0] < 2.0 * 0.93
    assert (np.abs(corrected - [2.0, -1.0]) < 4.0 * error + 0.002).all()


def test_each_matrix_loses_the_noise_of_its_own_rows():
    rows = _rows(15, 300, 2)
    noise = np.diag([0.01, 0.0])
    parts = np.stack([total_gram(list(rows[:, :100])), total_gram(list(rows[:, 100:]))])
    found = without_noise(parts, noise, np.array([100, 200]))
    np.testing.assert_allclose(
        parts - found, np.array([100, 200])[:, None, None] * np.pad(noise, ((1, 0), (1, 0))), atol=1e-9
    )


def test_no_more_than_half_of_a_column_is_taken_and_y_is_left_alone():
    rows = _rows(16, 200, 2)
    gram = total_gram(list(rows))
    found = without_noise(gram, np.diag([50.0, 0.0]), 200)
    assert found[1, 1] == pytest.approx(0.5 * gram[1, 1])
    found[1, 1] = gram[1, 1]
    np.testing.assert_array_equal(found, gram)


def test_without_noise_nothing_changes():
    gram = total_gram(list(_rows(17, 100, 2)))
    np.testing.assert_array_equal(without_noise(gram, np.zeros((2, 2)), 100), gram)
