"""A gain that falls with the command: the law beyond the command at which nothing more comes."""

import numpy as np
import pytest

from dsd_cli.effects import Channels, get_effect

C = 0.6
TURN = 0.5 / C


def force(u: np.ndarray) -> np.ndarray:
    effect = get_effect("gain_droop")
    factors, shape = effect.split({"droop": C}, 1.0)
    zero = np.zeros_like(u)
    return u + factors[0] * effect.columns(Channels(zero, u, zero, zero), shape)[0]


def test_more_command_is_never_less_force():
    """u (1 - c |u|) alone would turn round: at 1/c nothing is left, and beyond it the axis goes the other way."""
    u = np.linspace(-4.0 / C, 4.0 / C, 2001)
    got = force(u)
    assert np.all(np.diff(got) >= -1e-12)
    inside = np.abs(u) <= TURN
    np.testing.assert_allclose(got[inside], (u * (1.0 - C * np.abs(u)))[inside], atol=1e-12)
    np.testing.assert_allclose(got[~inside], np.sign(u[~inside]) / (4.0 * C), atol=1e-12)


@pytest.mark.parametrize("droop", [0.0, 1e-200])
def test_none_is_no_force(droop):
    effect = get_effect("gain_droop")
    factors, shape = effect.split({"droop": droop}, 1.0)
    assert factors[0] * effect.columns(Channels(0.0, 3.0, 0.0, 0.0), shape)[0] == pytest.approx(0.0, abs=1e-12)
