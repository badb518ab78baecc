"""Where searches begin: lines of the residual over time and over the position, found to within their width."""

import numpy as np
import pytest

from dsd_cli.identify.fit.bank import ranges
from dsd_cli.identify.search.starts import LINES, Residual, starts
from dsd_cli.identify.verdict.examination import Examination, Settings
from tests.identify.comparison_rig import BELIEVED, MOVES, OBSERVER, recorded


def _residual(effects, **more):
    exam = Examination([recorded(effects, **more)], BELIEVED, OBSERVER, Settings(effects=()))
    return Residual(exam.equations, exam.refit), exam


@pytest.mark.parametrize("frequency", [0.9, 4.4, 17.3])
def test_the_strongest_line_in_time_is_the_disturbance(frequency):
    found, exam = _residual(
        {"periodic_disturbance": {"amplitude": 0.1, "frequency": frequency, "phase": 1.0}}, duration=10.0
    )
    width = 1.0 / 10.0
    assert abs(found.lines_in_time()[0] - frequency) < 0.5 * width
    shapes = starts("periodic_disturbance", ranges(exam.equations), found)
    assert [s["frequency"] for s in shapes] == found.lines_in_time()
    assert len(shapes) <= LINES


@pytest.mark.parametrize("periods", [10.0, 33.0])
def test_the_strongest_line_over_position_is_the_cogging(periods):
    found, exam = _residual(
        {"cogging": {"amplitude": 0.05, "periods": periods, "phase": 0.5}}, reference=MOVES, duration=10.0
    )
    width = 2.0 * np.pi / ranges(exam.equations).travel
    assert min(abs(n - periods) for n in found.lines_over_position()) < 0.5 * width
    assert [s["periods"] for s in starts("cogging", ranges(exam.equations), found)] == found.lines_over_position()


def test_a_residual_is_what_the_fit_leaves_and_as_long_as_the_stretches():
    found, exam = _residual({}, duration=4.0)
    assert [len(x) for x in found.by_stretch()] == exam.equations.lengths
    assert np.std(found.values) == pytest.approx(0.01, rel=0.1)  # the noise on d_hat
    kept = exam.equations.kept
    np.testing.assert_allclose(found.values[kept], exam.plain.residual(exam.refit, held_out=False)[kept], atol=1e-9)


def test_an_axis_that_stays_has_no_lines_over_position():
    found, exam = _residual({}, duration=4.0)
    for s in exam.equations.stretches:
        s.motion.position[:] = 1.0
    assert found.lines_over_position() == []


def test_other_effects_start_from_their_own_shapes():
    found, exam = _residual({}, duration=4.0)
    span = ranges(exam.equations)
    lags = [s["time_constant"] for s in starts("actuator_lag", span, found)]
    assert lags == sorted(lags)
    assert len(lags) > 3
    assert starts("coulomb_friction", span, found) == [{}]
