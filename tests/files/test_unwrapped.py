"""A position that wraps goes on, row by row; what is no wrap stays as it is."""

import numpy as np
import pytest

from dsd_cli.files.table_source import Batch
from dsd_cli.files.unwrapped import unwrapped

T = 0.001
TURN = 2.0 * np.pi


class Table:
    """Rows in batches of any size."""

    name, metadata, unreadable = "log.csv", {}, 0

    def __init__(self, q, size):
        self.columns, self.column_names, self.warnings = {"position": "position"}, ["position"], ["as it was"]
        self._q, self._size = q, size

    def batches(self):
        for at in range(0, self._q.size, self._size):
            part = self._q[at : at + self._size]
            yield Batch(part.size, {"position": part})


def undone(q, factor=1.0, size=10_000):
    """(position, warnings of this)."""
    table = unwrapped(Table(q, size), factor)
    found = np.concatenate([batch.columns["position"] for batch in table.batches()])
    return found, table.warnings[1:]


def motion(kind):
    """rad, shape (3000,): to and fro over several turns, or round and round from a rest beside the edge."""
    t = T * np.arange(3000)
    if kind == "to and fro":
        return 9.0 * np.sin(4.0 * t) + 2.0 * np.sin(11.0 * t)
    return np.where(t < 0.2, 0.0, 15.0 * (t - 0.2) ** 2) + 3.1


@pytest.mark.parametrize("size", [10_000, 61, 1])
@pytest.mark.parametrize("kind", ["to and fro", "round"])
@pytest.mark.parametrize(
    ("unit", "low", "factor"),
    [(TURN, 0.0, 1.0), (TURN, -np.pi, 1.0), (360.0, 0.0, TURN / 360.0), (4096.0, 0.0, 1.0), (1.0, 0.0, TURN)],
)
def test_turns_of_every_unit(unit, low, factor, kind, size):
    true = motion(kind) / TURN * unit
    if unit == 4096.0:
        true = np.floor(true)
    else:
        true = true + 1e-5 * unit * np.random.default_rng(1).normal(size=true.size)
    wrapped = low + np.mod(true - low, unit)
    expected = true - true[0] + wrapped[0]
    assert np.ptp(expected) > 2.0 * np.ptp(wrapped)
    found, said = undone(wrapped, factor, size)
    np.testing.assert_allclose(found, expected, atol=1e-9 * unit)
    assert said == [f"the position wraps after a turn ({np.sum(np.abs(np.diff(wrapped)) > unit / 2)} times): undone"]


@pytest.mark.parametrize("size", [10_000, 7])
def test_a_fast_axis_that_is_logged_slowly(size):
    """38 degrees a row: its wraps were no 20 of its steps, and d_hat was that of jumps."""
    t = 0.02 * np.arange(3000)
    true = 900.0 * np.sin(1.2 * t) + 300.0 * np.sin(2.6 * t) + 170.0
    assert 30.0 < np.abs(np.diff(true)).max() < 40.0
    found, said = undone(np.mod(true, 360.0), TURN / 360.0, size)
    np.testing.assert_allclose(found, true, atol=1e-9)
    assert len(said) == 1


def test_a_counter_of_many_turns_with_its_counts_to_a_turn():
    true = np.floor(motion("to and fro") / TURN * 10_000 + 65_000)
    found, _ = undone(np.mod(true, 65536.0), TURN / 10_000)
    np.testing.assert_array_equal(found, true)


def no_wraps():
    """By name: positions that jump or begin, but do not wrap."""
    t = T * np.arange(3000)
    smooth = motion("to and fro")
    yield "smooth", smooth
    yield "a new zero", np.where(t > 1.5, smooth - smooth[1500], smooth)
    yield "counts from a rest", np.floor(np.where(t < 0.5, 0.0, 800.0 * (t - 0.5) ** 2))
    yield "a count of 360 from a rest", 360.0 * np.floor(np.where(t < 0.5, 0.0, 8.0 * (t - 0.5) ** 2))
    yield "noise alone", np.round(np.random.default_rng(2).normal(size=3000))
    yield "still", np.zeros(3000)
    yield "a step of a bare simulation", np.where(t > 1.0, 1.0, 0.0)


@pytest.mark.parametrize(("name", "q"), list(no_wraps()), ids=lambda one: one if isinstance(one, str) else "")
def test_what_is_no_wrap_stays(name, q):
    for size in (10_000, 7):
        found, said = undone(q, size=size)
        np.testing.assert_array_equal(found, q)
        assert said == []


def test_rows_without_a_position_stay_without():
    true = motion("to and fro")
    wrapped = np.mod(true, TURN)
    wrapped[::50] = np.nan
    found, _ = undone(wrapped)
    expected = true - true[1] + wrapped[1]
    np.testing.assert_allclose(found[1::50], expected[1::50], atol=1e-9)
    assert np.isnan(found[::50]).all()


def test_a_table_without_a_position_is_the_same_table():
    table = Table(np.zeros(3), 3)
    table.columns = {"u": "u"}
    assert unwrapped(table, 1.0) is table
