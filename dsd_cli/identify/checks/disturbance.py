"""d_hat against u and the motion, or against u alone: its sign, its scale, and whose sign is wrong.

By eq. 13 u + Q^-1 d_hat is Jn a, the net force. Where it is (Jn/J) u(t - L) + ..., a log with a wrong sign of u or of
d_hat gives 2 u(t) - (Jn/J) u(t - L) - ...: a share of exactly 2 that acts at once, and the rest against it. Where the
delay is too short for the band, or friction is most of u, nothing distinguishes the two and nothing is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsd_cli.identify.checks.balance import Band, difference
from dsd_cli.identify.checks.results import Finding
from dsd_cli.identify.checks.scan import LATEST, View, block_starts, jackknife
from dsd_cli.identify.checks.stretches import LowPass, Stretch, before
from dsd_cli.plant.filtering import SETTLED, lowpass
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.signals.log import Array

#: Signs and factors are believed from so many standard errors, and this share of d_hat explained, on.
CLEAR, EXPLAINED = 5.0, 0.6
#: Rows of which d_hat is judged at least, each half a period of the highest frequency.
LEAST_ROWS = 20
#: A factor is worth a word from this far from 1 on.
FAR = 0.1
#: Time constants that are tried, as factors of the given one; another one must leave less than this share of the rest.
FACTORS, BETTER = (0.1, 0.2, 0.35, 0.6, 1.0, 1.7, 2.8, 5.0, 10.0), 0.3


@dataclass(frozen=True)
class Observed:
    """d_hat = motion Q { Jn a } + drive Q { u }, for a right log 1 and -1, with standard errors.

    `explained` : share of d_hat; `time_constant` : of the Q that leaves least, s.
    """

    motion: float
    motion_error: float
    drive: float
    drive_error: float
    explained: float
    time_constant: float

    @property
    def clear(self) -> bool:
        """Whether both signs can be believed."""
        sure = min(abs(self.motion) / self.motion_error, abs(self.drive) / self.drive_error)
        return sure > CLEAR and self.explained > EXPLAINED


def observed(view: View, observer: ObserverSettings) -> Observed | None:
    """None where d_hat, u or the motion is not logged."""
    if view.band is None:
        return None
    parts = [part for s in view.stretches if (part := _filtered(s, view.band, view.cutoff, observer)) is not None]
    if not parts:
        return None
    fits = {}
    for factor in FACTORS if observer.time_constant > 0.0 else (1.0,):
        tau = factor * observer.time_constant
        sides = [side for part in parts if (side := part.through(tau)) is not None]
        if sum(y.size for y, _ in sides) >= LEAST_ROWS:  # fewer are explained by any two columns, or by another tau
            fits[tau] = _fit(np.concatenate([y for y, _ in sides]), np.concatenate([x for _, x in sides]), tau)
    given = fits.get(observer.time_constant)
    if given is None:
        return None
    best = max(fits.values(), key=lambda fit: fit.explained)
    return best if 1.0 - best.explained < BETTER * (1.0 - given.explained) else given


@dataclass(frozen=True)
class _Filtered:
    """Low-passed d_hat, Jn a and u of a stretch, the latter two as means over the interval that ends at the sample."""

    keep: LowPass
    d_hat: Array
    force: Array
    u: Array

    def through(self, tau: float) -> tuple[Array, Array] | None:
        """(d_hat, [Q Jn a, Q u]) at some samples; None where nothing is left once they have settled."""
        settled = self.keep.half + SETTLED * tau / self.keep.T
        rows = self.keep.rows(self.d_hat.size)
        rows = rows[rows > settled]
        if rows.size < 2:
            return None
        pole = float(np.exp(-self.keep.T / tau)) if tau > 0.0 else 0.0
        return self.d_hat[rows], np.column_stack([lowpass(x, pole, 0.0)[rows] for x in (self.force, self.u)])


def _filtered(s: Stretch, band: Band, cutoff: float, observer: ObserverSettings) -> _Filtered | None:
    """None where a channel is missing."""
    measured = getattr(s, band.source)
    if s.d_hat is None or s.u is None or measured is None:
        return None
    a, keep = difference(measured, s.T, band.source), LowPass(s.T, cutoff)
    force = observer.nominal_inertia * 0.5 * (a + before(a))
    return _Filtered(keep, keep(s.d_hat), keep(force), keep(before(s.u)))  # d_hat_k has seen u up to u_{k-1}


def _fit(d_hat: Array, columns: Array, tau: float) -> Observed:
    x = columns - columns.mean(axis=0)
    y = d_hat - d_hat.mean()
    edges = block_starts(y.size)
    xx = np.add.reduceat(x[:, :, None] * x[:, None, :], edges)
    xy = np.add.reduceat(x * y[:, None], edges)
    tiny = 1e-12 * np.eye(2) * np.trace(xx.sum(axis=0)) + 1e-300 * np.eye(2)
    whole = np.linalg.solve(xx.sum(axis=0) + tiny, xy.sum(axis=0))
    parts = np.linalg.solve(xx.sum(axis=0) - xx + tiny, (xy.sum(axis=0) - xy)[..., None])[..., 0]
    errors = np.maximum(jackknife(parts), 1e-300)
    explained = 1.0 - float(np.sum((y - x @ whole) ** 2)) / max(float(y @ y), 1e-300)
    return Observed(float(whole[0]), float(errors[0]), float(whole[1]), float(errors[1]), explained, tau)


def check_disturbance(fit: Observed, observer: ObserverSettings) -> list[Finding]:
    """What is wrong with d_hat itself, where `culprit` blames neither u nor the motion."""
    if not fit.clear:
        return []
    sign = observer.sign
    if fit.motion * sign < 0.0 < fit.drive * sign:
        what = "d_hat has the other sign than Q { Jn a - u }"
        return [Finding(what, "d_hat", "error", 0.98, f"observer.sign = {-sign}")]
    return [*_scales(fit), *_inertia(fit, observer), *_time_constant(fit, observer)]


def culprit(fit: Observed, sign: int) -> str:
    """ "u" or "motion" if that one has a sign that d_hat and the other contradict, else ""."""
    if not fit.clear or fit.motion * fit.drive < 0.0:
        return ""
    return "u" if fit.motion * sign > 0.0 else "motion"


def _scales(fit: Observed) -> list[Finding]:
    size = abs(fit.drive)
    if abs(size - 1.0) < max(FAR, CLEAR * fit.drive_error):
        return []
    what = f"d_hat is {size:.4g} times as large as u says: it is in another unit than u"
    return [Finding(what, "d_hat", "error", 0.95, 'signals.d_hat = "" (it is then computed from the motion)')]


def _inertia(fit: Observed, observer: ObserverSettings) -> list[Finding]:
    ratio, error = abs(fit.motion / fit.drive), fit.motion_error / abs(fit.drive)
    if abs(ratio - 1.0) < max(FAR, CLEAR * error):
        return []
    found = observer.nominal_inertia * ratio
    what = f"d_hat was made with Jn = {found:.4g}, not {observer.nominal_inertia:.4g}"
    return [Finding(what, "d_hat", "error", 0.95, f"observer.nominal_inertia = {found:.4g}")]


def _time_constant(fit: Observed, observer: ObserverSettings) -> list[Finding]:
    if fit.time_constant == observer.time_constant:
        return []
    what = f"d_hat looks filtered with about {fit.time_constant:.2g} s, not {observer.time_constant:.2g} s"
    return [Finding(what, "d_hat", "warning", 0.9, f"observer.time_constant = {fit.time_constant:.2g}")]


#: The share at once must be within this of 2, the delayed one beyond this below 0, ...
AT_ONCE, AGAINST = 0.2, -0.3
#: ... and both together leave less than this share of what a delayed u alone leaves.
BETTER_ALONE = 0.3
#: End of the band, Hz, and as a share of the sample rate.
_CUTOFF, _SHARE = 40.0, 0.1


def check_alone(stretches: Sequence[Stretch], observer: ObserverSettings) -> list[Finding]:
    """At most one finding."""
    sides = [side for s in stretches if (side := _sides(s, observer)) is not None]
    if not sides:
        return []
    force, u = (np.concatenate(x) for x in zip(*sides, strict=True))
    at_once, delayed, share = _shares(force, u)
    if abs(at_once - 2.0) > AT_ONCE or delayed > AGAINST or share > BETTER_ALONE:
        return []
    what = "u and d_hat contradict each other: one of them has the other sign (this log cannot say which)"
    remedy = f"observer.sign = {-observer.sign}, or signals.u_sign = -1"
    return [Finding(what, "d_hat", "error", 0.9, remedy)]


def _sides(s: Stretch, observer: ObserverSettings) -> tuple[Array, Array] | None:
    """(net force, u at each delay), shapes (rows,) and (rows, delays), the first delay 0."""
    force, T, tau = s.net_force(observer), s.T, observer.time_constant
    if s.u is None or force is None:
        return None
    keep = LowPass(T, min(_CUTOFF, _SHARE / T))
    longest = int(min(LATEST, 0.2 * s.t.size * T) / T)
    delays = np.concatenate([[0], np.arange(2, longest, max(int(1.0 / (16.0 * keep.cutoff * T)), 1))])
    rows = keep.rows(s.t.size, longest)
    rows = rows[rows > keep.half + longest + SETTLED * tau / T]
    if rows.size < 50 or delays.size < 3:
        return None
    return keep(force)[rows], keep(before(s.u))[rows[:, None] - delays]


def _shares(force: Array, u: Array) -> tuple[float, float, float]:
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
