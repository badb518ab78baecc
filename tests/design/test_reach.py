"""What a motion shows of the catalogue's effects, against plain least squares."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.design.reach import Reach
from dsd_cli.design.rows import Model
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.policy import POLICY


def reach_of(random: np.random.Generator) -> tuple[Reach, np.ndarray]:
    """Two own columns beside inertia and delay, effects of two, one and one columns; rows of shape (9, 300)."""
    rows = random.standard_normal((9, 300))
    rows[8] = 0.999 * rows[7] + 0.03 * rows[8]  # hardly another effect than its neighbour
    rows[0] = rows[1] - rows[3] + 0.5 * rows[4]
    terms = tuple(Term.of(name, {}) for name in ("viscous_friction", "coulomb_friction"))
    model = Model(terms, 0.0, 0.001, np.zeros(8), (1, 1))
    return Reach(
        model, ("gravity", "stiffness", "quadratic_drag"), (slice(5, 7), slice(7, 8), slice(8, 9)), np.ones(4)
    ), rows


def left(target: np.ndarray, others: np.ndarray) -> float:
    found, *_ = np.linalg.lstsq(others.T, target, rcond=None)
    return float(np.sum((target - found @ others) ** 2))


def test_an_effect_is_shown_by_what_its_nearest_rival_and_the_own_balance_leave() -> None:
    reach, rows = reach_of(np.random.default_rng(7))
    own, groups = [1, 2, 3, 4], [[5, 6], [7], [8]]
    expected = [
        min(left(rows[i], rows[own + other]) for other in groups if i not in other) for group in groups for i in group
    ]
    np.testing.assert_allclose(reach.shown(rows @ rows.T), expected, rtol=1e-5)


def test_shapes_of_one_effect_are_no_rivals() -> None:
    """A bell over the speed that is a little wider takes all of one, and both are the same law."""
    reach, rows = reach_of(np.random.default_rng(7))
    alike = replace(reach, names=("gravity", "stribeck_friction", "stribeck_friction"))
    shown, apart = alike.shown(rows @ rows.T), reach.shown(rows @ rows.T)
    assert shown[2] == pytest.approx(left(rows[7], rows[[1, 2, 3, 4, 5, 6]]))
    assert apart[2] < 0.01 * shown[2]
    assert alike.shares == pytest.approx([0.25, 0.25, 0.25, 0.25])
    assert reach.shares == pytest.approx([1 / 6, 1 / 6, 1 / 3, 1 / 3])


def test_effects_are_as_large_as_is_of_use_where_they_show_best() -> None:
    """In the best motion the force has that share of the largest u, so that what is shown has no unit of the effect."""
    reach, rows = reach_of(np.random.default_rng(8))
    weak, strong = rows.copy(), rows.copy()
    weak[5:] *= 0.1
    strong[0] *= 2.0
    sized = reach.sized([weak @ weak.T, strong @ strong.T])
    force = np.sqrt(sized.sizes) * np.linalg.norm(strong[5:], axis=1)
    assert force == pytest.approx(POLICY.much_force * np.linalg.norm(strong[0]) * np.ones(4))
