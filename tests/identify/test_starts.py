"""Where searches begin: lines of the residual over time and over the position, found to within their width."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.search.shapes import Lines, starts
from dsd_cli.identify.verdict.diagnose import Settings, diagnose
from dsd_cli.signals.log import with_channels
from dsd_cli.signals.peaks import LINES, peaks
from tests.identify.outside_rig import asked
from tests.identify.search_rig import MOVES, posed
from tests.oracle.rig import RigCase, make


def _lines(effects, **more):
    search = posed(effects, (), **more)
    return Lines(search.problem.errors, search.refit), search


@pytest.mark.parametrize("frequency", [0.9, 4.4, 17.3])
def test_a_disturbance_is_one_of_the_lines_in_time(frequency):
    found, search = _lines({"periodic_disturbance": {"amplitude": 0.1, "frequency": frequency, "phase": 1.0}})
    width = 1.0 / 10.0
    assert min(abs(f - frequency) for f in found.over_time[:2]) < 0.5 * width
    shapes = starts("periodic_disturbance", search.ranges, found)
    assert {s["frequency"] for s in shapes} >= set(found.over_time)
    assert len(found.over_time) <= LINES


@pytest.mark.parametrize("periods", [10.0, 21.0])
def test_cogging_is_one_of_the_lines_over_the_position(periods):
    found, search = _lines({"cogging": {"amplitude": 0.05, "periods": periods, "phase": 0.5}}, reference=MOVES)
    width = 2.0 * np.pi / search.ranges.travel
    assert min(abs(n - periods) for n in found.over_position) < 0.5 * width
    assert {s["periods"] for s in starts("cogging", search.ranges, found)} >= set(found.over_position)


def test_no_line_is_shorter_than_what_the_position_tells():
    """An encoder's counts are a ripple of as many periods per turn: a line has three counts at least."""
    found, _ = _lines({"cogging": {"amplitude": 0.05, "periods": 21.0, "phase": 0.5}}, reference=MOVES)
    count, limit = 2.0 * np.pi / 90.0, 90.0 / (10.0 / np.sqrt(12.0))
    assert max(found.over_position) > limit
    coarse = [replace(r, position_noise=count / np.sqrt(12.0)) for r in found._equations.recordings]
    blunt = Lines.__new__(Lines)
    blunt._equations, blunt._residual = replace(found._equations, recordings=tuple(coarse)), found._residual
    assert min(abs(n - 21.0) for n in blunt.over_position) < 1.0
    assert max(blunt.over_position) < limit


def test_no_line_lies_beyond_the_band_or_is_a_trend():
    for seed in range(4):
        found, search = _lines({"constant_load": {"force": 0.1}}, seed=seed, duration=4.0)
        assert all(2.0 / 4.0 < f <= search.equations.band.hz * 1.01 for f in found.over_time)


def test_an_axis_that_stays_has_no_lines_over_position():
    search = posed({}, (), duration=4.0)
    errors = search.problem.errors
    still = [replace(s, log=with_channels(s.log, position=np.ones(len(s.log)))) for s in errors.equations.stretches]
    found = Lines(errors, search.refit)
    found._equations = replace(errors.equations, stretches=tuple(still))
    assert isinstance(found._equations, Equations)
    assert found.over_position == ()


def test_other_effects_start_from_their_own_shapes():
    found, search = _lines({}, duration=4.0)
    lags = [s["time_constant"] for s in starts("actuator_lag", search.ranges, found)]
    assert lags == sorted(lags)
    assert len(lags) > 3
    assert starts("coulomb_friction", search.ranges, found) == [{}]


def test_peaks_are_local_maxima_above_their_surroundings_strongest_first():
    power = np.ones(400) + 0.01 * np.sin(np.arange(400))
    power[120], power[300], power[2] = 50.0, 90.0, 1e3
    assert peaks(power, 5)[:2] == [300, 120]
    assert len(peaks(power, 5)) <= LINES
    assert peaks(np.ones(6), 2) == []


def test_a_weak_line_on_a_low_floor_is_stronger_than_a_bump_on_a_high_one():
    floor = np.where(np.arange(1000) < 500, 1000.0, 1.0)
    power = floor * (1.0 + 0.01 * np.sin(np.arange(1000)))
    power[250], power[750] = 3000.0, 60.0
    assert peaks(power, 3)[0] == 750


@pytest.mark.parametrize(("seed", "sensing", "duration"), [(64003, "speed40k", 3.0), (64321, "udhat", 20.0)])
def test_a_limit_among_spikes_is_found(seed, sensing, duration):
    """Steps of the reference make spikes of one sample. 99 % of u lie far below the limit that these meet (it was
    "actuator_lag, 99 %"), or above it, while a delay that is too long speaks for a higher one."""
    (log,) = make([RigCase(what=("saturation",), seed=seed, sensing=sensing, duration=duration)])
    limit = log.truth["effects"]["saturation"]["limit"]
    recording, model, observer = asked(log)
    rivals = ("actuator_lag", "dead_zone", "load_friction", "viscous_friction", "coulomb_friction")
    found = diagnose([recording], model, observer, Settings(("saturation", *rivals)))
    assert found.verdict == "saturation"
    assert found.ranking[0].parameters["limit"].value == pytest.approx(limit, rel=0.02)
