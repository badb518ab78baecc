"""Standard errors by the jackknife: what they promise where blocks tell a value unequally, by Monte Carlo."""

import numpy as np
import pytest

from dsd_cli.identify.fit.covariance import Information
from dsd_cli.identify.fit.priors import correlations_of

BLOCKS, ROWS, LOGS = 12, 30, 2000


def share_inside(sizes, correlated, seed):
    """Of logs whose 95 % interval holds the truth; the regressor has these sizes in the blocks."""
    rng = np.random.default_rng(seed)
    x = np.repeat(sizes, ROWS) * rng.standard_normal((LOGS, BLOCKS * ROWS))
    noise = rng.standard_normal((LOGS, BLOCKS * ROWS))
    noise += np.repeat(correlated * rng.standard_normal((LOGS, BLOCKS)), ROWS, axis=1) * np.sign(x)
    y, inside = 2.0 * x + noise, 0
    for a, b in zip(x, y, strict=True):
        theta = float(a @ b) / float(a @ a)
        parts, left = a.reshape(BLOCKS, ROWS), (b - theta * a).reshape(BLOCKS, ROWS)
        known = Information(
            normal=np.array([[a @ a]]),
            normals=np.einsum("bn,bn->b", parts, parts)[:, None, None],
            scores=np.einsum("bn,bn->b", parts, left)[:, None],
            shapes=(),
        )
        error = float(np.sqrt(known.covariance(1.0, complete=True)[0, 0]))
        inside += abs(theta - 2.0) < 1.96 * error
    return inside / LOGS


@pytest.mark.parametrize(("telling", "correlated"), [(12, 0.0), (12, 1.0), (5, 1.0), (3, 1.0)])
def test_an_interval_holds_the_truth_however_few_blocks_tell_it(telling, correlated):
    """With three blocks of twelve that move fast, the scatter of all twelve says little: 93 to 97 % and not below."""
    sizes = np.where(np.arange(BLOCKS) < telling, 1.0, 0.1)
    assert 0.93 < share_inside(sizes, correlated, telling) < 0.985


def test_noise_beyond_all_information_leaves_a_value_open_and_no_variance_below_0():
    """Of two values whose columns are nearly one, less the sensor's noise: correlations had 150 digits."""
    normal = np.array([[1.0, 1.1], [1.1, 1.0]])
    spread = Information(normal, normal[None], np.zeros((1, 2)), ()).covariance(1.0)
    errors = np.sqrt(np.diag(spread))
    assert errors.min() > 1e3
    assert correlations_of(spread, errors, [False, False]) == pytest.approx(np.array([[1.0, -1.0], [-1.0, 1.0]]))
    assert not correlations_of(np.full((2, 2), -1.0), np.zeros(2), [False, False]).any()
