"""Inner products of rows tell what least squares over the rows themselves tells."""

import numpy as np
import pytest

from dsd_cli.design.rows import equations_like, left
from dsd_cli.identify.fit.band import band_of
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.row_weights import uncertain
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.verdict.diagnose import Settings
from tests.identify.comparison_rig import BELIEVED, MOVES, recorded


def test_left_is_what_least_squares_leaves() -> None:
    random = np.random.default_rng(1)
    rows = random.normal(size=(5, 5, 40))
    found = left(np.einsum("kin,kjn->kij", rows, rows), target=1)
    for some, squares in zip(rows, found, strict=True):
        others = np.delete(some, 1, axis=0).T
        residual = some[1] - others @ np.linalg.lstsq(others, some[1], rcond=None)[0]
        np.testing.assert_allclose(squares, residual @ residual, rtol=1e-6)


def test_rows_of_zeros_and_padding_explain_nothing() -> None:
    random = np.random.default_rng(2)
    rows = random.normal(size=(4, 30))
    gram = np.zeros((1, 7, 7))
    gram[0, :4, :4] = rows @ rows.T
    np.testing.assert_allclose(left(gram, 1), left(gram[:, :4, :4], 1), rtol=1e-9)


def test_where_the_axis_rests_no_direction_of_friction_is_in_doubt() -> None:
    """There friction holds it, whatever u; it turns within a few samples."""
    log = recorded({"coulomb_friction": {"level": 0.1}}, reference=MOVES, duration=6.0)
    equations = pose([log], BELIEVED, Settings()).equations
    resting, turning = uncertain(equations), uncertain(equations, resting=False)
    rests = np.mean(np.concatenate([s.free == 0.0 for s in equations.stretches]))
    assert np.all(turning <= resting + 1e-9)
    assert rests > 0.05
    assert np.mean(resting) - np.mean(turning) == pytest.approx(rests, rel=0.3)


def test_where_few_rows_are_sure_of_friction_all_count_as_in_the_search() -> None:
    """Rows of a narrow band are long: hardly one of them is without a turn."""
    log = recorded({"coulomb_friction": {"level": 0.1}}, reference=MOVES, duration=6.0)
    known = pose([log], BELIEVED, Settings()).equations
    forms = ((known.band, known.whitening[0]), (band_of(2.0, log.sample_time), known.whitening[0]))
    many, few = (equations_like(form, log, BELIEVED.delay, held=True) for form in forms)
    with np.errstate(all="raise"):  # a motion of less than a count shows nothing, its direction neither
        assert equations_like((known.band, np.zeros(25)), log, BELIEVED.delay, held=True).row_weight is None
    assert few.counted == sum(few.lengths)
    assert many.counted == sum(uncertain(many)[many.kept] <= POLICY.unsure_share) < 0.8 * sum(many.lengths)
