"""Errors of fits and models against plain loops: rows by the fit that did not see their block, and recordings aside."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.fit.band import nearest_bands
from dsd_cli.identify.fit.bank import Bank
from dsd_cli.identify.fit.equations import equations_of
from dsd_cli.identify.fit.problem import Settings, pose
from dsd_cli.identify.fit.values import coefficients_of, terms_of
from dsd_cli.identify.search.sets import Search
from tests.identify.comparison_rig import BELIEVED, MOVES, recorded

HIDDEN = {"coulomb_friction": {"level": 0.1}, "viscous_friction": {"coefficient": 0.02}}
KNOWN = replace(BELIEVED, effects={"coulomb_friction": {"level": 0.05}, "viscous_friction": {"coefficient": 0.01}})


@pytest.fixture(scope="module")
def recordings():
    return [recorded(HIDDEN, seed=1, duration=6.0), recorded(HIDDEN, reference=MOVES, seed=2, duration=5.0)]


@pytest.fixture(scope="module")
def problem(recordings):
    return pose(recordings, KNOWN, Settings(effects=()))


@pytest.fixture(scope="module")
def fit(problem):
    return Search(problem).refit


def _rms(values):
    return math.sqrt(sum(float(x) ** 2 for x in values) / len(values))


def _rows(bank, model):
    """[(r, u)] of the rows that count, row by row."""
    terms = terms_of(model)
    tap, theta = coefficients_of(model, terms, bank.tap_time)
    rows = bank.design(terms, tap).rows
    found = []
    for k in np.flatnonzero(bank.equations.kept):
        found.append((rows[0][k] - sum(c * x[k] for c, x in zip(theta, rows[1:], strict=True)), rows[0][k]))
    return found


def test_the_score_of_a_model_that_nothing_was_fitted_to(problem):
    score = problem.errors.of_model(KNOWN)
    rows = _rows(problem.errors.bank, KNOWN)
    errors, u = [r for r, _ in rows], [x for _, x in rows]
    mean = sum(u) / len(u)
    assert score.rmse == pytest.approx(_rms(errors))
    assert score.heldout_rmse == score.rmse
    assert score.fit_percent == pytest.approx(100.0 * (1.0 - _rms(errors) / _rms([x - mean for x in u])))
    assert score.relative_error_percent == pytest.approx(100.0 * _rms(errors) / _rms(u))


def test_every_row_is_judged_by_the_fit_that_did_not_see_its_block(problem, fit):
    rows, blocks = problem.errors.bank.design(fit.terms, fit.tap).rows, problem.blocks
    fold_of, inverse, forward = blocks.fold[blocks.block_of_rows()], [], []
    for k in np.flatnonzero(problem.errors.equations.kept):
        theta = fit.folds[fold_of[k]]
        inverse.append(rows[0][k] - sum(c * x[k] for c, x in zip(theta, rows[1:], strict=True)))
        forward.append(sum(w * x[k] for w, x in zip(fit.forward_folds[fold_of[k]], rows, strict=True)))
    score = problem.score(fit)
    assert score.heldout_rmse == pytest.approx(_rms(inverse), rel=1e-9)
    assert problem.errors.rmse(fit) == pytest.approx(_rms(forward), rel=1e-9)
    assert score.rmse == pytest.approx(_rms([r for r, _ in _rows(problem.errors.bank, problem.scale.model(fit))]))
    assert score.heldout_rmse > score.rmse * 0.999


def test_residuals_are_those_of_the_forward_form_and_nothing_where_friction_may_hold(problem, fit):
    rows, kept = np.stack(problem.errors.bank.design(fit.terms, fit.tap).rows), problem.errors.equations.kept
    whole = problem.errors.residual(fit, held_out=False)
    np.testing.assert_allclose(whole[kept], (fit.forward @ rows)[kept], atol=1e-12)
    assert not kept.all()
    assert not whole[~kept].any()
    assert not problem.errors.residual(fit)[~kept].any()


def test_held_out_recordings_are_the_judges_when_there_are_any(recordings, problem, fit):
    other = recorded(HIDDEN, seed=9, duration=4.0)
    judged = pose(recordings, KNOWN, Settings(effects=()), [other])
    own = Search(judged).refit
    aside = Bank(equations_of([other], judged.equations.startup, nearest_bands(judged.equations.bands, [other])))
    score, fixed = judged.score(own), judged.errors.of_model(KNOWN)
    assert score.heldout_rmse == pytest.approx(_rms([r for r, _ in _rows(aside, judged.scale.model(own))]))
    assert score.rmse == pytest.approx(problem.score(fit).rmse)
    assert fixed.heldout_rmse == pytest.approx(_rms([r for r, _ in _rows(aside, KNOWN)]))
    assert fixed.heldout_rmse != fixed.rmse


def test_a_fit_lowers_the_error(problem, fit):
    assert problem.errors.of_model(KNOWN).rmse > 2.0 * problem.score(fit).rmse


def test_the_force_is_that_of_u_within_the_band(problem):
    rows = problem.errors.bank.drive((), 0)
    assert problem.errors.force == pytest.approx(_rms([rows[k] for k in np.flatnonzero(problem.errors.equations.kept)]))
