"""A low-pass of first order, applied by a plain loop, is undone."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest

from dsd_cli.files.table_source import Batch
from dsd_cli.files.unfiltered import unfiltered
from tests.cli.rig import done

SAMPLES = Path(__file__).parents[2] / "sample_logs"
TIME_CONSTANT = 0.005


class Table:
    """Rows in batches of any size; `anew` begins another recording."""

    name, metadata, warnings, unreadable = "log.csv", {}, [], 0

    def __init__(self, columns, size, anew=()):
        self.column_names = list(columns)
        self.columns = {name: name for name in columns}
        self._rows, self._size, self._anew = columns, size, anew

    def batches(self):
        rows = len(self._rows["u"])
        for at in range(0, rows, self._size):
            part = {name: x[at : at + self._size] for name, x in self._rows.items()}
            yield Batch(len(part["u"]), part, restart=at in self._anew)


def behind_a_filter(t, u):
    """What a low-pass shows at each stamp, before the command changes there."""
    shown, state = [], u[0]
    for k, value in enumerate(u):
        if k and t[k] > t[k - 1]:
            a = math.exp(-(t[k] - t[k - 1]) / TIME_CONSTANT)
            state = a * state + (1.0 - a) * value
        elif k and t[k] < t[k - 1]:
            state = value
        shown.append(state)
    return np.array(shown)


def undone(columns, size=10_000, sample_time=None, anew=()):
    batches = unfiltered(Table(columns, size, anew), TIME_CONSTANT, 1.0, sample_time).batches()
    return np.concatenate([batch.columns["u"] for batch in batches])


@pytest.mark.parametrize("size", [1, 7, 10_000])
@pytest.mark.parametrize("clock", ["even", "irregular", "begun anew", "a hole"])
def test_u_is_what_it_was(size, clock):
    rng = np.random.default_rng(1)
    t = 0.001 * np.arange(300.0)
    if clock == "irregular":
        t = np.sort(rng.uniform(0.0, 0.3, 300))
    elif clock == "begun anew":
        t[120:] -= 0.1
    elif clock == "a hole":
        t[120:] += 2.0
    u = rng.normal(size=300)
    np.testing.assert_allclose(undone({"t": t, "u": behind_a_filter(t, u)}, size), u, rtol=0, atol=1e-9)


def test_without_stamps_the_sample_time_counts_and_another_recording_begins_anew():
    u = np.random.default_rng(2).normal(size=60)
    shown = [behind_a_filter(0.001 * np.arange(30), part) for part in (u[:30], u[30:])]
    found = undone({"u": np.concatenate(shown)}, size=10, sample_time=0.001, anew=(30,))
    np.testing.assert_allclose(found, u, rtol=0, atol=1e-9)


def test_a_cell_without_a_value_stays_one_and_spoils_nothing_beside_it():
    t, u = 0.001 * np.arange(40.0), np.repeat([1.0, 3.0], 20)
    shown = behind_a_filter(t, u)
    shown[[0, 30]], t[10] = np.nan, np.nan
    found = undone({"t": t, "u": shown}, size=3)
    assert np.isnan(found[[0, 30]]).all()
    rest = np.setdiff1d(np.arange(40), [0, 10, 30])
    np.testing.assert_allclose(found[rest], u[rest], rtol=0, atol=1e-9)


def test_no_filter_is_no_change():
    table = Table({"u": np.zeros(3)}, 3)
    assert unfiltered(table, 0.0, 1.0, 0.001) is table


@pytest.mark.parametrize("command", ["compare", "detect"])
def test_a_command_with_the_key_says_of_the_filtered_log_what_it_says_of_the_plain_one(command, tmp_path):
    rows = list(csv.DictReader((SAMPLES / "servo-friction.csv").open(newline="")))
    t, u = (np.array([float(row[name]) for row in rows]) for name in ("t", "u"))
    for name, column in (("plain.csv", u), ("filtered.csv", behind_a_filter(t, u))):
        lines = [f"{row['t']},{x!r},{row['position']}" for row, x in zip(rows, column.tolist(), strict=True)]
        (tmp_path / name).write_text("\n".join(["t,u,position", *lines]) + "\n")

    def said(log, *given):
        out = done(command, log, "-c", SAMPLES / "servo-friction.toml", *given, cwd=tmp_path).stdout
        return json.loads(out)["force"]["rmse"] if command == "compare" else out

    given = ("--format", "json") if command == "compare" else ()
    plain, with_key = (
        said("plain.csv", *given),
        said("filtered.csv", "--set", f"signals.u_filter={TIME_CONSTANT}", *given),
    )
    if command == "compare":
        assert with_key == pytest.approx(plain, rel=1e-4)
        assert said("filtered.csv", *given) > 1.5 * plain
    else:
        labels = [[line.split(",")[1:3] for line in out.splitlines()] for out in (plain, with_key)]
        assert labels[0] == labels[1]
