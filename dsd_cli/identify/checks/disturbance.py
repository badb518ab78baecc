"""d_hat against u and the motion, or against u alone: its sign, its scale, and whose sign is wrong.

By eq. 13 u + Q^-1 d_hat is Jn a, the net force. Where it is (Jn/J) u(t - L) + ..., a log with a wrong sign of u or of
d_hat gives 2 u(t) - (Jn/J) u(t - L) - ...: a share of exactly 2 that acts at once, and the rest against it. Where the
delay is too short for the band, or friction is most of u, nothing distinguishes the two and nothing is said.

And who made it: d_hat is predicted by each maker of `plant.maker`, and what each leaves below `_OF_MAKER` shares the
belief, as where no motion is logged (`identify.d_hat_makers`). Above it the noise of the speed decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsd_cli.identify.checks.balance import Band, difference
from dsd_cli.identify.checks.results import Finding
from dsd_cli.identify.checks.scan import LATEST, View, block_starts, jackknife
from dsd_cli.identify.checks.stretches import LowPass, Stretch, before
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.verdict.belief import belief_by_squares
from dsd_cli.plant.filtering import SETTLED, lowpass, lowpass_irregular
from dsd_cli.plant.maker import MAKERS, Maker
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


#: Hz, and share of the sample rate: end of the band in which makers are compared.
_OF_MAKER, _SHARE_OF_MAKER = 10.0, 0.02
#: Blocks that vote.
_BLOCKS = 24
#: As likely as that another than the config says is said.
_SURE = 0.9
#: d_hat that a maker explains to less than this is another's in the first place.
_EXPLAINED = 0.9


@dataclass(frozen=True)
class Known:
    """maker : the likeliest. other : probability that it is not this package's own. explained : share of d_hat."""

    maker: Maker
    other: float
    explained: float


def maker_by_motion(
    stretches: Sequence[Stretch], observer: ObserverSettings, makers: Sequence[Maker] = MAKERS
) -> Known | None:
    """The one of `makers`; None where u, d_hat or the motion is not logged, or too little of it."""
    sides = [(s, v) for s in stretches if s.u is not None and s.d_hat is not None and (v := s.speed) is not None]
    if not sides:
        return None
    asked = list(dict.fromkeys([Maker(), *makers]))
    left = {m: np.concatenate([_left(*side, m, observer) for side in sides]) for m in asked}
    if (rows := left[Maker()].size) < 2 * _BLOCKS:
        return None
    whole = np.concatenate([_rows(s.T, s.d_hat, observer) for s, *_ in sides])
    edges = np.arange(_BLOCKS) * rows // _BLOCKS
    squares = np.stack([np.add.reduceat(x**2, edges) for x in left.values()])
    belief = dict(zip(asked, belief_by_squares(squares).tolist(), strict=True))
    best = max(makers, key=belief.__getitem__)
    least = float(squares[asked.index(best)].sum())
    return Known(best, 1.0 - belief[Maker()], 1.0 - least / max(float(whole @ whole), 1e-300))


def check_maker(stretches: Sequence[Stretch], observer: ObserverSettings, undone: Maker) -> list[Finding]:
    """At most one finding, of a d_hat that another than `undone`, the config's maker, computed.

    What was turned into a d_hat over two intervals is not judged: no maker here has such a one with this pole.
    """
    if undone.intervals == 2:
        return []
    found = maker_by_motion(stretches, observer)
    if found is None or found.other < _SURE or found.explained < _EXPLAINED:
        return []
    sure = min(found.other, POLICY.surest)
    if not undone.as_here:
        remedy = 'observer.filter = "auto" and observer.u = "auto"'
        return [Finding(f"d_hat was not made with {undone}", "d_hat", "warning", sure, remedy)]
    what = f"d_hat was made with {found.maker}"
    return [Finding(what, "d_hat", "warning", sure, " and ".join(found.maker.keys))]


def _rows(T: float, x: Array | None, observer: ObserverSettings) -> Array:
    """Some samples of what has passed the low-pass, of the settled part, without mean."""
    if x is None:
        return np.zeros(0)
    keep = LowPass(T, min(_OF_MAKER, _SHARE_OF_MAKER / T))
    rows = keep.rows(x.size)
    rows = rows[rows > keep.half + SETTLED * observer.time_constant / T]
    found = keep(x)[rows]
    return found - found.mean() if found.size else found


def _left(s: Stretch, v: Array, maker: Maker, observer: ObserverSettings) -> Array:
    """What this maker's d_hat leaves of the logged one."""
    assert s.u is not None
    assert s.d_hat is not None
    x = observer.nominal_inertia * np.diff(v) / s.T - maker.own_u(s.u[1:], s.u[:-1])
    if maker.intervals == 2:
        x = 0.5 * (x + np.concatenate([x[:1], x[:-1]]))
    keep, _ = maker.step(np.full(x.size, s.T), observer.time_constant)
    predicted = np.concatenate([[0.0], lowpass_irregular(x, keep, 0.0)])
    return _rows(s.T, observer.sign * s.d_hat - predicted, observer)
