"""The zero of a sensor: seen where a channel rests at it, never where it does not move or is no number."""

import numpy as np
import pytest

from dsd_cli.signals.zero_offset import zero_offset

SWING = np.concatenate([np.zeros(50), np.sin(np.linspace(0.0, 20.0, 400))])


def test_a_channel_that_rests_off_zero_and_goes_to_both_sides_has_an_offset() -> None:
    assert zero_offset(1.65 + SWING) == pytest.approx(1.65)


@pytest.mark.parametrize(
    "x", [SWING, np.full(100, 5.0), np.append(1.65 + SWING, np.nan), np.array([]), 1.65 + np.abs(SWING)]
)
def test_none_about_zero_without_motion_without_numbers_and_to_one_side(x: np.ndarray) -> None:
    assert zero_offset(x) is None
