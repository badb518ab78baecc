"""Errors of models against plain loops: every row by the model that did not see its block, and recordings held out."""

import math
from dataclasses import replace

import pytest

from dsd_cli.identify.verdict.examination import Examination, Settings
from dsd_cli.plant.prediction import predict_d_hat
from tests.identify.comparison_rig import BELIEVED, MOVES, OBSERVER, recorded

HIDDEN = {"coulomb_friction": {"level": 0.1}, "viscous_friction": {"coefficient": 0.02}}
KNOWN = replace(BELIEVED, effects={"coulomb_friction": {"level": 0.05}, "viscous_friction": {"coefficient": 0.01}})


@pytest.fixture(scope="module")
def recordings():
    return [recorded(HIDDEN, seed=1, duration=6.0), recorded(HIDDEN, reference=MOVES, seed=2, duration=5.0)]


@pytest.fixture(scope="module")
def exam(recordings):
    return Examination(recordings, KNOWN, OBSERVER, Settings(effects=()))


def _errors(exam, model, pieces=None):
    """[(measured less predicted, measured)] of rows that count, piece by piece."""
    rest = max(r.rest_speed for r in exam.recordings)
    found = []
    for piece in pieces or [s.log for s in exam.equations.stretches]:
        predicted = predict_d_hat(replace(model, rest_speed=rest), piece, exam.observer)
        rows = range(exam.equations.startup, len(piece))
        found.append([(piece["d_hat"][k] - predicted[k], piece["d_hat"][k]) for k in rows])
    return found


def _rms(values):
    return math.sqrt(sum(x * x for x in values) / len(values))


def test_the_score_of_a_model_that_nothing_was_fitted_to(exam):
    score = exam.judge.fixed(KNOWN)
    rows = [pair for piece in _errors(exam, KNOWN) for pair in piece]
    errors, measured = [e for e, _ in rows], [y for _, y in rows]
    mean = sum(measured) / len(measured)
    assert score.rmse == pytest.approx(_rms(errors))
    assert score.heldout_rmse == score.rmse
    assert score.fit_percent == pytest.approx(100.0 * (1.0 - _rms(errors) / _rms([y - mean for y in measured])))


def test_every_row_is_judged_by_the_fit_that_did_not_see_its_block(exam):
    fit, blocks = exam.refit, exam.blocks
    score = exam.score(fit)
    by_fold = [_errors(exam, exam.scale.model(fit, fold)) for fold in range(blocks.folds)]
    block_of, at, total, rows = blocks.block_of_rows(), 0, 0.0, 0
    assert exam.equations.thinning == 1
    for i in range(len(exam.equations.stretches)):
        for k in range(len(by_fold[0][i])):
            total += by_fold[blocks.fold[block_of[at]]][i][k][0] ** 2
            at, rows = at + 1, rows + 1
    assert rows == blocks.rows
    assert score.heldout_rmse == pytest.approx(math.sqrt(total / rows))
    assert score.rmse == pytest.approx(_rms([e for piece in _errors(exam, exam.scale.model(fit)) for e, _ in piece]))
    assert score.heldout_rmse > score.rmse * 0.999


def test_the_models_of_the_folds_are_not_the_same(exam):
    levels = {exam.scale.model(exam.refit, fold).effects["coulomb_friction"]["level"] for fold in range(5)}
    assert len(levels) == 5


def test_held_out_recordings_are_the_judges_when_there_are_any(recordings, exam):
    other = recorded(HIDDEN, seed=9, duration=4.0)
    judged = Examination(recordings, KNOWN, OBSERVER, Settings(effects=()), [other])
    score = judged.score(judged.refit)
    model = judged.scale.model(judged.refit)
    (rows,) = _errors(judged, model, [other.pieces[0]])
    assert score.heldout_rmse == pytest.approx(_rms([e for e, _ in rows]))
    assert score.rmse == pytest.approx(exam.score(exam.refit).rmse)
    fixed = judged.judge.fixed(KNOWN)
    assert fixed.heldout_rmse == pytest.approx(_rms([e for e, _ in _errors(judged, KNOWN, [other.pieces[0]])[0]]))
    assert fixed.heldout_rmse != fixed.rmse


def test_a_fit_lowers_the_error_to_the_noise(exam):
    assert exam.judge.fixed(KNOWN).rmse > 1.5 * exam.score(exam.refit).rmse
    assert exam.score(exam.refit).rmse == pytest.approx(0.01, rel=0.1)
    assert exam.score(exam.refit).heldout_rmse == pytest.approx(0.01, rel=0.1)


def test_the_relative_error_is_one_of_force(exam):
    """100 rms(e) / rms(d_hat + Q u), the net force as the observer sees it."""
    score, total, rows = exam.judge.fixed(KNOWN), 0.0, 0
    p = math.exp(-exam.scale.sample_time / exam.observer.time_constant)
    for s in exam.equations.stretches:
        state = s.log["u"][0]
        for k in range(len(s.log)):
            state = p * state + (1 - p) * s.log["u"][max(k - 1, 0)]
            if k >= exam.equations.startup:
                total, rows = total + (s.log["d_hat"][k] + state) ** 2, rows + 1
    wanted = 100.0 * score.rmse / math.sqrt(total / rows)
    assert score.relative_error_percent == pytest.approx(wanted, rel=1e-6)
