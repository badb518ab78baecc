"""What all checks of one log look at, computed once: its stretches, its band, the balance, and in that the inertia by
regression of u on the acceleration, for each sign of it, over all possible delays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.checks.balance import Balance, Band, balance, find_band, speed_of, without
from dsd_cli.identify.checks.stretches import OVERSAMPLING, LowPass, Stretch, cut
from dsd_cli.identify.recordings.spectrum import cycle_of
from dsd_cli.signals.log import Array, Log

#: Delays that are tried, s: u cannot be later than what it does, unless its clock is; networks delay by tenths.
EARLIEST, LATEST = -0.05, 0.6
#: Blocks of rows that are left out in turn, for standard errors that count correlated errors.
BLOCKS = 16
#: Coarse delays per period of the highest frequency, fine ones about the best.
_COARSE, _FINE = 6.0, 25
#: But no more than this share of the longest stretch; than the second where the first leaves too few rows.
SHARES = 0.2, 0.05
#: Half of all drives are quicker than this, s (a Cauchy distribution: networks are among them), and a u that is later
#: than what it does is as rare as one that is so many times as much earlier.
_USUAL, _AHEAD = 0.02, 3.0
#: What interpolation and low-pass leave of u in any fit, as a share; with more rows than these errors are the model's.
_RESOLVED, FEW = 1e-3, 200


@dataclass(frozen=True)
class Scanned:
    """The best fit u(t - shift) = J a + motion with J of one sign.

    inertia, inertia_error : J and its standard error, errors that are correlated within a sixteenth of the log counted.
    shift : s, by which u is ahead of the motion; a held u acts half a sample less.
    explained : share of what the rest of the motion leaves of u that J a explains, 0 to 1.
    needed : the same of what the rest of the motion leaves at the delay that suits it best, at most 1: a u that
        switches where friction turns, as that of a relay, is friction and a delay, and has no need of an inertia.
    weight : power of that, as a share of the power of u.
    rest : share of u that the whole fit leaves.
    inside : the best shift is not at an end of those that were tried.
    belief : log of how likely this shift is times how well it explains u. A motion that comes again half a cycle later
        with the other sign is explained as well by the other sign and so much more delay: the delay decides then.
    """

    inertia: float
    inertia_error: float
    shift: float
    explained: float
    needed: float
    weight: float
    rest: float
    inside: bool
    belief: float

    @property
    def clearness(self) -> float:
        """|J| in standard errors."""
        return abs(self.inertia) / max(self.inertia_error, 1e-300)


def scan(rows: Balance, cutoff: float) -> tuple[Scanned | None, Scanned | None]:
    """(best with J > 0, best with J < 0); None where no delay gives such a J.

    Coarse delays first, then fine ones about each that is better than those beside it.
    """
    before, after = ((n - 1) * rows.T for n in rows.reach)
    a = without(rows.motion, rows.acceleration)
    coarse = np.linspace(-after, before, max(int(np.ceil((after + before) * _COARSE * cutoff)), 8))
    step, sums = float(coarse[1] - coarse[0]), _sums(rows, a, coarse)

    def about(at: NDArray[np.int64]) -> _Sums:
        fine = np.clip(coarse[at, None] + step * np.linspace(-1.0, 1.0, _FINE), -after, before)
        return _sums(rows, a, np.unique(fine))

    without_any = float(about(np.atleast_1d(sums.unexplained.argmin())).unexplained.min())
    found: list[Scanned | None] = []
    for sign in (1.0, -1.0):
        rest = np.pad(sums.rest(sign), 1, constant_values=np.inf)
        lowest = np.flatnonzero((rest[1:-1] <= np.minimum(rest[:-2], rest[2:])) & np.isfinite(rest[1:-1]))
        found.append(_best(about(lowest), sign, without_any, (-after, before), a.size) if lowest.size else None)
    return found[0], found[1]


def _sums(rows: Balance, a: Array, shifts: Array) -> _Sums:
    u = np.column_stack([rows.u_at(s) for s in shifts])
    left, edges = without(rows.motion, u), block_starts(a.size)
    return _Sums(
        shifts,
        np.maximum(np.einsum("ij,ij->j", u, u), 1e-300),
        np.add.reduceat(left * a[:, None], edges),
        np.add.reduceat(a**2, edges),
        np.add.reduceat(left**2, edges),
    )


@dataclass(frozen=True)
class _Sums:
    """Over blocks of rows: u a and u u, shape (blocks, shifts); a a, shape (blocks,). `power` of u over all rows."""

    shifts: Array
    power: Array
    ua: Array
    aa: Array
    uu: Array

    def without(self, block: int) -> _Sums:
        return _Sums(self.shifts, self.power, *(np.delete(x, block, axis=0) for x in (self.ua, self.aa, self.uu)))

    @property
    def unexplained(self) -> Array:
        """Share of u that is left without an inertia, shape (shifts,)."""
        return np.asarray(self.uu.sum(axis=0) / self.power)

    @property
    def inertia(self) -> Array:
        return np.asarray(self.ua.sum(axis=0) / max(self.aa.sum(), 1e-300))

    def rest(self, sign: float) -> Array:
        """Share of u that is left with an inertia of that sign, shape (shifts,); infinite where it has the other."""
        rest = (self.uu.sum(axis=0) - self.inertia * self.ua.sum(axis=0)) / self.power
        return np.where(self.inertia * sign > 0.0, np.maximum(rest, 0.0), np.inf)


def _best(sums: _Sums, sign: float, without_any: float, ends: tuple[float, float], rows: int) -> Scanned | None:
    usual = -np.log1p((np.maximum(sums.shifts, -_AHEAD * sums.shifts) / _USUAL) ** 2)
    belief = usual - 0.5 * min(rows, FEW) / OVERSAMPLING * np.log(sums.rest(sign) + _RESOLVED)
    at = int(belief.argmax())
    if not np.isfinite(belief[at]):
        return None
    inertia, total = float(sums.inertia[at]), float(sums.uu[:, at].sum())
    gained = inertia * float(sums.ua[:, at].sum())  # J^2 a a, whose square of J is no number for an axis at rest
    rest = (total - gained) / float(sums.power[at])
    parts = [sums.without(block) for block in range(len(sums.aa))]
    inertias = np.array([part.inertia[at] for part in parts])
    return Scanned(
        inertia,
        float(jackknife(inertias)),
        float(sums.shifts[at]),
        gained / max(total, 1e-300),
        1.0 - rest / max(without_any, 1e-300),
        gained / float(sums.power[at]),
        rest,
        bool(ends[0] < sums.shifts[at] < ends[1]),
        float(belief[at]),
    )


def jackknife(left_out: Array) -> Array:
    """Standard errors from the values with one block left out in turn, shape (blocks, ...)."""
    n = len(left_out)
    return np.asarray(np.sqrt((n - 1) / n * np.sum((left_out - left_out.mean(axis=0)) ** 2, axis=0)))


def block_starts(rows: int) -> NDArray[np.int64]:
    """First rows of the blocks, for `np.add.reduceat`."""
    return np.linspace(0, rows, min(BLOCKS, rows) + 1).astype(np.int64)[:-1]


@dataclass(frozen=True)
class Work:
    """How clearly u drives the motion (above 0) or brakes it (below), over all delays from `_BRAKED` on.

    clearness : of the speed's coefficient, in standard errors; the least over the delays, 0 if its sign changes.
    share : of the power of u, the least over the delays.
    """

    clearness: float
    share: float


#: Delays over which work must have one sign, s.
_BRAKED = (-0.02, 0.1)


def work(rows: Balance) -> Work:
    """What u gives to the motion that is not stored in it: friction takes it, so that it is not below 0 for long."""
    before, after = ((n - 1) * rows.T for n in rows.reach)
    shifts = np.linspace(max(_BRAKED[0], -after), min(_BRAKED[1], before), 25)
    speed = without(rows.stored, rows.speed)
    u = np.column_stack([rows.u_at(s) for s in shifts])
    left, edges = without(rows.stored, u), block_starts(speed.size)
    uv, vv = np.add.reduceat(left * speed[:, None], edges), np.add.reduceat(speed**2, edges)
    coefficient = uv.sum(axis=0) / max(vv.sum(), 1e-300)
    errors = jackknife((uv.sum(axis=0) - uv) / np.maximum(vv.sum() - vv, 1e-300)[:, None])
    clearness = coefficient / np.maximum(errors, 1e-300)
    share = float(np.min(coefficient**2 * vv.sum() / np.maximum(np.sum(u**2, axis=0), 1e-300)))
    if clearness.min() < 0.0 < clearness.max():
        return Work(0.0, share)
    return Work(float(clearness[np.argmin(np.abs(clearness))]), share)


#: Where no acceleration is seen, speeds are looked at below this share of the sample rate.
FALLBACK = 0.02
#: Signs and delays are looked for below this frequency, Hz: beyond, loads swing on their couplings.
HIGHEST = 40.0


@dataclass(frozen=True)
class View:
    """A log in stretches, the band of its acceleration, and the force balance in it.

    band : None if no channel shows an acceleration.
    cutoff : Hz, of `rows`, and of every comparison of channels.
    cycle : s after which speed or u of the longest stretch repeats itself; infinite where neither does.
    rows : None without a band, without u, or where the axis hardly moves.
    forward, backward : best fits with J above and below 0.
    work : how clearly u drives the motion.
    """

    log: Log
    restarts: tuple[int, ...]
    stretches: tuple[Stretch, ...]
    band: Band | None
    cutoff: float
    cycle: float
    rows: Balance | None
    forward: Scanned | None
    backward: Scanned | None
    work: Work | None


def look(log: Log, restarts: Sequence[int]) -> View:
    """The view of a log."""
    stretches = cut(log, restarts)
    band = find_band(stretches) if stretches else None
    if band is None:
        cutoff = min(HIGHEST, FALLBACK / (stretches[0].T if stretches else log.sample_time))
        return View(log, tuple(restarts), tuple(stretches), None, cutoff, math.inf, None, None, None, None)
    cutoff = min(band.cutoff, HIGHEST)
    longest = max((s for s in stretches if getattr(s, band.source) is not None), key=lambda s: s.t.size)
    keep = LowPass(longest.T, cutoff)
    cycle = min(cycle_of(keep(x), longest.T) for x in (speed_of(longest, band), longest.u) if x is not None)
    most = (min(share * longest.t.size * longest.T, cycle) for share in SHARES)  # a cycle later all is the same again
    tried = (balance(stretches, band, cutoff, (min(LATEST, s), min(-EARLIEST, s)), cycle) for s in most)
    rows = next((one for one in tried if one is not None), None)
    forward, backward = scan(rows, cutoff) if rows is not None else (None, None)
    drives = work(rows) if rows is not None else None
    return View(log, tuple(restarts), tuple(stretches), band, cutoff, cycle, rows, forward, backward, drives)
