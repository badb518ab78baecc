"""A log's channels are read-only: its own copies of what somebody may write to, shared where nobody can."""

import numpy as np
import pytest

from dsd_cli.signals.log import Log, with_channels


def test_what_can_be_written_to_is_copied():
    u = np.arange(4.0)
    part = u[:]
    part.flags.writeable = False  # but u is not
    log = Log({"u": u, "d_hat": part}, 1e-3)
    u[:] = 7.0
    np.testing.assert_array_equal(log["u"], np.arange(4.0))
    np.testing.assert_array_equal(log["d_hat"], np.arange(4.0))
    with pytest.raises(ValueError, match="read-only"):
        log["u"][0] = 1.0


def test_a_changed_log_shares_the_channels_that_it_keeps():
    log = Log({"u": np.arange(4.0), "velocity": np.ones(4)}, 1e-3)
    other = with_channels(log, velocity=np.zeros(4))
    assert other["u"] is log["u"]
    assert np.shares_memory(Log({"u": log["u"][1:3]}, 1e-3)["u"], log["u"])


@pytest.mark.parametrize("given", [[1, 2], np.arange(2, dtype=np.int32), np.arange(4.0)[::2]])
def test_anything_else_becomes_float64_in_one_piece(given):
    column = Log({"u": given}, 1e-3)["u"]
    assert column.dtype == np.float64
    assert column.flags.c_contiguous
    np.testing.assert_array_equal(column, given)
