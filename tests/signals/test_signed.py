"""Least squares with signs, compiled and not, against the conditions of Karush, Kuhn and Tucker."""

import numpy as np
import pytest

from dsd_cli.signals.signed import COMPILED, signed

WAYS = [pytest.param(COMPILED, id="compiled", marks=pytest.mark.skipif(COMPILED is None, reason="not compiled")), None]


def _stack(seed, columns, matrices=3):
    x = np.random.default_rng(seed).standard_normal((matrices, 30, columns + 1))
    return np.einsum("mni,mnj->mij", x, x)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("columns", [1, 2, 5, 9])
@pytest.mark.parametrize("seed", range(6))
def test_no_sign_is_wrong_and_no_free_coefficient_can_do_better(columns, seed, way):
    stack, target = _stack(seed, columns), seed % (columns + 1)
    signs = np.random.default_rng(seed + 50).integers(-1, 2, columns).tolist()
    found = signed(stack, target, signs, way)
    others = [i for i in range(columns + 1) if i != target]
    size = np.sqrt(np.diag(stack[0])[others])
    gradient = (stack[0][others, target] - stack[0][np.ix_(others, others)] @ found[0]) / size
    there = found[0] != 0.0
    assert (np.array(signs) * found[0] >= 0.0).all()
    np.testing.assert_allclose(gradient[there], 0.0, atol=1e-6)
    assert (np.array(signs) * gradient <= 1e-6)[~there].all()
    for one, own in zip(stack, found, strict=True):  # what the first decides holds in all
        at = np.flatnonzero(there)
        rows = np.array(others)[at]
        np.testing.assert_allclose(own[at], np.linalg.solve(one[np.ix_(rows, rows)], one[rows, target]), rtol=1e-6)
        assert (own[~there] == 0.0).all()


@pytest.mark.parametrize("way", WAYS)
def test_columns_that_are_one_share_the_coefficient_and_none_is_needed(way):
    x = np.random.default_rng(1).standard_normal((40, 2))
    rows = np.column_stack([3.0 * x[:, 0], x[:, 0], x[:, 0]])
    np.testing.assert_allclose(signed((rows.T @ rows)[None], 0, [1, 1], way), [[1.5, 1.5]], rtol=1e-6)
    assert signed((x[:, :1].T @ x[:, :1])[None], 0, [], way).shape == (1, 0)


@pytest.mark.parametrize("way", WAYS)
def test_what_is_singular_is_said(way):
    gram = np.ones((1, 3, 3))
    gram[0, 1, 2] = gram[0, 2, 1] = 1.0 + 1e-9  # as much as the ridge adds to the columns' own products
    with pytest.raises(np.linalg.LinAlgError):
        signed(gram, 0, [0, 0], way)


@pytest.mark.skipif(COMPILED is None, reason="not compiled")
def test_the_compiled_part_refuses_what_does_not_fit():
    for stack, target, found in ((np.zeros((1, 3, 3)), 0, 1), (np.zeros((1, 2, 2)), 2, 1), (np.zeros((1, 2, 2)), 0, 2)):
        with pytest.raises(ValueError, match="a column for each sign"):
            COMPILED.solved(stack, target, np.zeros(1), 1e-9, 1e-7, np.zeros(found))
