"""Forms of real recordings: the d_hat that a drive would have logged, and which questions are held back."""

import numpy as np
import pytest

from bench.machines_cases import RECORDED, Recorded
from bench.machines_variants import _cut, _observed, held_back, table_of_forms


@pytest.mark.parametrize("logged", ["velocity", "position"])
def test_d_hat_of_forward_euler_is_the_force_that_acts_besides_u(logged: str) -> None:
    """A mass of 2 kg that is held against 3 N and then moved: Q {J a - u} is -3 all through."""
    step, tau = 1e-4, 0.02
    t = step * np.arange(2000)
    u = 3.0 + np.sin(20.0 * t)
    velocity = np.concatenate([[0.0], np.cumsum((u - 3.0) / 2.0 * step)[:-1]])
    position = np.concatenate([[0.0], np.cumsum(velocity)[:-1] * step])
    case = Recorded("a mass", (), {}, 2.0, tau=tau)
    motion = {"velocity": velocity} if logged == "velocity" else {"position": position}
    d_hat = _observed({"time": t, "u": u, **motion}, case)["d_hat"]
    np.testing.assert_allclose(d_hat, -3.0, atol=0.01)


def test_halves_are_of_rows() -> None:
    columns = {"time": np.arange(10.0)}
    assert _cut(columns, (0.25, 0.75))["time"].tolist() == [2.0, 3.0, 4.0, 5.0, 6.0]


def test_a_third_of_the_questions_is_held_back_by_their_names() -> None:
    names = [f"{case.name}, {form}" for case in RECORDED for form in ("first half", "every 2nd row", "u and d_hat")]
    assert 0.2 < np.mean([held_back(name) for name in names]) < 0.45


def test_what_the_regression_does_not_find_is_not_asked_for() -> None:
    row = {"engine": "here", "musts": 3, "met": 1, "hidden": ["coulomb_friction"], "violated": ["gravity"]}
    rows = [
        row | {"name": f"arm, {form}", "verdict": "unknown", "seconds": 2.0} for form in ("first half", "link side")
    ]
    assert table_of_forms(rows)[2:] == [
        "| first half | 1 | 1 of 2; 1; 0; 2 s |",
        "| other files, columns, groups | 1 | 1 of 2; 1; 0; 2 s |",
        "| all | 2 | 2 of 4; 2; 0; 4 s |",
    ]
