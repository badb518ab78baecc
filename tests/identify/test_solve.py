"""Fits out of sums of products against least squares on explicit rows, both ways round; signs by trying all sets."""

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dsd_cli.identify.fit.band import band_of, passed_variance
from dsd_cli.identify.fit.bank import FIXED, INERTIA, Bank, Design, Term, not_negative
from dsd_cli.identify.fit.blocks import lay_blocks
from dsd_cli.identify.fit.direction import best_delay
from dsd_cli.identify.fit.equations import equations_of
from dsd_cli.identify.fit.solve import Solver
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.recordings.spectrum import SensorNoise
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.signals.log import Log

ROWS, GAP, J0 = 300, 7, 2.5
VISCOUS, COULOMB, LOAD, GRAVITY = (
    Term(n) for n in ("viscous_friction", "coulomb_friction", "constant_load", "gravity")
)


class Columns:
    """Stands for a bank: any columns under the names of effects; `variance` of the noise in each."""

    tap_time, equations = 1e-3, SimpleNamespace(counted=float(ROWS), kept=np.ones(ROWS, dtype=bool))

    def __init__(self, drives, acceleration, columns, variance=()):
        self.drives, self.acceleration, self.by_term, self.variance = drives, acceleration, columns, variance

    def design(self, terms, tap, keep=True):
        drive, later = self.drives[tap], self.drives[tap + 1]
        rows, signed, widths = [drive, self.acceleration, drive - later], [True, True], []
        for term in terms:
            rows += self.by_term[term]
            widths.append(len(self.by_term[term]))
            signed += [not_negative(term, widths[-1])] * widths[-1]
        noise = np.diag([*self.variance, *[0.0] * (len(rows) - 1 - len(self.variance))])
        return Design(rows, signed, tuple(widths), noise)

    def rows(self, terms, tap, keep=True):
        return self.design(terms, tap, keep).rows


def _bank(seed, theta, mixing=0.0, noise=0.5, variance=()):
    """drive = theta x columns + noise; columns: acceleration, further step, viscous, Coulomb, load, gravity (two)."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(7, ROWS)) + mixing * rng.normal(size=ROWS)
    drive = np.array(theta) @ x + noise * rng.normal(size=ROWS)
    drives = {0: drive, 1: drive - x[1]}
    terms = {VISCOUS: [x[2]], COULOMB: [x[3]], LOAD: [x[4]], GRAVITY: [x[5], x[6]]}
    return Columns(drives, x[0], terms, variance)


def _best_of_all_sets(matrix, y, signs):
    """Least squares under signs (1, -1, 0 free): the best feasible one among all sets of columns that may act."""
    best = (float(y @ y), np.zeros(matrix.shape[1]))
    for size in range(matrix.shape[1]):
        for chosen in combinations(range(matrix.shape[1]), size + 1):
            theta = np.zeros(matrix.shape[1])
            theta[list(chosen)] = np.linalg.lstsq(matrix[:, chosen], y, rcond=None)[0]
            if (np.array(signs) * theta >= 0.0).all():
                best = min(best, (float(np.sum((y - matrix @ theta) ** 2)), theta), key=lambda b: b[0])
    return best


def _both(bank, terms):
    """(inverse matrix, its target, its signs), (forward matrix, its target, its signs)."""
    design = bank.design(terms, 0)
    rows, signed = np.stack(design.rows), [int(s) for s in design.signed]
    inverse = rows[1:].T, rows[0], signed
    forward = np.delete(rows, 1, axis=0).T, rows[1], [1, *(-s for s in signed[1:])]
    return inverse, forward


def _weights(theta):
    """Of the rows in the residual of the forward form, from the coefficients of all but the acceleration."""
    return np.concatenate([[-theta[0]], [1.0], -theta[1:]])


# -- both forms -------------------------------------------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_every_fold_is_least_squares_on_its_explicit_rows(seed):
    terms = (VISCOUS, LOAD, GRAVITY)
    bank = _bank(seed, [3.0, 1.0, 2.0, 0.0, -1.0, 0.5, -2.0])
    blocks = lay_blocks([200, 100], GAP, "x")
    fit = Solver(bank, blocks, J0).fit(terms, 0)
    rows = np.stack(bank.design(terms, 0).rows)
    (matrix, y, _), (forward, a, _) = _both(bank, terms)
    assume((fit.total != 0.0).all() and (fit.forward != 0.0).all())  # pressed onto 0: the next test
    np.testing.assert_allclose(fit.total, np.linalg.lstsq(matrix, y, rcond=None)[0], rtol=1e-6, atol=1e-8)
    whole = np.linalg.lstsq(forward, a, rcond=None)[0]
    np.testing.assert_allclose(fit.forward, J0 * _weights(whole), rtol=1e-6, atol=1e-8)
    assert fit.squares == pytest.approx(J0**2 * float(np.sum((a - forward @ whole) ** 2)), rel=1e-6)
    stretch, block_of = np.repeat([0, 1], [200, 100]), blocks.block_of_rows()
    for b in range(blocks.count):
        fold = blocks.fold[b]
        held = np.flatnonzero(blocks.fold[block_of] == fold)
        seen = [i for i in range(ROWS) if not any(stretch[i] == stretch[j] and abs(i - j) <= GAP for j in held)]
        theta = np.linalg.lstsq(matrix[seen], y[seen], rcond=None)[0]
        np.testing.assert_allclose(fit.folds[fold], theta, rtol=1e-5, atol=1e-7)
        weights = J0 * _weights(np.linalg.lstsq(forward[seen], a[seen], rcond=None)[0])
        np.testing.assert_allclose(fit.forward_folds[fold], weights, rtol=1e-5, atol=1e-7)
        own = np.flatnonzero(block_of == b)
        assert fit.losses[b] == pytest.approx(sum(float(weights @ rows[:, i]) ** 2 for i in own), rel=1e-6)
    assert fit.loss == pytest.approx(fit.losses.sum())


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.floats(-2.0, 2.0), min_size=7, max_size=7), st.sampled_from([0.0, 1.0, 5.0]))
def test_coefficients_with_the_wrong_sign_are_pressed_onto_nothing(seed, theta, mixing):
    """Never a wrong sign, least squares in what is left, and no fold has what the whole has not."""
    terms = (VISCOUS, COULOMB, LOAD, GRAVITY)
    bank = _bank(seed, theta, mixing)
    solver = Solver(bank, lay_blocks([ROWS], GAP, "x"), J0)
    fit = solver.fit(terms, 0)
    forms = zip(_both(bank, terms), (fit.total, -np.delete(fit.forward, 1) / J0), strict=True)
    for (matrix, y, signs), found in forms:
        assert (np.array(signs) * found >= 0.0).all()
        free = np.flatnonzero(found)
        wanted = np.linalg.lstsq(matrix[:, free], y, rcond=None)[0] if len(free) else np.zeros(0)
        np.testing.assert_allclose(found[free], wanted, atol=1e-5)
        best, _ = _best_of_all_sets(matrix, y, signs)
        assert float(np.sum((y - matrix @ found) ** 2)) == pytest.approx(best, rel=1e-6)
    assert (fit.folds[:, fit.total == 0.0] == 0.0).all()
    assert (fit.forward_folds[:, fit.forward == 0.0] == 0.0).all()
    assert solver.squares(terms, 0) == pytest.approx(fit.squares, rel=1e-9)


def test_a_pair_of_columns_and_a_load_may_have_any_sign():
    fit = Solver(_bank(1, [1, 1, 0, 0, -3, -2, -1]), lay_blocks([ROWS], GAP, "x")).fit((LOAD, GRAVITY), 0)
    assert (fit.total[FIXED:] < -0.5).all()
    assert fit.widths == (1, 2)
    np.testing.assert_array_equal(fit.coefficients(LOAD), fit.total[2:3])
    np.testing.assert_array_equal(fit.coefficients(GRAVITY), fit.total[3:5])


def test_the_two_forms_bracket_the_inertia():
    """What u has that no column follows leaves the inverse form alone and pulls 1 / g of the forward form up."""
    noisy_u = Solver(_bank(5, [2, 0, 0, 0, 0, 0, 0], noise=2.0), lay_blocks([ROWS], GAP, "x")).fit((), 0)
    assert noisy_u.total[INERTIA] == pytest.approx(2.0, abs=0.4)
    assert 1.0 / -noisy_u.forward[0] > 3.0


def test_a_pulse_has_the_level_of_all_rows_in_every_fold():
    """In the inverse form its coefficient, in the forward form its ratio to that of the drive."""
    pulse = Term.of("external_force", {"edges": ((0.1, 0.2),)})
    bank = _bank(3, [1.0, 1.0, 0, 0, 0, 0, 0])
    column = np.zeros(ROWS)
    column[130:160] = 1.0
    bank.by_term[pulse] = [column]
    bank.drives = {tap: x + 5.0 * column for tap, x in bank.drives.items()}
    blocks = lay_blocks([ROWS], GAP, "x")
    fit = Solver(bank, blocks, J0).fit((pulse,), 0)
    assert fit.total[2] == pytest.approx(5.0, abs=0.5)
    assert (fit.folds[:, 2] == fit.total[2]).all()
    np.testing.assert_allclose(fit.forward_folds[:, 3] / fit.forward_folds[:, 0], fit.forward[3] / fit.forward[0])
    rows = np.stack(bank.design((pulse,), 0).rows)
    for b in range(blocks.count):
        left = fit.forward_folds[blocks.fold[b]] @ rows[:, blocks.block_of_rows() == b]
        assert fit.losses[b] == pytest.approx(float(left @ left))


def test_the_best_delay_is_the_one_with_least_squares():
    rng = np.random.default_rng(9)
    u = np.convolve(rng.normal(size=ROWS + 400), np.hanning(60) / 30.0, "same")
    drives = {tap: u[200 - tap : 200 - tap + ROWS] for tap in range(130)}
    a = drives[57] + 0.01 * rng.normal(size=ROWS)
    solver = Solver(Columns(drives, a, {}), lay_blocks([ROWS], GAP, "x"))
    squares = [solver.squares((), tap) for tap in range(120)]
    assert best_delay(solver, (), 119) in (int(np.argmin(squares)), 56, 57)
    assert squares[best_delay(solver, (), 119)] <= 1.01 * min(squares)


@pytest.mark.parametrize("believed", [0.0, 0.1])
def test_of_delays_that_explain_as_much_the_one_that_is_believed_is_taken(believed):
    """u repeats every 0.1 s, and so do delays that leave noise alone; shares of further steps make up for a few."""
    noise, angle = np.random.default_rng(9), 2.0 * np.pi * np.arange(ROWS + 400) / 100.0
    u = np.sin(angle) + 0.3 * np.sin(2.0 * angle)
    drives = {tap: u[200 - tap : 200 - tap + ROWS] for tap in range(130)}
    solver = Solver(Columns(drives, drives[10] + 0.1 * noise.normal(size=ROWS), {}), lay_blocks([ROWS], GAP, "x"))
    assert best_delay(solver, (), 119, believed=believed) == pytest.approx(10 + 1e3 * believed, abs=4)


@pytest.mark.parametrize("true", [0, 2, 57, 119])
def test_a_delay_that_is_about_right_only_makes_the_search_shorter(true):
    """From near by, and from far off and the ends of what is allowed, where all are tried."""
    rng = np.random.default_rng(9)
    u = np.cumsum(rng.normal(size=ROWS + 400))
    drives = {tap: u[200 - tap : 200 - tap + ROWS] for tap in range(130)}
    asked: list[int] = []

    class Counted(Solver):
        def squares(self, terms, tap, keep=True):
            asked.append(tap)
            return super().squares(terms, tap, keep)

    solver = Counted(Columns(drives, drives[true] + 0.01 * rng.normal(size=ROWS), {}), lay_blocks([ROWS], GAP, "x"))
    wanted = best_delay(solver, (), 119)
    every = len(asked)
    assert abs(wanted - true) <= 1
    for near in (true, true + 3, max(true - 3, 0), 0, 30, 119, 500):
        asked.clear()
        assert best_delay(solver, (), 119, near) == wanted, near
        assert len(asked) == len(set(asked))
        if near == true and true in (2, 57):
            assert len(asked) < 0.4 * every


# -- noise in the acceleration ----------------------------------------------------------------------------------------


def test_noise_of_known_variance_no_longer_pulls_the_inertia_down():
    """200 draws of white noise in the acceleration, a fifth of its power: without the correction J is a sixth low."""
    clean, plain, corrected = _bank(21, [2.0, 0.5, 1.0, 0.0, 0, 0, 0], noise=0.2), [], []
    rng, a = np.random.default_rng(22), clean.acceleration
    blocks = lay_blocks([ROWS], GAP, "x")
    for _ in range(200):
        seen = a + np.sqrt(0.2) * rng.normal(size=ROWS)
        for variance, found in (((), plain), ((0.2,), corrected)):
            bank = Columns(clean.drives, seen, clean.by_term, variance)
            fit = Solver(bank, blocks).fit((VISCOUS,), 0)
            found.append([fit.total[INERTIA], fit.folds[:, INERTIA].mean()])
    truth = Solver(clean, blocks).fit((VISCOUS,), 0)
    wanted = np.array([truth.total[INERTIA], truth.folds[:, INERTIA].mean()])
    error = np.std(corrected, axis=0) / np.sqrt(200)
    assert (np.mean(plain, axis=0) < 0.9 * wanted).all()
    assert (np.abs(np.mean(corrected, axis=0) - wanted) < 4.0 * error + 0.004 * wanted).all()


def test_on_rows_of_a_noisy_position_the_inertia_is_unbiased():
    """60 logs: u = J a held, position with white noise, variance of a row by the band; J within 4 standard errors."""
    step, inertia, size, found, plain = 0.002, 0.5, 3e-5, [], []
    t = step * np.arange(2000)
    rng = np.random.default_rng(31)
    for _ in range(60):
        tones = rng.uniform(1.0, 12.0, 8), rng.uniform(0.0, 6.3, 8)
        u = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(*tones, strict=True))
        speed = np.concatenate([[0.0], np.cumsum(u[:-1])]) * step / inertia
        ends = 0.5 * (speed[1:] + speed[:-1]) * step  # exact under a held u
        position = np.concatenate([[0.0], np.cumsum(ends)]) + size * rng.normal(size=len(t))
        recording = prepare(Log({"t": t, "u": u, "position": position}, step, "x"), ObserverSettings(inertia, 0.01))
        equations = equations_of([recording], 40, band_of(40.0, step))
        noise = SensorNoise("position", 0.0, (size / step**2) ** 2)
        variance = passed_variance(np.ones(1), equations.band, noise)
        blocks = lay_blocks(equations.lengths, 5, "x")
        found.append(Solver(Bank(equations, variance=variance), blocks).fit((), 0).total[INERTIA])
        plain.append(Solver(Bank(equations), blocks).fit((), 0).total[INERTIA])
    error = np.std(found) / np.sqrt(60)
    assert abs(np.mean(found) - inertia) < 4.0 * error
    assert np.mean(plain) < inertia - 10.0 * error, "else bias would not be seen"


@settings(max_examples=30)
@given(st.integers(0, 1000), st.lists(st.floats(-3.0, 3.0), min_size=7, max_size=7), st.floats(0.0, 0.5))
def test_many_sets_at_once_leave_what_each_leaves_alone(seed, theta, noise):
    bank = _bank(seed, theta, variance=(noise,))
    solver = Solver(bank, lay_blocks([ROWS], GAP, "x"), J0)
    sets = [terms for n in range(4) for terms in combinations((VISCOUS, COULOMB, LOAD, GRAVITY), n)]
    bank.drives[2] = bank.drives[1] - bank.acceleration
    for tap, asked in ((0, sets[:5]), (0, sets), (1, sets)):  # what is kept of one delay is no answer at another
        found = solver.squares_of(asked, tap)
        assert list(found) == asked
        for terms in asked:
            assert found[terms] == pytest.approx(solver.squares(terms, tap), rel=1e-9, abs=1e-9)


def test_a_set_that_was_fitted_is_not_fitted_again():
    """A search comes by the same sets from several sides."""
    bank, made = _bank(5, [3.0, 1.0, 2.0, 0.5, -1.0, 0.5, -2.0]), []
    design = bank.design
    bank.design = lambda *arguments: made.append(arguments) or design(*arguments)
    solver = Solver(bank, lay_blocks([ROWS], GAP, "x"), J0)
    first = solver.fit((VISCOUS,), 0)
    assert solver.fit((VISCOUS,), 0) is first
    assert len(made) == 1
    assert solver.fit((VISCOUS,), 0, whole_steps=True).total[1] == 0.0 != first.total[1]
    assert solver.fit((LOAD,), 0).terms == (LOAD,)
