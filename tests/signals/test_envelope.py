"""What a long signal's picture shows, against plain loops over its stretches."""

import math
import random

import numpy as np
import pytest

from dsd_cli.signals.envelope import envelope


def stretches(x, width):
    return [x[k : k + width] for k in range(0, len(x), width)]


def test_every_stretch_shows_its_lowest_and_its_highest_at_their_own_times():
    draw = random.Random(3)
    x = [draw.gauss(0.0, 1.0) for _ in range(10_007)]
    t = [0.5 + 0.001 * k for k in range(len(x))]
    shown_t, shown_x = envelope(np.array(t), np.array(x), 400)
    width = math.ceil(len(x) / 200)
    expected = []
    for k, part in enumerate(stretches(x, width)):
        places = sorted({part.index(min(part)), part.index(max(part))})
        expected += [(t[k * width + place], part[place]) for place in places]
    assert list(zip(shown_t, shown_x, strict=True)) == expected
    assert len(shown_x) <= 400


@pytest.mark.parametrize("spike", [0, 1, 4_999, 123_456, 599_999])
def test_one_sample_in_ten_minutes_at_1_khz_is_seen(spike):
    x = np.zeros(600_000)
    x[spike] = -7.0
    t, shown = envelope(np.arange(x.size) * 1e-3, x, 2_000)
    assert shown.min() == -7.0
    assert t[shown.argmin()] == spike * 1e-3
    assert shown.max() == 0.0


@pytest.mark.parametrize("x", [[], [1.0], [3.0, 1.0, 2.0], [1.0, math.nan, math.inf]])
def test_a_short_signal_is_shown_as_it_is(x):
    t = np.arange(len(x), dtype=float)
    shown_t, shown_x = envelope(t, np.array(x), 3)
    np.testing.assert_array_equal(shown_t, t)
    np.testing.assert_array_equal(shown_x, [value if math.isfinite(value) else math.nan for value in x])


def test_a_gap_breaks_the_line_wherever_it_lies():
    """Between the last sample shown before a gap and the first after it there is a NaN."""
    draw = random.Random(5)
    for _ in range(200):
        n = draw.randrange(100, 3_000)
        start = draw.randrange(n - 2)
        end = min(n - 1, start + draw.randrange(1, n))
        x = np.array([draw.gauss(0.0, 1.0) for _ in range(n)])
        x[start:end] = np.nan if draw.random() < 0.5 else np.inf
        t, shown = envelope(np.arange(n, dtype=float), x, 60)
        inside = (t >= start) & (t < end)
        assert inside.any()
        assert np.isnan(shown[inside]).all()
        assert np.isfinite(shown[~inside]).all()
        assert np.nanmin(shown) == np.min(x[np.isfinite(x)])
        assert np.nanmax(shown) == np.max(x[np.isfinite(x)])
        assert len(shown) <= 60
        assert (np.diff(t) > 0).all()


def test_a_signal_that_is_all_gap_stays_one():
    _, shown = envelope(np.arange(1_000.0), np.full(1_000, np.nan), 30)
    assert len(shown) >= 1
    assert np.isnan(shown).all()


def test_signals_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="one shape"):
        envelope(np.zeros(3), np.zeros(4), 10)
    with pytest.raises(ValueError, match="3 or more"):
        envelope(np.zeros(3), np.zeros(3), 2)
