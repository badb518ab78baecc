"""The axis of time, and what is drawn of long signals, against plain loops."""

from dataclasses import replace

import numpy as np
import pytest

from dsd_cli.identify.recordings.recording import prepare
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.report.page.drawing import _numbers, _times, drawing
from dsd_cli.report.page.html import data
from dsd_cli.report.page.series import CLOUD, _medians, views
from dsd_cli.report.page.story import Outcome, Story
from dsd_cli.report.page.timebase import laid_out, onward
from dsd_cli.signals.log import Log, with_channels
from dsd_cli.signals.units import Units

OBSERVER = ObserverSettings(1.0, 0.01)


def recording(seconds: float, name: str = "a.csv", start: float = 0.0, seed: int = 1):
    """A mass of 1 with viscous friction of 0.5 under a u that turns, 1 kHz."""
    t = np.arange(0.0, seconds, 1e-3)
    random = np.random.default_rng(seed)
    u = np.sign(np.sin(2.0 * np.pi * 0.7 * t)) + 0.3 * np.sin(9.0 * t)
    v, q = np.zeros_like(t), np.zeros_like(t)
    for i in range(1, t.size):
        v[i] = v[i - 1] + 1e-3 * (u[i - 1] - 0.5 * v[i - 1])
        q[i] = q[i - 1] + 1e-3 * v[i - 1]
    channels = {"t": t + start, "u": u, "position": q, "velocity": v + 1e-4 * random.normal(size=t.size)}
    return prepare(Log(channels, 1e-3, name), OBSERVER)


def test_logs_follow_each_other_and_stamps_that_begin_anew_go_on():
    base = laid_out([("a", np.array([100.0, 101.0])), ("a", np.array([103.0, 104.0])), ("a", np.array([50.0, 52.0])),
                     ("b", np.array([1e9, 1e9 + 3.0]))])  # fmt: skip
    assert [t.tolist() for t in base.times] == [[0, 1], [3, 4], [6, 8], [11, 14]]
    assert [(one.name, one.start, one.end) for one in base.logs] == [("a", 0, 8), ("b", 11, 14)]
    t, x = base.joined([np.ones(2)] * 4)
    assert np.isnan(x).tolist() == [False, False, True] * 3 + [False, False]
    assert (np.diff(t) > 0.0).all(), "curves are joined by their times"
    rows = np.array([100.0, 101.0, 103.0, 104.0, 50.0, 52.0])
    assert onward(rows, base.logs[0]).tolist() == [0, 1, 3, 4, 4, 6]


def test_bins_without_rows_break_the_curve_of_medians():
    """Rows at -1 and 1 alone: two points, and a NaN between them at a place of its own."""
    x = np.repeat([-1.0, 1.0], 50) + np.linspace(0.0, 1e-3, 100)
    at, median = _medians(x, np.sign(x))
    assert (np.diff(at) > 0.0).all()
    assert median[0] == -1.0
    assert median[-1] == 1.0
    assert np.isnan(median[1:-1]).all()


@pytest.fixture(scope="module")
def found():
    models = [PlantModel(1.0, 0.0), PlantModel(1.0, 0.0, {"viscous_friction": {"coefficient": 0.5}})]
    return views([recording(3.0), recording(2.0, "b.csv", 500.0, 2)], models, OBSERVER)


def test_residual_is_measured_less_predicted_and_falls_with_the_right_model(found):
    assert found.channels["d_hat"][0].size == found.samples + 1  # one break between the logs
    assert all((np.diff(t) > 0.0).all() for t, _ in [*found.channels.values(), *found.force, *found.residual])
    d_hat, predicted, residual = found.channels["d_hat"][1], found.predicted[0][1], found.residual[0][1]
    seen = np.isfinite(residual)
    assert np.abs(d_hat[seen] - predicted[seen] - residual[seen]).max() < 1e-12
    assert not seen[:50].any(), "the first rows rest on a u from before the log"
    before, after = (np.sqrt(np.nanmean(r**2)) for _, r in found.residual)
    assert after < 0.2 * before


def test_the_force_residual_of_a_missing_damper_is_its_force(found):
    """r = J a - u of an axis whose friction is -0.5 v is that."""
    cloud = next(c for c in found.clouds if c.on == "velocity")
    assert set(cloud.medians) == {"forward, median", "backward, median"}
    for curves in cloud.medians.values():
        x, r = curves[0]
        x, r = x[np.isfinite(r)], r[np.isfinite(r)]
        inner = np.abs(x) < 0.95 * np.abs(x).max()  # at the top speed u jumps, which a band smears
        assert inner.sum() > 10
        assert np.abs(r + 0.5 * x)[inner].max() < 0.01
        later = curves[1][1][np.isfinite(curves[1][1])]
        assert np.abs(later)[inner].max() < 0.01
    assert cloud.x.size <= CLOUD
    assert (np.diff(cloud.x) >= 0.0).all()


def test_a_peak_of_a_long_log_is_drawn():
    long = recording(30.0)
    u = np.array(long.pieces[0]["u"])
    u[12_345] = 77.0
    long = replace(long, pieces=(with_channels(long.pieces[0], u=u), *long.pieces[1:]))
    seen = views([long], [PlantModel()], OBSERVER)
    t, u = seen.channels["u"]
    assert t.size <= seen.points < 30_000
    assert np.nanmax(u) == 77.0
    assert t[np.nanargmax(u)] == pytest.approx(12.345)


def test_a_long_ladder_over_a_long_log_stays_below_5_mb():
    """Longer logs give no more points than this one: every curve is at its limit."""
    damped = [PlantModel(1.0, 0.0, {"viscous_friction": {"coefficient": 0.05 * k}}) for k in range(11)]
    seen = views([recording(20.0)], damped, OBSERVER, more=4)
    assert all(t.size > 0.6 * seen.points for t, _ in seen.residual)
    nothing = Outcome(None, "")
    story = Story(("a.csv",), (), (), (), nothing, nothing, nothing, Outcome(seen), "", "", "", "", Units())
    assert 1e6 < len(data(drawing(story))) < 4.5e6


def test_numbers_and_times_keep_what_a_picture_shows():
    assert _numbers(np.array([1.234567, np.nan, -1e-9, 0.0])) == [1.2346, None, -1e-9, 0.0]
    t = np.arange(0.0, 600.0, 1e-3)
    assert np.abs(np.array(_times(t)) - t).max() <= 1e-6
