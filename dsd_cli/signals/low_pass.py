"""A channel that was logged behind a low-pass of first order, as it was in front of it."""

from __future__ import annotations

import math

import numpy as np

from dsd_cli.signals.log import Array


def in_front(t: Array, u: Array, time_constant: float, last: tuple[float, float] = (math.nan, math.nan)) -> Array:
    """u, shape (n,), in front of 1 / (time_constant s + 1), of what is held from sample to sample.

    u_f[k] = a u_f[k-1] + (1 - a) u[k], a = exp(-(t[k] - t[k-1]) / time_constant), is solved for u[k]. What u was before
    the first sample nobody knows: it counts as constant there, and where stamps do not rise.

    Parameters
    ----------
    t : stamps, s. time_constant : s, above 0. last : stamp and logged u of the sample before; NaN if there is none.
    """
    step = np.diff(t, prepend=last[0])
    share = np.exp(-np.where(step > 0.0, step, np.inf) / time_constant)
    before = np.concatenate([[last[1]], u[:-1]])
    return np.where(share > 0.0, (u - share * before) / (1.0 - share), u)
