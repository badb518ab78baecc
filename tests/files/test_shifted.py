"""u moved in time, against a plain loop over the rows of a recording."""

import numpy as np
import pytest

from dsd_cli.errors import DataError
from dsd_cli.files.shifted import HOLE, Shift, shifted
from dsd_cli.files.table_source import Batch

T, N = 0.001, 200


class Table:
    """Rows in batches of any size."""

    name, metadata, warnings, unreadable = "log.csv", {}, [], 0

    def __init__(self, t, u, size):
        self.column_names = ["t", "u", "row"]
        self.columns = {name: name for name in self.column_names}
        self._rows, self._size = {"t": t, "u": u, "row": np.arange(len(u), dtype=float)}, size

    def batches(self):
        rows = self._rows["u"].size
        for at in range(0, rows, self._size):
            part = {name: x[at : at + self._size] for name, x in self._rows.items()}
            yield Batch(part["u"].size, part)


def moved(t, u, seconds, hold="held", size=10_000):
    """u of every row, and that the rows come in their order."""
    batches = list(shifted(Table(t, u, size), Shift(seconds, hold), 1.0, None).batches())
    joined = {name: np.concatenate([batch.columns[name] for batch in batches]) for name in ("t", "u", "row")}
    np.testing.assert_array_equal(joined["row"], np.arange(len(u)))
    np.testing.assert_array_equal(joined["t"], t)
    return joined["u"]


def by_hand(t, u, seconds, hold):
    """Row by row; recordings begin where stamps go back, a stamp that is no number or comes again is no sample."""
    out = np.full(len(u), np.nan)
    recordings, last = [[]], -np.inf
    for k in range(len(t)):
        if t[k] < last:
            recordings.append([])
        if np.isfinite(t[k]):
            recordings[-1].append(k)
            last = t[k]
    for rows in recordings:
        samples = [k for i, k in enumerate(rows) if i == 0 or t[k] > t[rows[i - 1]]]
        for k in rows:
            i = max(n for n, s in enumerate(samples) if t[s] == t[k])
            steps = [t[samples[n + 1]] - t[samples[n]] for n in (i - 1, i) if 0 <= n < len(samples) - 1]
            when = t[k] - seconds + (0.5 * min(steps) if hold == "held" else 0.0)
            before = [n for n, s in enumerate(samples) if t[s] <= when]
            if not before:
                continue
            n, here = before[-1], samples[before[-1]]
            follows = n + 1 < len(samples) and t[samples[n + 1]] - t[here] <= HOLE * min(steps)
            if (hold == "held" and (follows or when - t[here] < min(steps))) or (hold == "sampled" and when == t[here]):
                out[k] = u[here]
            elif hold == "sampled" and follows:
                after = samples[n + 1]
                out[k] = u[here] + (when - t[here]) / (t[after] - t[here]) * (u[after] - u[here])
    return out


def log(kind):
    rng = np.random.default_rng(3)
    t, u = np.arange(N) * T, rng.normal(size=N)
    if kind == "irregular":
        t = np.cumsum(rng.uniform(0.3, 1.9, N)) * T
    elif kind == "holes":
        t = t + np.where(np.arange(N) >= 100, 0.5, 0.0) + np.where(np.arange(N) >= 150, 0.004, 0.0)
    elif kind == "two recordings":
        t = np.concatenate([t[:75], t[:125]])
    elif kind == "dirty":
        t, u = t.copy(), u.copy()
        t[[5, 100, N - 1]], t[150], u[[0, 77]] = np.nan, t[149], np.nan
    return t, u


@pytest.mark.parametrize("hold", ["held", "sampled"])
@pytest.mark.parametrize("kind", ["regular", "irregular", "holes", "two recordings", "dirty"])
@pytest.mark.parametrize("seconds", [-0.0073, -0.0004, 0.007, 0.0312])
def test_as_a_loop_says_and_however_the_rows_come(kind, seconds, hold):
    t, u = log(kind)
    expected = by_hand(t, u, seconds, hold)
    assert np.isfinite(expected).mean() > 0.6
    for size in (10_000, 97, 1):
        np.testing.assert_allclose(moved(t, u, seconds, hold, size), expected, rtol=1e-9, err_msg=str(size))


@pytest.mark.parametrize("samples", [-7, 7, -1, 1])
def test_whole_samples_of_a_regular_log_move_whatever_their_stamps_are_rounded_to(samples):
    t, u = log("regular")
    jittered = t + np.random.default_rng(4).uniform(-0.1, 0.1, t.size) * T
    for stamps in (t, np.round(t + 1e9, 4), jittered):
        found = moved(stamps, u, samples * T)
        expected = np.roll(u, samples)
        inside = slice(max(samples, 0), min(samples, 0) or None)
        np.testing.assert_array_equal(found[inside], expected[inside])


def test_a_log_that_is_shorter_than_the_shift_says_so():
    t, u = log("regular")
    with pytest.raises(DataError, match=r"no row has a u with signals.u_shift = 3"):
        moved(t, u, 3.0)


def test_a_log_without_stamps_counts_its_rows():
    u = np.arange(50.0)
    table = Table(np.arange(50.0), u, 7)
    columns = {"u": u}
    table.batches = lambda: iter([Batch(20, {"u": u[:20]}), Batch(30, {"u": u[20:]})])
    found = np.concatenate([b.columns["u"] for b in shifted(table, Shift(-0.004), 1.0, 0.002).batches()])
    np.testing.assert_array_equal(found[:-2], columns["u"][2:])
    assert np.isnan(found[-2:]).all()


def test_nothing_is_touched_without_a_shift():
    table = Table(*log("regular"), 9)
    assert shifted(table, Shift(), 1.0, None) is table
