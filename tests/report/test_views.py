"""What pictures show, as numbers: against plain loops and against forces that are known."""

import math
import random
import statistics
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from dsd_cli.detect.watched import Seen
from dsd_cli.identify.checks import CheckResult, Excitation, Parameter
from dsd_cli.identify.compare.balance import Balance, Forces, balance_of
from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.identify.results import Estimate, Score, Step
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.report.figure import FORMATS, binned_median, channel_label, rendered, sheet, shortened, thinned
from dsd_cli.report.plots_channels import constants, panels_of
from dsd_cli.report.plots_check import BEYOND, relative_errors
from dsd_cli.report.plots_detection import likely_states, ribbon, unsure
from dsd_cli.report.plots_ladder import Cell, values_by_step
from dsd_cli.report.timeline import TimedPiece, gaps, timeline
from dsd_cli.report.views_comparison import curves_over, spectrum_of
from dsd_cli.report.views_diagnosis import addition_view, residual_views
from dsd_cli.signals.log import Log
from dsd_cli.signals.units import Units
from tests.report.examples import ADDITION, DIAGNOSIS, FRICTION, GIVEN, recording

T = 1e-3


def test_medians_of_bins_are_those_of_plain_loops_and_one_wild_sample_bends_nothing() -> None:
    draw = random.Random(2)
    x = [draw.uniform(-3.0, 5.0) for _ in range(4000)]
    y = [value**2 + draw.gauss(0.0, 0.1) for value in x]
    y[17] = 1e9
    width = (max(x) - min(x)) / 20
    rows: dict[int, list[int]] = {}
    for i, value in enumerate(x):
        rows.setdefault(math.floor(value / width), []).append(i)
    at, middle = binned_median(np.array(x), np.array(y), 20)
    expected = [rows[k] for k in sorted(rows)]
    assert min(map(len, expected)) >= 5
    assert at.tolist() == pytest.approx([statistics.median(x[i] for i in part) for part in expected])
    assert middle.tolist() == pytest.approx([statistics.median(y[i] for i in part) for part in expected])


def test_neighbours_are_taken_together_until_they_say_something_but_not_over_zero() -> None:
    x = np.array([-2.5, -1.5, -0.5, 0.5, 1.5, 2.5])
    at, middle = binned_median(x, np.sign(x), 5, least=2)
    assert at.tolist() == [-2.0, 1.0]
    assert middle.tolist() == [-1.0, 1.0]


def test_a_hole_in_the_channel_breaks_the_curve() -> None:
    x = np.concatenate([np.linspace(0.0, 1.0, 500), np.linspace(9.0, 10.0, 500)])
    at, middle = binned_median(x, np.ones(x.size), 20)
    assert np.isnan(at).sum() == 1
    assert np.array_equal(np.isnan(at), np.isnan(middle))
    assert binned_median(np.zeros(0), np.zeros(0), 5)[0].size == 0
    same = binned_median(np.full(40, 3.0), np.arange(40.0), 5)
    assert (same[0].tolist(), same[1].tolist()) == ([3.0], [19.5])


def test_a_cloud_keeps_what_sticks_out() -> None:
    random_ = np.random.default_rng(1)
    x, y = random_.normal(size=50_000), random_.normal(size=50_000)
    y[31_234], y[100] = 99.0, np.nan
    some_x, some_y = thinned(x, y, 1000)
    assert some_x.size == 1000
    assert some_y.max() == 99.0
    assert set(zip(some_x.tolist(), some_y.tolist(), strict=True)) <= set(zip(x.tolist(), y.tolist(), strict=True))


def test_logs_lie_one_after_the_other_and_gaps_stay() -> None:
    first, later = np.arange(5.0), np.arange(8.0, 10.0)
    time = timeline(
        [TimedPiece("a", first), TimedPiece("a", later), TimedPiece("b", first), TimedPiece("a", first, aside=True)]
    )
    assert [t[0] for t in time.times] == [0.0, 8.0, 9.0, 13.0]
    assert [(log.name, log.start, log.end, log.aside) for log in time.logs] == [
        ("a", 0.0, 9.0, False),
        ("b", 9.0, 13.0, False),
        ("a", 13.0, 17.0, True),
    ]
    t, x = time.joined([np.ones(part.size) for part in time.times])
    assert np.isnan(x).sum() == 4
    assert all(b >= a for a, b in pairwise(t))


def test_stamps_of_a_calendar_are_counted_from_a_whole_second() -> None:
    time = timeline([TimedPiece("a", 1.7e9 + 0.25 + np.arange(3.0))])
    assert time.times[0].tolist() == [0.25, 1.25, 2.25]
    assert time.label == "time since 1700000000 s (s)"
    assert timeline([TimedPiece("a", np.arange(3.0))]).label == "time (s)"


def test_gaps_are_where_time_does_not_go_on() -> None:
    t = np.array([0.0, 1.0, 2.0, 3.0, 20.0, 21.0, 22.0, 5.0, 6.0])
    assert gaps(t).tolist() == [4, 7]
    assert gaps(t[:2]).size == 0


def moved(friction: float, level: float) -> tuple[Log, PlantModel]:
    """A mass of 2 kg under a known u, with Coulomb friction that the model has at `level`; by plain Euler steps."""
    u, v, q, rows = 0.0, 0.0, 0.0, []
    for k in range(6000):
        u = 8.0 * math.cos(2.0 * math.pi * 0.7 * k * T)
        rows.append((k * T, u, v, q))
        force = u - math.copysign(friction, v if v else u)
        q, v = q + T * (v + 0.5 * T * force / 2.0), v + T * force / 2.0
    t, u, v, q = np.array(rows).T
    log = Log({"t": t, "u": u, "velocity": v, "position": q}, T, source="a.csv")
    return log, PlantModel(2.0, 0.0, {"coulomb_friction": {"level": level}})


def test_forces_as_measured_and_as_modelled_are_the_true_ones() -> None:
    log, model = moved(friction=0.8, level=0.5)
    balance = balance_of([prepare(log, ObserverSettings(1.3, 0.004))], model)
    assert isinstance(balance, Balance)
    forces, speed = balance.forces, balance.at_rows("velocity")
    for sign in (1.0, -1.0):
        fast = sign * speed > 0.5
        assert np.median(forces.measured[fast]) == pytest.approx(-0.8 * sign, abs=0.01)
        assert np.median(forces.modelled[fast]) == pytest.approx(-0.5 * sign, abs=0.01)
    curves = curves_over(balance.at_rows("position"), forces, np.sign(speed))
    assert [curve.name for curve in curves] == ["forward", "backward"]
    assert np.nanmedian(curves[0].measured) == pytest.approx(-0.8, abs=0.02)
    assert np.nanmedian(curves[1].modelled) == pytest.approx(0.5, abs=0.02)


def test_bins_are_as_fine_as_cogging() -> None:
    """40 periods of cogging over the range are seen in the curve, not averaged away, in 3 s at 1 kHz."""
    q = np.random.default_rng(4).uniform(0.0, 2.0 * math.pi, 3_000)
    force = np.sin(40.0 * q)
    (curve,) = curves_over(q, Forces(force, 0.0 * force), np.ones(q.size))
    crossings = np.count_nonzero(np.diff(np.sign(curve.measured[np.isfinite(curve.measured)])))
    assert 78 <= crossings <= 82
    assert np.nanmax(curve.measured) > 0.8


def test_the_spectrum_adds_up_to_the_mean_square_and_has_the_line_where_it_is() -> None:
    t = np.arange(20_000) * T
    noise = np.random.default_rng(7).normal(size=t.size)
    x = 2.0 * np.sin(2.0 * math.pi * 50.0 * t) + 0.1 * noise
    found = spectrum_of([x[:12_000], x[12_000:], x[:5]], T)
    step = found.frequency[1] - found.frequency[0]
    assert np.sum(found.amplitude**2) * step == pytest.approx(2.0 + 0.01, rel=0.02)
    assert found.frequency[found.amplitude.argmax()] == pytest.approx(50.0, abs=step)
    assert spectrum_of([x[:5]], T).amplitude.size == 0


def test_each_effect_of_the_set_has_its_own_view() -> None:
    """Of the two that were found each takes its force; what the set takes together is their sum."""
    both = FRICTION.changed(effects={"coulomb_friction": {"level": 0.52}, "constant_load": {"force": 0.2}})
    result = replace(DIAGNOSIS, found=("coulomb_friction", "constant_load"), whole_model=both)
    first, beside = residual_views(result, GIVEN, [recording()])
    assert (beside.effect, beside.beside, beside.on) == ("constant_load", ("coulomb_friction",), "t")
    fast = np.abs(beside_speed := first.x) > 2.0
    np.testing.assert_allclose(beside.explained[fast], 0.2, atol=0.02)
    extra = first.together - first.explained
    np.testing.assert_allclose(extra[fast], 0.2, atol=0.02)
    assert np.array_equal(np.sign(beside_speed), first.way)


def test_what_an_effect_that_is_added_takes_is_its_own_force() -> None:
    view = addition_view(ADDITION, GIVEN, [recording()])
    assert (view.on, view.effect, view.together) == ("velocity", "coulomb_friction", None)
    fast = np.abs(view.x) > 2.0
    np.testing.assert_allclose(view.explained[fast], -0.52 * np.sign(view.x[fast]), atol=0.02)
    assert np.median((view.residual * np.sign(view.x))[fast]) == pytest.approx(-0.52, abs=0.03)


def test_the_values_that_moved() -> None:
    def step(k: int, effect: str, inertia: float, error: float, **effects: dict[str, float]) -> Step:
        estimates = {"inertia": Estimate(inertia, error, "kg")}
        return Step(k, effect, Score(1.0, 1.0, 0.0, 0.0), estimates, PlantModel(inertia, 0.01, effects))

    friction = {"level": 0.5}
    steps = (
        step(0, "as given", 1.0, 0.01),
        step(1, "coulomb_friction", 1.02, 0.01, coulomb_friction=friction),
        step(2, "refit", 1.2, 0.01, coulomb_friction=friction),
        step(3, "coulomb_friction", 0.9, 0.01),
        step(4, "refit", 0.905, 0.0001),  # by fifty standard errors, but within what was known before
    )
    table = values_by_step(steps)
    assert [cell.change for cell in table["inertia"]] == ["", "", "up", "down", ""]
    assert [cell.text.split("\n")[0] for cell in table["inertia"]] == ["1", "1.02", "1.2", "0.9", "0.90500"]
    assert [cell.change for cell in table["coulomb_friction.level"]] == ["", "new", "", "", ""]
    assert table["coulomb_friction.level"][3] == Cell("")


def test_stretches_without_confidence() -> None:
    times = np.arange(6.0)
    assert unsure(times, np.array([0.0, 0.2, 1.0, 1.0, 0.0, 0.0])) == [(0.0, 2.0), (4.0, 5.0)]
    assert unsure(times, np.ones(6)) == []
    assert unsure(np.zeros(0), np.zeros(0)) == []


def test_the_ribbon_is_empty_in_a_gap() -> None:
    edges, share = ribbon(np.array([0.0, 1.0, 2.0, 9.0, 10.0]), np.ones((5, 2)))
    assert edges.tolist() == [0.0, 1.0, 2.0, 3.0, 9.0, 10.0, 11.0]
    assert np.isnan(share[3]).all()
    assert np.isfinite(np.delete(share, 3, axis=0)).all()


def test_the_likeliest_states_in_the_order_of_the_grid() -> None:
    share = np.array([[0.1, 0.5, 0.0, 0.4], [np.nan] * 4, [0.2, 0.1, 0.0, 0.7]])
    seen = Seen({}, (np.zeros(0), np.zeros(0)), (np.arange(3.0), share), ())
    assert likely_states(seen, 2) == [1, 3]


def test_a_truth_that_stays_is_a_word_and_no_panel() -> None:
    channels = {name: np.zeros(5) for name in ("t", "u", "velocity")}
    log = Log(channels | {"true_delay": np.full(5, 0.3), "true_inertia": np.arange(5.0)}, T)
    assert constants(log) == {"delay": 0.3}
    assert list(panels_of(log)) == ["u", "velocity", "inertia"]


def test_what_a_log_tells_of_each_value() -> None:
    parameters = (
        Parameter("inertia", "identified", 2.0, 0.02),
        Parameter("delay", "not", 0.0, 0.001),
        Parameter("gravity.phase", "weak", -0.5, 0.1),
        Parameter("gravity.amplitude", "not", 1.0, math.inf),
        Parameter("stiffness.coefficient", "not", math.nan, math.nan),
    )
    did = Excitation(None, 0, 0, None, None, 0.0)
    found = relative_errors(CheckResult("a.csv", (), parameters, None, None, did, 1.0, 10))
    assert found == {
        "inertia": (1.0, "identified"),
        "delay": (BEYOND, "not"),
        "gravity.phase": (20.0, "weak"),
        "gravity.amplitude": (BEYOND, "not"),
        "stiffness.coefficient": (BEYOND, "not"),
    }


def test_units_stand_on_the_axes_where_they_are_known() -> None:
    known, unknown = Units("N m", "rad"), Units()
    assert [channel_label(name, known) for name in ("t", "u", "velocity", "position", "inertia")] == [
        "time (s)",
        "u (N m)",
        "velocity (rad/s)",
        "position (rad)",
        "inertia (kg m^2)",
    ]
    assert [channel_label(name, unknown) for name in ("u", "inertia")] == ["u", "inertia"]
    assert channel_label("position", unknown) == "position (rad or m)"


def test_a_long_name_loses_its_middle() -> None:
    assert shortened("a" * 100 + ".csv", 20) == "a" * 9 + "..." + "a" * 4 + ".csv"
    assert len(shortened("x" * 1000, 33)) == 33
    assert shortened("short.csv") == "short.csv"


@pytest.mark.parametrize("suffix", [*FORMATS, ".PNG"])
def test_the_same_figure_is_the_same_file(suffix: str) -> None:
    def figure() -> object:
        one = sheet(3.0, 2.0)
        one.subplots().plot([0.0, 1.0], label="$x_{")
        return one

    assert rendered(figure, suffix) == rendered(figure, suffix)
