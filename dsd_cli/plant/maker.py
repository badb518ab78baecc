"""d_hat as other makers compute it, and the same log's d_hat as the observer of this package would have.

d_hat = Q { Jn a - u } leaves open how Q = 1 / (tau s + 1) is stepped and which u is paired with the newest difference
of the speed. With x_k = Jn (v_k - v_{k-1}) / T - u, over T = t_k - t_{k-1}:

    exact           d_k = p d_{k-1} + (1 - p) x_k,  p = exp(-T / tau)       (the hold of x, as here)
    euler           d_k = d_{k-1} + (T / tau) (x_k - d_{k-1})                (forward)
    backward_euler  d_k = (tau d_{k-1} + T x_k) / (tau + T)
    bilinear        d_k = ((2 tau - T) d_{k-1} + T (x_k + x_{k-1})) / (2 tau + T)

and u is u_{k-1}, which acted on that interval ("previous", as here), u_k ("newest"), or their mean. Each step is solved
for x_k (for the mean of x_k and x_{k-1} with "bilinear"), the u in it is taken out and the other one put in, and Q is
stepped anew. d_hat of "bilinear" averages two intervals: it is that of an observer on position (`observer.APERTURE`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np

from dsd_cli.plant.filtering import lowpass_irregular, poles_of
from dsd_cli.signals.log import Array

Filter = Literal["exact", "euler", "backward_euler", "bilinear"]
Pairing = Literal["previous", "newest", "mean"]
FILTERS: tuple[Filter, ...] = get_args(Filter)
PAIRINGS: tuple[Pairing, ...] = get_args(Pairing)
#: A sample that comes after more than so many steps of the one before begins anew: what u did between is not known.
HOLE = 10.0


@dataclass(frozen=True)
class Maker:
    """filter : how Q is stepped; u : which one is paired with the newest difference."""

    filter: Filter = "exact"
    u: Pairing = "previous"

    def __str__(self) -> str:
        return f"filter {self.filter.replace('_', ' ')}, {'mean of both' if self.u == 'mean' else self.u} u"

    @property
    def as_here(self) -> bool:
        """Whether nothing is to be changed."""
        return self == Maker()

    @property
    def keys(self) -> tuple[str, str]:
        """What says so in a config."""
        return f'observer.filter = "{self.filter}"', f'observer.u = "{self.u}"'

    @property
    def intervals(self) -> int:
        """How many intervals its d_hat averages."""
        return 2 if self.filter == "bilinear" else 1

    def own_u(self, newest: Array, previous: Array) -> Array:
        """The u of x_k, from u_k and u_{k-1}."""
        return {"previous": previous, "newest": newest, "mean": 0.5 * (newest + previous)}[self.u]

    def step(self, intervals: Array, time_constant: float) -> tuple[Array, Array]:
        """(weight of d_{k-1}, weight of x_k or of the mean of x_k and x_{k-1}) over intervals of T s."""
        if time_constant <= 0.0:
            return np.zeros_like(intervals), np.ones_like(intervals)
        share = intervals / time_constant
        if self.filter == "exact":
            keep = poles_of(intervals.tolist(), time_constant)
        elif self.filter == "euler":
            keep = 1.0 - share
        elif self.filter == "backward_euler":
            keep = 1.0 / (1.0 + share)
        else:
            keep = (2.0 - share) / (2.0 + share)
        return keep, 1.0 - keep


#: Every one.
MAKERS = tuple(Maker(how, pairing) for how in FILTERS for pairing in PAIRINGS)


def left_open(how: str = "auto", pairing: str = "auto") -> tuple[Maker, ...]:
    """The makers of which a config may speak, in the order of `MAKERS`; "auto" leaves all."""
    return tuple(m for m in MAKERS if how in ("auto", m.filter) and pairing in ("auto", m.u))


class Remade(NamedTuple):
    """What is carried from chunk to chunk: of the last two samples t (s), u and d_hat as logged; d_hat as here.

    `step` : the last interval, s; inf before there is one.
    """

    t: float = math.nan
    u: float = math.nan
    u_before: float = math.nan
    d_hat: float = math.nan
    here: float = math.nan
    step: float = math.inf


def remade(
    t: Array, u: Array, d_hat: Array, maker: Maker, time_constant: float, state: Remade | None = None
) -> tuple[Array, Remade]:
    """(d_hat as the observer of this package makes it, shape (n,); what the next chunk needs).

    Exact for the u in it, and for the motion where the stamps are those that the maker stepped by; noise of a logged
    d_hat is multiplied by Q / Q_maker, which is 1 within T / tau. A first sample, and one behind a hole, stays.

    Parameters
    ----------
    t : s, shape (n,), rising. u, d_hat : shape (n,), unit of u, d_hat with the sign of eq. 13; all finite.
    """
    state = state or Remade()
    if t.size == 0:
        return d_hat, state
    steps = np.diff(t, prepend=state.t)
    before = np.concatenate([[state.step], steps[:-1]])
    anew = ~(steps <= HOLE * np.where(np.isfinite(before), before, np.inf))
    previous = np.concatenate([[state.u], u[:-1]])
    earlier = np.concatenate([[state.u_before, state.u], u[:-2]])[: u.size]
    earlier = np.where(np.isfinite(earlier) & ~_behind(anew), earlier, previous)
    with np.errstate(invalid="ignore"):
        keep, take = maker.step(np.where(anew, 0.0, steps), time_constant)
        logged = np.concatenate([[state.d_hat], d_hat[:-1]])
        x = (d_hat - keep * logged) / np.where(take > 0.0, take, 1.0) + _swap(
            maker, u, previous, earlier, steps, before
        )
    poles = poles_of(np.where(anew, 0.0, steps).tolist(), time_constant)
    begins = np.flatnonzero(anew)
    poles[begins], x[begins] = 0.0, d_hat[begins]
    here = lowpass_irregular(x, poles, 0.0 if begins.size and begins[0] == 0 else state.here)
    last_before = float(u[-2]) if u.size > 1 else state.u
    step = float(steps[-1]) if not anew[-1] else math.inf
    return here, Remade(float(t[-1]), float(u[-1]), last_before, float(d_hat[-1]), float(here[-1]), step)


def _behind(anew: np.ndarray) -> np.ndarray:
    """The samples whose one before begins anew."""
    return np.concatenate([[False], anew[:-1]])


def _swap(maker: Maker, u: Array, previous: Array, earlier: Array, steps: Array, before: Array) -> Array:
    """The maker's u less that of this package, for each x_k or mean of two."""
    if maker.intervals == 1:
        return maker.own_u(u, previous) - previous
    both = 0.5 * (maker.own_u(u, previous) + maker.own_u(previous, earlier))
    share = np.where(np.isfinite(before) & (before > 0.0), steps / (steps + before), 0.5)
    return both - (share * previous + (1.0 - share) * earlier)
