"""How far values stray: all of them, or by their median: a few far off, or a motion in between, do not count."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.log import Array

#: Standard deviations of a normal law per median of its size: one over the quantile at 3/4.
NORMAL = 1.4826


def rms(x: Array) -> float:
    """Root of the mean square; 0 of nothing."""
    return float(np.sqrt(np.mean(x * x))) if x.size else 0.0


def robust_deviation(x: Array) -> float:
    """Standard deviation of normal values about zero, from the median of |x|; 0 where there are none."""
    return NORMAL * float(np.median(np.abs(x))) if x.size else 0.0
