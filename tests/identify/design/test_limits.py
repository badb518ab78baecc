"""What is left of a limit for the noise that a loop carries from its sensor into u."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.design.limits import noise_of_u
from dsd_cli.identify.fit.band import band_of
from dsd_cli.identify.fit.equations import equations_of
from dsd_cli.signals.log import with_channels
from tests.identify.comparison_rig import MOVES, T, recorded


def test_noise_of_u_is_what_lies_above_the_band_whatever_moves_the_axis() -> None:
    """White noise of 0.1 beside a sine of 5 within the band of 5 Hz: 99.9 % of it are within 3.29 deviations."""
    known = equations_of([recorded(reference=MOVES, duration=8.0)], 10, band_of(5.0, T))
    (stretch,) = known.stretches
    t = stretch.log["t"]
    u = 5.0 * np.sin(2.0 * np.pi * 2.0 * t) + np.random.default_rng(3).normal(0.0, 0.1, len(t))
    moved = replace(stretch, log=with_channels(stretch.log, u=u))
    assert noise_of_u(replace(known, stretches=(moved,))) == pytest.approx(0.329, rel=0.15)
