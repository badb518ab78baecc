"""d_hat as others make it: how they step Q, and which u they pair with the last difference of the speed.

x_k = Jn (v_k - v_(k-1)) / T_k - u, and d = Q x with Q(s) = 1 / (tau s + 1), T_k = t_k - t_(k-1):

| filter | d_k |
|---|---|
| exact | p d_(k-1) + (1 - p) x_k, p = exp(-T / tau) |
| euler | d_(k-1) + (T / tau) (x_k - d_(k-1)): forward |
| backward_euler | (tau d_(k-1) + T x_k) / (tau + T): alpha = T / (tau + T) |
| bilinear | ((2 tau - T) d_(k-1) + T (x_k + x_(k-1))) / (2 tau + T) |

and u is u_(k-1), which acted on that interval ("previous"), u_k ("newest"), or the mean of both.
"""

import numpy as np

from tests.oracle.rig_cases import Array

FILTERS = ("exact", "euler", "backward_euler", "bilinear")
PAIRINGS = ("previous", "newest", "mean")


def made(t: Array, u: Array, v: Array, nominal: float, tau: float, how: str, pairing: str) -> Array:
    """d_hat of shape (n,), from rest."""
    paired = {"previous": u[:-1], "newest": u[1:], "mean": 0.5 * (u[:-1] + u[1:])}[pairing]
    steps = np.diff(t)
    x = nominal * np.diff(v) / steps - paired
    out = np.zeros(len(t))
    before = 0.0
    for k, (step, now) in enumerate(zip(steps.tolist(), x.tolist(), strict=True)):
        last = out[k]
        if how == "exact":
            p = float(np.exp(-step / tau))
            out[k + 1] = p * last + (1.0 - p) * now
        elif how == "euler":
            out[k + 1] = last + step / tau * (now - last)
        elif how == "backward_euler":
            out[k + 1] = (tau * last + step * now) / (tau + step)
        else:
            out[k + 1] = ((2.0 * tau - step) * last + step * (now + before)) / (2.0 * tau + step)
        before = now
    return out
