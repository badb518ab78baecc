"""Stamps of a counter go on where it wraps, however the rows come in batches."""

import numpy as np
import pytest

from dsd_cli.files.counter_stamps import counted_on
from dsd_cli.files.table_source import Batch

STEPS = 1000.0 * np.arange(400)


class Table:
    """Stamps in batches of any size; the recording begins anew with the batch that has row `restart`."""

    name, metadata, unreadable = "log.csv", {}, 0

    def __init__(self, t, size, restart=-1):
        self.columns, self.column_names, self.warnings = {"t": "t"}, ["t"], []
        self._t, self._size, self._restart = t, size, restart

    def batches(self):
        for at in range(0, self._t.size, self._size):
            part = self._t[at : at + self._size]
            yield Batch(part.size, {"t": part}, at <= self._restart < at + self._size)


def read(table):
    counted = counted_on(table)
    return np.concatenate([batch.columns["t"] for batch in counted.batches()]), counted.warnings


@pytest.mark.parametrize("size", [1000, 61, 7, 2, 1])
@pytest.mark.parametrize("bits", [16, 32])
def test_batches_of_any_size_go_on_alike(size, bits):
    begin = 2.0**bits - 150_500.0
    found, warnings = read(Table((begin + STEPS) % 2.0**bits, size))
    np.testing.assert_array_equal(np.diff(found), 1000.0)
    assert len(warnings) == 1


@pytest.mark.parametrize("size", [100, 50])
def test_a_recording_that_begins_anew_begins_at_its_own_stamps(size):
    """A board that starts again near the end of its count is no counter that has wrapped."""
    t = np.concatenate([2.0**32 - 200_000.0 + STEPS[:200], STEPS[:200]])
    found, warnings = read(Table(t, size, restart=200))
    np.testing.assert_array_equal(found, t)
    assert warnings == []
