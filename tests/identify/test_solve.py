"""Fits out of sums of products against least squares on explicit rows, fold by fold, and signs by trying all sets."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.blocks import lay_blocks
from dsd_cli.identify.fit.solve import Solver, delay_of

ROWS, GAP = 300, 7
VISCOUS, COULOMB, LOAD, GRAVITY = (
    Term(n) for n in ("viscous_friction", "coulomb_friction", "constant_load", "gravity")
)
SIGNED = {VISCOUS: True, COULOMB: True, LOAD: False, GRAVITY: False}


class Columns:
    """Stands for a bank: any columns under the names of effects."""

    def __init__(self, y, drives, columns):
        self.y, self.drives, self.by_term = y, drives, columns

    def drive(self, inputs, tap, keep=True):
        return self.drives[tap]

    def columns(self, term, tap, keep=True):
        return self.by_term[term]


def _bank(seed, theta, mixing=0.0, noise=0.5):
    """y = theta x columns + noise; columns in the order drive 0, drive 1, viscous, Coulomb, load, gravity (two)."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(7, ROWS)) + mixing * rng.normal(size=ROWS)
    y = np.array(theta) @ x + noise * rng.normal(size=ROWS)
    drives = {0: x[0], 1: x[1], 2: rng.normal(size=ROWS)}
    return Columns(y, drives, {VISCOUS: [x[2]], COULOMB: [x[3]], LOAD: [x[4]], GRAVITY: [x[5], x[6]]})


def _matrix(bank, terms, tap):
    return np.array([bank.drives[tap], bank.drives[tap + 1], *(c for t in terms for c in bank.by_term[t])]).T


def _best_of_all_sets(matrix, y, signed):
    """Least squares under signs: the best feasible one among all sets of columns that are allowed to act."""
    best = (float(y @ y), np.zeros(matrix.shape[1]))
    columns = range(matrix.shape[1])
    for size in columns:
        for chosen in combinations(columns, size + 1):
            theta = np.zeros(matrix.shape[1])
            theta[list(chosen)] = np.linalg.lstsq(matrix[:, chosen], y, rcond=None)[0]
            if all(theta[i] >= 0.0 for i in columns if signed[i]):
                best = min(best, (float(np.sum((y - matrix @ theta) ** 2)), theta), key=lambda b: b[0])
    return best


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 1))
def test_held_out_losses_are_those_of_a_fit_per_fold_on_explicit_rows(seed, tap):
    terms = (VISCOUS, LOAD, GRAVITY)
    bank = _bank(seed, [3.0, 3.0, 2.0, 0.0, -1.0, 0.5, -2.0])
    bank.drives[2] = bank.drives[2] + bank.drives[0]
    blocks = lay_blocks([200, 100], GAP, "x")
    fit = Solver(bank, blocks).fit(terms, tap)
    matrix, block_of = _matrix(bank, terms, tap), blocks.block_of_rows()
    if (fit.total == 0.0).any():
        return  # pressed onto 0: the next test
    np.testing.assert_allclose(fit.total, np.linalg.lstsq(matrix, bank.y, rcond=None)[0], rtol=1e-6, atol=1e-8)
    stretch = np.repeat([0, 1], [200, 100])
    for b in range(blocks.count):
        held = np.flatnonzero(blocks.fold[block_of] == blocks.fold[b])
        fitted = [i for i in range(ROWS) if not any(stretch[i] == stretch[j] and abs(i - j) <= GAP for j in held)]
        theta = np.linalg.lstsq(matrix[fitted], bank.y[fitted], rcond=None)[0]
        own = np.flatnonzero(block_of == b)
        wanted = sum((bank.y[i] - matrix[i] @ theta) ** 2 for i in own)
        assert fit.losses[b] == pytest.approx(wanted, rel=1e-6)
        np.testing.assert_allclose(fit.folds[blocks.fold[b]], theta, rtol=1e-5, atol=1e-7)
    assert fit.loss == pytest.approx(fit.losses.sum())
    assert fit.squares == pytest.approx(float(np.sum((bank.y - matrix @ fit.total) ** 2)), rel=1e-7)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.floats(-2.0, 2.0), min_size=7, max_size=7), st.sampled_from([0.0, 1.0, 5.0]))
def test_coefficients_that_must_not_be_negative_are_the_best_that_are_not(seed, theta, mixing):
    terms = (VISCOUS, COULOMB, LOAD, GRAVITY)
    bank = _bank(seed, theta, mixing)
    solver = Solver(bank, lay_blocks([ROWS], GAP, "x"))
    signed = [True, True, *(SIGNED[t] for t in terms for _ in bank.by_term[t])]
    squares, wanted = _best_of_all_sets(_matrix(bank, terms, 0), bank.y, signed)
    fit = solver.fit(terms, 0)
    assert (fit.total[np.array(signed)] >= 0.0).all()
    assert fit.squares == pytest.approx(squares, rel=1e-6)
    assert solver.squares(terms, 0) == pytest.approx(squares, rel=1e-6)
    np.testing.assert_allclose(fit.total, wanted, atol=1e-5)
    assert (fit.folds[:, fit.total == 0.0] == 0.0).all()


def test_a_pair_of_columns_and_a_load_may_have_any_sign():
    fit = Solver(_bank(1, [1, 1, 0, 0, -3, -2, -1]), lay_blocks([ROWS], GAP, "x")).fit((LOAD, GRAVITY), 0)
    assert (fit.total[2:] < -0.5).all()
    assert fit.widths == (1, 2)
    np.testing.assert_array_equal(fit.coefficients(LOAD), fit.total[2:3])
    np.testing.assert_array_equal(fit.coefficients(GRAVITY), fit.total[3:5])
    np.testing.assert_array_equal(fit.coefficients(GRAVITY, fold=2), fit.folds[2, 3:5])


def test_the_best_tap_is_the_one_with_least_squares():
    bank = _bank(2, [0.0, 2.0, 0, 0, 0, 0, 0])
    bank.drives[2] = np.random.default_rng(9).normal(size=ROWS)
    bank.drives[3] = np.random.default_rng(10).normal(size=ROWS)
    bank.y = 2.0 * bank.drives[2] + bank.drives[3]
    fit = Solver(bank, lay_blocks([ROWS], GAP, "x")).best((), [0, 1, 2])
    assert fit.tap == 2
    assert fit.delay == pytest.approx(2.0 + 1.0 / 3.0)


def test_a_delay_lies_between_its_taps_by_their_shares():
    assert delay_of(np.array([0.75, 0.25]), 4) == pytest.approx(4.25)
    assert delay_of(np.array([1.0, 0.0]), 4) == 4.0
    assert delay_of(np.array([0.0, 0.0]), 4) == 4.0


def test_a_pulse_has_the_level_of_all_rows_in_every_fold():
    pulse = Term.of("external_force", {"edges": ((0.1, 0.2),)})
    bank = _bank(3, [1.0, 1.0, 0, 0, 0, 0, 0])
    column = np.zeros(ROWS)
    column[130:160] = 1.0
    bank.by_term[pulse] = [column]
    bank.y = bank.y + 5.0 * column
    blocks = lay_blocks([ROWS], GAP, "x")
    fit = Solver(bank, blocks).fit((pulse,), 0)
    assert (fit.folds[:, 2] == fit.total[2]).all()
    rows = [blocks.block_of_rows() == b for b in range(blocks.count)]
    matrix = _matrix(bank, (pulse,), 0)
    for b in range(blocks.count):
        left = bank.y[rows[b]] - matrix[rows[b]] @ fit.folds[blocks.fold[b]]
        assert fit.losses[b] == pytest.approx(float(left @ left))
