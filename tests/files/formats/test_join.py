"""Channels of different rates on one clock, against plain loops over what each channel did between two rows."""

from bisect import bisect_right
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.command import Command
from dsd_cli.files.formats.join import Sampled, join
from dsd_cli.files.logs import load_log
from tests.files.formats.test_formats import read


def held_mean(t: list[float], u: list[float], begin: float, end: float) -> float:
    """The mean of a held signal over [begin, end), from its pieces one by one."""
    total, edges = 0.0, [*t, t[-1] + (t[1] - t[0])]
    for value, left, right in zip(u, edges, edges[1:], strict=False):
        total += value * max(0.0, min(right, end) - max(left, begin))
    return total / (end - begin)


def on_the_line(t: list[float], x: list[float], at: float) -> float:
    k = max(1, min(len(t) - 1, bisect_right(t, at)))
    return x[k - 1] + (x[k] - x[k - 1]) * (at - t[k - 1]) / (t[k] - t[k - 1])


def test_a_fast_u_is_averaged_over_the_rows_of_a_slow_sensor() -> None:
    rng = np.random.default_rng(1)
    fast, slow = np.arange(1000) * 1e-3, 0.0003 + np.arange(240) * 4e-3
    u, v = rng.normal(size=1000) + 1e6, rng.normal(size=240)
    done = join("log", [Sampled("drive/t", fast, {"u": u}), Sampled("axis/t", slow, {"velocity": v})])
    np.testing.assert_array_equal(done.t, slow)
    np.testing.assert_array_equal(done.values["velocity"], v)
    expected = [held_mean(fast.tolist(), u.tolist(), a, b) for a, b in pairwise(slow)]
    np.testing.assert_allclose(done.values["u"][:-1], expected, rtol=0, atol=1e-8)
    assert done.notes == [
        "drive/t (sampled 4 times as often) joined to the stamps of axis/t: u averaged from row to row"
    ]


def test_a_fast_u_that_was_sampled_has_its_value_at_each_row(tmp_path: Path) -> None:
    """Its mean ahead would be half a row late, and the log says "sampled", so that nobody would take that out again."""
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed")
    fast, slow = np.arange(4000) * 0.25e-3, 0.1e-3 + np.arange(990) * 1e-3
    u = np.sin(20.0 * fast)
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(u, fast, name="iq")], acq_name="drive")
        file.append([asammdf.Signal(slow**2, slow, name="speed")], acq_name="axis")
        file.save(tmp_path / "log.mf4")
    names = {"t": "t", "u": "iq", "velocity": "speed"}
    sampled = load_log(tmp_path / "log.mf4", names, command=Command("sampled"))
    expected = [on_the_line(fast.tolist(), u.tolist(), at) for at in slow]
    np.testing.assert_allclose(sampled.log["u"], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(sampled.log["u"], np.sin(20.0 * slow), rtol=0, atol=1e-4)
    assert sampled.warnings[0].endswith("joined to the stamps of axis/t: u interpolated")
    held = load_log(tmp_path / "log.mf4", names)
    assert held.warnings[0].endswith("u averaged from row to row")
    assert np.abs(held.log["u"] - np.sin(20.0 * slow)).max() > 5e-3


def test_a_fast_sensor_is_interpolated_and_a_slow_reference_held() -> None:
    rng = np.random.default_rng(2)
    rows, fast, slow = 5.0 + np.arange(300) * 2e-3, 5.0 + np.arange(2500) * 0.25e-3, 4.9 + np.arange(9) * 0.1
    u, q, reference = rng.normal(size=300), rng.normal(size=2500), rng.normal(size=9)
    parts = [
        Sampled("a", rows, {"u": u}),
        Sampled("b", fast, {"position": q}),
        Sampled("c", slow, {"reference": reference}),
    ]
    done = join("log", parts)
    np.testing.assert_array_equal(done.values["u"], u)
    expected = [on_the_line(fast.tolist(), q.tolist(), at) for at in rows]
    np.testing.assert_allclose(done.values["position"], expected, rtol=0, atol=1e-9)
    held = [reference[bisect_right(slow.tolist(), at) - 1] for at in rows]
    np.testing.assert_array_equal(done.values["reference"], held)


def test_stamps_that_are_the_same_change_nothing_and_need_no_word() -> None:
    t = np.arange(50) * 0.1
    done = join("log", [Sampled("a", t, {"u": t * 2}), Sampled("b", t.copy(), {"velocity": t * 3})])
    np.testing.assert_array_equal(done.values["velocity"], t * 3)
    assert done.notes == []


def test_there_is_no_value_where_a_channel_has_a_hole_or_has_ended() -> None:
    rows = np.arange(100) * 0.01
    other = np.concatenate([np.arange(30) * 0.01, 0.5 + np.arange(20) * 0.01]) + 0.004
    done = join("log", [Sampled("a", rows, {"u": rows}), Sampled("b", other, {"velocity": other})])
    known = np.isfinite(done.values["velocity"])
    expected = [(0.004 <= at <= 0.294 + 1e-12) or (0.504 <= at <= 0.694 + 1e-12) for at in rows]
    np.testing.assert_array_equal(known, expected)
    np.testing.assert_allclose(done.values["velocity"][known], rows[known], atol=1e-12)


def test_a_lost_stretch_of_u_is_not_averaged_over() -> None:
    fast = np.delete(np.arange(400) * 1e-3, slice(100, 150))
    rows = np.arange(40) * 1e-2
    parts = [Sampled("a", fast, {"u": np.ones(fast.size)}), Sampled("b", rows, {"velocity": rows})]
    u = join("log", parts).values["u"]
    assert np.isnan(u).tolist() == [9 <= k <= 14 for k in range(40)]


def test_refused_in_one_line() -> None:
    t = np.arange(20) * 0.1
    for other, text in ((t[::-1], "go backwards"), (t + 100.0, "do not overlap")):
        with pytest.raises(DataError, match=text):
            join("log.mf4", [Sampled("a", t, {"u": t}), Sampled("b", other, {"velocity": t})])


def test_rates_of_a_real_file_are_joined_and_said(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed")
    rng = np.random.default_rng(3)
    fast, slow = np.arange(4000) * 0.25e-3, 0.1e-3 + np.arange(990) * 1e-3
    u, v = rng.normal(size=4000), rng.normal(size=990)
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(u, fast, name="iq")], acq_name="drive")
        file.append([asammdf.Signal(v, slow, name="speed")], acq_name="axis")
        file.save(tmp_path / "log.mf4")
    found, warnings = read(tmp_path / "log.mf4", {"t": "t", "u": "iq", "velocity": "speed"})
    np.testing.assert_allclose(found["t"], slow, rtol=0, atol=1e-12)
    expected = [held_mean(fast.tolist(), u.tolist(), a, b) for a, b in pairwise(slow[:51])]
    np.testing.assert_allclose(found["u"][:50], expected, rtol=0, atol=1e-9)
    assert warnings == ["drive/t (sampled 4 times as often) joined to the stamps of axis/t: u averaged from row to row"]
