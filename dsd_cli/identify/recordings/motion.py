"""Acceleration from the speed, for pictures and regimes."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.log import Array, Log


def acceleration(log: Log, time_constant: float) -> Array:
    """Slope of the speed over a time constant to either side of each sample (two samples at least), shape (n,).

    Wide, so that the noise of single differences, which is the noise of d_hat, is not in it.
    """
    v, t = log["velocity"], log["t"]
    half = max(2, round(time_constant / log.sample_time))
    index = np.arange(len(v))
    before, after = np.maximum(index - half, 0), np.minimum(index + half, len(v) - 1)
    return np.asarray((v[after] - v[before]) / (t[after] - t[before]))
