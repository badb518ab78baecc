"""Inner products of rows tell what least squares over the rows themselves tells."""

import numpy as np

from dsd_cli.identify.design.rows import left


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
