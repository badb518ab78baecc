"""The picture of a tuning, as numbers: the path and the labels, against what the log is known to hold."""

import numpy as np
import pytest

from bench.beyond import _tuning_runs as runs
from dsd_cli.detect.tune.tuning import tune
from dsd_cli.report.figure import rendered
from dsd_cli.report.plots_tuning import apart, draw, looked_at
from dsd_cli.report.tuning import TuningReport
from dsd_cli.signals.units import Units


def test_labels_before_and_after_beside_what_the_whole_log_says() -> None:
    """The true inertia, 0.8, is no candidate of the config: the tuning adds it."""
    evidence, log = runs.evidence("steps of delay, J between candidates")
    tuning = tune(evidence)
    seen = looked_at(tuning)
    known = np.isfinite(seen.path["inertia"])
    assert known.sum() == tuning.samples
    for series in (seen.before, seen.after):
        assert all(np.array_equal(np.isfinite(values), known) for values in series.values())
    assert set(seen.before["inertia"][known]) <= set(evidence.engine.grid.inertias)
    assert np.median(seen.path["inertia"][known]) == pytest.approx(0.8, rel=0.01)
    same = np.all([seen.after[name][known] == seen.path[name][known] for name in ("delay", "inertia")], axis=0)
    assert float(np.mean(same)) == pytest.approx(tuning.after.agreement)
    true = log["true_delay"][: seen.t.size]
    assert np.mean(seen.path["delay"][known] == true[known]) > 0.95
    left = (seen.d_hat - seen.predicted)[known]
    assert 1.4826 * np.median(np.abs(left)) == pytest.approx(0.1, rel=0.05)  # as simulated
    figure = draw(TuningReport(tuning, "a.csv", None), Units("N m", "rad"))
    assert [axis.get_ylabel() for axis in figure.get_axes()] == [
        "d_hat (N m)",
        "residual (N m)",
        "delay (s)",
        "inertia (kg m^2)",
    ]
    assert [text.get_text() for text in figure.get_axes()[3].texts] == ["added"]
    assert rendered(lambda: figure, ".png").startswith(b"\x89PNG")


def test_ticks_without_room_for_their_text_are_left_out() -> None:
    assert apart(np.array([0.0, 0.0019, 0.002, 0.004])).tolist() == [0.0, 0.0019, 0.004]
    assert apart(np.array([1.0])).tolist() == [1.0]
