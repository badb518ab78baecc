"""A fast axis that is logged slowly wraps every few rows: its position is that of the same axis without wraps."""

import numpy as np
import pytest

from dsd_cli.signals.continuous import unwrapped

TURNS = {"deg": 360.0, "rad": 2.0 * np.pi, "counts": 4096.0}


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS)
@pytest.mark.parametrize("rows_a_turn", [4.0, 10.0, 40.0])
def test_a_position_within_a_turn_goes_on(turn: float, rows_a_turn: float) -> None:
    t = np.arange(3000)
    q = turn * (t / rows_a_turn + 30.0 / rows_a_turn * np.sin(0.01 * t))
    found, wraps, size = unwrapped(np.mod(q, turn))
    assert (wraps > 10, size) == (True, turn)
    np.testing.assert_allclose(found - found[0], q - q[0], atol=1e-6 * turn)


def test_places_that_an_axis_goes_to_and_fro_between_in_one_row_are_no_wraps() -> None:
    rng = np.random.default_rng(5)
    q = np.repeat(np.arange(300) % 2, 10) + 1e-4 * rng.standard_normal(3000)
    assert unwrapped(q)[1] == 0


@pytest.mark.parametrize("stroke", [np.linspace(0.0, 100.0, 30), np.append(np.linspace(0.0, 360.0, 50), 180.0)])
def test_strokes_with_a_fast_way_back_are_no_wraps(stroke: np.ndarray) -> None:
    assert unwrapped(np.tile(stroke, 40))[1] == 0
