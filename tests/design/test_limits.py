"""What is left of a limit for the noise that a loop carries from its sensor into u."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.design.limits import noise_of_u
from dsd_cli.identify.fit.band import band_of
from dsd_cli.identify.fit.equations import equations_of
from dsd_cli.signals.log import Array, with_channels
from tests.identify.comparison_rig import MOVES, T, recorded


@pytest.mark.parametrize("wave", [np.sin, lambda x: np.sign(np.sin(x))], ids=["sine", "relay"])
def test_noise_of_u_is_what_lies_above_the_band_whatever_moves_the_axis(wave: Callable[[Array], Array]) -> None:
    """White noise of 0.1 beside 5 at 0.2 Hz, the band to 20 Hz: of it the largest of so many samples."""
    known = equations_of([recorded(reference=MOVES, duration=8.0)], 10, band_of(20.0, T))
    (stretch,) = known.stretches
    t = stretch.log["t"]
    u = 5.0 * wave(2.0 * np.pi * 0.2 * t) + np.random.default_rng(3).normal(0.0, 0.1, len(t))
    moved = replace(stretch, log=with_channels(stretch.log, u=u))
    moved_log = replace(known, stretches=(moved,))
    for seconds in (10.0, 0.5):
        random = np.random.default_rng(4).normal(0.0, 0.1, (200, round(seconds / T)))
        largest = float(np.median(np.abs(random).max(axis=1)))
        assert noise_of_u(moved_log, seconds) == pytest.approx(largest, rel=0.2)


def test_noise_of_u_is_the_answer_to_a_count_where_few_pass() -> None:
    """An axis that stands for most of a log: 20 counts, each of them 0.4 of u that fades in 5 ms."""
    known = equations_of([recorded(reference=MOVES, duration=8.0)], 10, band_of(20.0, T))
    (stretch,) = known.stretches
    t = stretch.log["t"]
    counts = np.cumsum(np.isin(np.arange(len(t)), np.arange(1, 21) * (len(t) // 50)))
    pulses = np.convolve(np.diff(counts, prepend=0), 0.4 * np.exp(-np.arange(40) * T / 0.005))[: len(t)]
    log = with_channels(stretch.log, u=np.sin(t) - pulses, position=1e-3 * counts)
    assert noise_of_u(replace(known, stretches=(replace(stretch, log=log),)), 10.0) == pytest.approx(0.4, rel=0.05)
