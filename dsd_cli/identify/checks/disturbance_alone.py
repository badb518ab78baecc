"""u and d_hat without a motion: what a wrong sign of one of them still shows.

By eq. 13 u + Q^-1 d_hat is Jn a, the net force. Where it is (Jn/J) u(t - L) + ..., a log with a wrong sign of u or of
d_hat gives 2 u(t) - (Jn/J) u(t - L) - ...: a share of exactly 2 that acts at once, and the rest against it. Where the
delay is too short for the band, or friction is most of u, nothing distinguishes the two and nothing is said.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dsd_cli.identify.checks.lowpass import LowPass
from dsd_cli.identify.checks.results import Finding
from dsd_cli.identify.checks.scan import LATEST
from dsd_cli.identify.checks.stretches import Stretch
from dsd_cli.plant.filtering import SETTLED
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.signals.log import Array

#: The share at once must be within this of 2, the delayed one beyond this below 0, ...
AT_ONCE, AGAINST = 0.2, -0.3
#: ... and both together leave less than this share of what a delayed u alone leaves.
BETTER = 0.3
#: End of the band, Hz, and as a share of the sample rate.
_CUTOFF, _SHARE = 40.0, 0.1


def check_alone(stretches: Sequence[Stretch], observer: ObserverSettings) -> list[Finding]:
    """At most one finding."""
    sides = [side for s in stretches if (side := _sides(s, observer)) is not None]
    if not sides:
        return []
    force, u = (np.concatenate(x) for x in zip(*sides, strict=True))
    at_once, delayed, share = _fit(force, u)
    if abs(at_once - 2.0) > AT_ONCE or delayed > AGAINST or share > BETTER:
        return []
    what = "u and d_hat contradict each other: one of them has the other sign (this log cannot say which)"
    remedy = f"observer.sign = {-observer.sign}, or signals.u_sign = -1"
    return [Finding(what, "d_hat", "error", 0.9, remedy)]


def _sides(s: Stretch, observer: ObserverSettings) -> tuple[Array, Array] | None:
    """(net force, u at each delay), shapes (rows,) and (rows, delays), the first delay 0."""
    if s.u is None or s.d_hat is None:
        return None
    T, tau = s.T, observer.time_constant
    keep = LowPass(T, min(_CUTOFF, _SHARE / T))
    pole = float(np.exp(-T / tau)) if tau > 0.0 else 0.0
    before = np.concatenate([s.u[:1], s.u[:-1]])  # d_hat_k has seen u up to u_{k-1}
    undone = observer.sign * (s.d_hat - pole * np.concatenate([s.d_hat[:1], s.d_hat[:-1]])) / (1.0 - pole)
    longest = int(min(LATEST, 0.2 * s.t.size * T) / T)
    delays = np.concatenate([[0], np.arange(2, longest, max(int(1.0 / (16.0 * keep.cutoff * T)), 1))])
    rows = keep.rows(s.t.size, longest)
    rows = rows[rows > keep.half + longest + SETTLED * tau / T]
    if rows.size < 50 or delays.size < 3:
        return None
    return keep(undone + before)[rows], keep(before)[rows[:, None] - delays]


def _fit(force: Array, u: Array) -> tuple[float, float, float]:
    """(share at once, delayed share, what both leave over what a delayed u leaves) at the best delay of each."""
    now, later = u[:, :1], u[:, 1:]
    aa, ab, bb = float(np.sum(now**2)), later.T @ now[:, 0], np.sum(later**2, axis=0)
    ya, yb, yy = float(force @ now[:, 0]), later.T @ force, float(force @ force)
    alone = yy - np.concatenate([[ya**2 / max(aa, 1e-300)], yb**2 / np.maximum(bb, 1e-300)])
    determinant = np.maximum(aa * bb - ab**2, 1e-9 * max(aa, 1e-300) * np.maximum(bb, 1e-300))
    at_once = (ya * bb - yb * ab) / determinant
    delayed = (yb * aa - ya * ab) / determinant
    both = yy - at_once * ya - delayed * yb
    best = int(np.argmin(both))
    share = float(both[best]) / max(float(alone.min()), 1e-12 * yy, 1e-300)
    return float(at_once[best]), float(delayed[best]), share
