"""Who made d_hat: how he stepped Q and which u he paired with the last difference, from the motion that is logged too.

d_hat is predicted from u and the speed by each maker of `plant.maker`; what each leaves below `_CUTOFF` shares the
belief, as where no motion is logged (`identify.d_hat_makers`). Above that frequency the noise of the speed decides: a
filter that averages it looks better than it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.identify.checks.results import Finding
from dsd_cli.identify.checks.stretches import LowPass, Stretch
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.verdict.belief import belief_by_squares
from dsd_cli.plant.filtering import SETTLED, lowpass_irregular
from dsd_cli.plant.maker import MAKERS, Maker
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.signals.log import Array

#: Hz, and share of the sample rate: end of the band in which makers are compared.
_CUTOFF, _SHARE = 10.0, 0.02
#: Blocks that vote.
_BLOCKS = 24
#: As likely as that another than the config says is said.
_SURE = 0.9
#: d_hat that a maker explains to less than this is another's in the first place.
_EXPLAINED = 0.9
#: Samples of a stretch that are looked at.
_MOST = 60_000


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
    parts = [_part(s) for s in stretches if s.u is not None and s.d_hat is not None]
    sides = [(s, speed) for s in parts if (speed := s.speed) is not None]
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


def _part(s: Stretch) -> Stretch:
    u, position, velocity, d_hat = (None if x is None else x[:_MOST] for x in (s.u, s.position, s.velocity, s.d_hat))
    return replace(s, t=s.t[:_MOST], u=u, position=position, velocity=velocity, d_hat=d_hat)


def _rows(T: float, x: Array | None, observer: ObserverSettings) -> Array:
    """Some samples of what has passed the low-pass, of the settled part, without mean."""
    if x is None:
        return np.zeros(0)
    keep = LowPass(T, min(_CUTOFF, _SHARE / T))
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
