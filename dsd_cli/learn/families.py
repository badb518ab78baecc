"""Families of free-form laws, linear in their coefficients: tables over channels, and springs that slip.

Every column is that of a general effect with 1 at one knot, so that what is learnt is what the model then has.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from dsd_cli.effects import Effect, Values
from dsd_cli.effects.general import CURVE, FRICTION_CURVE, HYSTERESIS, INERTIA_CURVE, Stops
from dsd_cli.effects.lagging import LAGGED, Lags
from dsd_cli.effects.tables import Table
from dsd_cli.learn.rows import IN_PAIR, ROWS_PER_KNOT, Balance
from dsd_cli.signals.log import Array

#: Knots over one channel, and fine ones over the position.
KNOTS, FINE = 17, 41
#: Knots over the time are wider than so many held-out blocks.
BLOCKS_PER_KNOT = 3
#: Radii of the springs that slip, shares of the travel: the least, the largest; how many there are to begin with.
RADII, STOPS = (0.003, 0.4), 14
#: Lags of the friction that acts late, from what the band shows to what a log has often enough to tell.
LAGS, TIMES_IN_LOG = 7, 10
#: Least distance of two knots, as a share of the channel's range.
_APART = 0.012
#: Knots from which on a curve is smooth between them.
_FEWEST = 4
#: Share of a log at places where the axis is more than once: at the others a law over them is one over time.
_AGAIN = 0.5
#: Strength with which the size of a coefficient is held, beside that of its bends.
_SIZE = 1e-4

DIRECTION, ACCELERATION, MEMORY, TIME = "direction", "acceleration", "memory", "time"


@dataclass(frozen=True)
class Family:
    """One kind of law.

    name : in words. on : the channels it depends on, "direction", "acceleration" and "memory" among them.
    effect : the general effect that has it. over : channels of the table. factor : see `Table`; of lags what lags.
    rank : the smaller, the simpler.
    """

    name: str
    on: tuple[str, ...]
    effect: Effect
    over: tuple[str, ...]
    factor: str
    rank: int

    @property
    def of_u(self) -> bool:
        """Whether it looks at u, so that it is judged in the forward form."""
        return "u" in (*self.over, self.factor)

    @property
    def of_motion(self) -> bool:
        """Whether anything but the time is in it."""
        return self.on != (TIME,)


#: Name, what it depends on, effect, channels of its table, factor; the simple ones first.
_KINDS: tuple[tuple[str, str, Effect, str, str], ...] = (
    ("a function of the velocity", "velocity", FRICTION_CURVE, "velocity", "one"),
    ("a function of the position", "position", CURVE, "position", "one"),
    ("friction over the position", "direction position", FRICTION_CURVE, "position", "one"),
    ("friction over time", "direction time", FRICTION_CURVE, "time", "one"),
    ("damping over the position", "velocity position", CURVE, "position", "velocity"),
    ("damping over time", "velocity time", CURVE, "time", "velocity"),
    ("an inertia over the position", "acceleration position", INERTIA_CURVE, "position", "one"),
    ("a gain of u over the position", "u position", CURVE, "position", "u"),
    ("a gain of u over time", "u time", CURVE, "time", "u"),
    ("a function of u", "u", CURVE, "u", "one"),
    ("a gain of u over the velocity", "u velocity", CURVE, "velocity", "u"),
    ("friction that depends on u", "direction u", FRICTION_CURVE, "u", "one"),
    ("hysteresis", "memory", HYSTERESIS, "", "one"),
    ("springs that relax", "memory", LAGGED, "", "velocity"),
    ("friction that builds up over time", "memory", LAGGED, "", "direction"),
    ("a function of velocity and position", "velocity position", FRICTION_CURVE, "velocity position", "one"),
    ("a force over time", "time", CURVE, "time", "one"),
)
FAMILIES = tuple(
    Family(name, tuple(on.split()), effect, tuple(over.split()), factor, rank)
    for rank, (name, on, effect, over, factor) in enumerate(_KINDS)
)


#: What a gain of u over time may be as well: J a = (1 + g(t)) (u + forces of the model), and u alone is not scaled.
INERTIA_OVER_TIME = Family(
    "an inertia that changes over time", (ACCELERATION, TIME), CURVE, (TIME,), "u", len(FAMILIES)
)


@dataclass(frozen=True)
class Columns:
    """A family on rows.

    rows : a column of shape (N,) for each of c coefficients. penalty : on them, (c, c). law : its table, or springs.
    matrix : from coefficients to the values of the law, (values, c). values : from those to values of the effect.
    finer : times as many knots as a family begins with.
    """

    family: Family
    rows: tuple[Array, ...]
    penalty: Array
    law: Any
    matrix: Array
    values: Callable[[Array], Values]
    finer: int = 1


def columns_of(family: Family, balance: Balance, finer: int = 1) -> Columns | None:
    """None where the log lacks a channel, or it does not vary, or where the axis does not come by places again;
    `finer` times as many knots over one channel."""
    if family.effect in (HYSTERESIS, LAGGED):
        return _stops(family, balance, finer) if family.effect is HYSTERESIS else lags_of(family, balance)
    channels = [samples_of(name, balance) for name in family.over]
    if not all(len(x) and np.ptp(x) > 0.0 for x in channels):
        return None
    if family.effect is INERTIA_CURVE and not len(samples_of("position", balance)):
        return None
    knots = tuple(_knots(name, x, family, balance, finer) for name, x in zip(family.over, channels, strict=True))
    if "position" in family.over and comes_by_again(knots, channels) < _AGAIN:
        return None
    inner, matrix = _smooth(knots)
    empty = np.zeros([len(k) for k in inner]).tolist()
    table = Table(family.over, inner, _frozen(empty), family.factor)
    net = family is INERTIA_OVER_TIME
    rows = tuple(balance.columns(family.effect, {"table": table.holding(one)}, net)[0] for one in matrix.T)

    def values(found: Array) -> Values:
        return family.effect.from_columns((1.0,), {"table": table.holding(found)})

    return Columns(family, rows, _penalty(knots), table, matrix, values, finer)


def comes_by_again(knots: Sequence[Sequence[float]], channels: Sequence[Array]) -> float:
    """Share of the samples in cells between knots, from which the path went further than the next cells and back: on
    one that never meets itself any force over time is a function of both, and says nothing of a cell beside it."""
    pairs = zip(knots, channels, strict=True)
    path = np.stack([np.clip(np.searchsorted(k, x, "right") - 1, 0, len(k) - 2) for k, x in pairs])
    visits, inside = (np.zeros([len(k) - 1 for k in knots], dtype=kind) for kind in (int, bool))
    for cell in map(tuple, path[:, np.flatnonzero(np.any(np.diff(path, prepend=-1), axis=0))].T.tolist()):
        near = np.zeros_like(inside)
        near[tuple(slice(max(i - 1, 0), i + 2) for i in cell)] = True
        inside &= near
        visits[cell] += not inside[cell]
        inside[cell] = True
    return float(np.mean(visits[tuple(path)] > 1))


def _frozen(values: Any) -> Any:
    return tuple(map(_frozen, values)) if isinstance(values, list) else values


def _stops(family: Family, balance: Balance, finer: int) -> Columns | None:
    place = samples_of("position", balance)
    travel = float(np.ptp(place)) if len(place) else 0.0
    if not travel > 0.0:
        return None
    resolved = balance.problem.ranges.resolution
    shares = np.geomspace(*RADII, finer * (STOPS - 1) + 1)
    radii = tuple(r * travel for r in shares.tolist() if r * travel > resolved)
    stops = Stops(radii, (0.0,) * len(radii))
    rows = tuple(balance.columns(family.effect, {"stops": stops.unit(i)})[0] for i in range(len(radii)))

    def values(found: Array) -> Values:
        return family.effect.from_columns((1.0,), {"stops": Stops(radii, tuple(found.tolist()))})

    return Columns(family, rows, np.eye(len(radii)), stops, np.diag(1.0 / np.array(radii)), values, finer)


def lags_of(family: Family, balance: Balance, times: tuple[float, ...] = ()) -> Columns | None:
    """First-order lags of the velocity or of its direction; `times`: time constants, s, of a log's whole range if none
    are given."""
    if not len(samples_of("velocity", balance)):
        return None
    equations = balance.equations
    longest = equations.sample_time * max(len(s.log) for s in equations.stretches) / TIMES_IN_LOG
    times = times or tuple(np.geomspace(0.5 / (np.pi * equations.band.hz), longest, LAGS).tolist())
    lags = Lags(family.factor, times, (0.0,) * len(times))
    rows = tuple(balance.columns(family.effect, {"lags": lags.unit(i)})[0] for i in range(len(times)))

    def values(found: Array) -> Values:
        return family.effect.from_columns((1.0,), {"lags": Lags(family.factor, times, tuple(found.tolist()))})

    return Columns(family, rows, np.eye(len(times)), lags, np.eye(len(times)), values)


def samples_of(name: str, balance: Balance) -> Array:
    """A channel in the middle of the intervals that count, all stretches; empty where one lacks it."""
    found = []
    for s, u in zip(balance.equations.stretches, balance.drive, strict=True):
        if name in ("velocity", "position") and name not in s.log:
            return np.zeros(0)
        x = {"u": u, TIME: s.frame.times}.get(name)
        found.append((getattr(s.middle, name) if x is None else x)[s.free > 0.0])
    return np.concatenate(found)


def _knots(name: str, x: Array, family: Family, balance: Balance, finer: int) -> tuple[float, ...]:
    """Even over position and time; else half of them at quantiles, none near another; over the velocity one at 0."""
    most = max(balance.blocks.rows // ROWS_PER_KNOT, 4)
    count = FINE if family.over == ("position",) and family.factor == "one" else KNOTS
    if name == TIME:
        count = max(balance.blocks.count // BLOCKS_PER_KNOT, 3)
    count = min(IN_PAIR if len(family.over) == 2 else finer * (count - 1) + 1, most)
    mixed = name not in (TIME, "position")
    even = np.linspace(x.min(), x.max(), count // 2 + 1 if mixed else count)
    usual = np.quantile(x, np.linspace(0.0, 1.0, count // 2 + 1)) if mixed else even
    least, kept = _APART / finer * float(np.ptp(x)), list[float]()
    fixed = [0.0] if name == "velocity" and x.min() < 0.0 < x.max() else []
    for knot in sorted({*even.tolist(), *usual.tolist()}):
        if all(abs(knot - other) > least for other in (*fixed, *kept[-1:])):
            kept.append(knot)
    return tuple(sorted([*kept, *fixed]))


def _smooth(knots: tuple[tuple[float, ...], ...]) -> tuple[tuple[tuple[float, ...], ...], Array]:
    """(knots of the table, matrix from values at `knots` to values there): over one channel by natural cubic splines,
    one on each side of a 0 among the knots, for friction has a kink there."""
    if len(knots) > 1 or len(knots[0]) < _FEWEST:
        return knots, np.eye(int(np.prod([len(k) for k in knots])))
    x = np.array(knots[0])
    parts = 1 if len(x) > FINE else 2 if len(x) > KNOTS + 8 else 3
    finer = np.unique(np.concatenate([*(np.linspace(a, b, parts + 1) for a, b in pairwise(x)), x]))
    finer = np.unique([min(x.tolist(), key=lambda k: abs(k - one)) if _near(one, x) else one for one in finer])
    matrix = np.zeros((len(finer), len(x)))
    at = [0, *(int(i) for i in np.flatnonzero(x == 0.0) if 0 < i < len(x) - 1), len(x) - 1]
    for a, b in pairwise(at):
        own = (finer >= x[a]) & (finer <= x[b])
        matrix[own, :] = 0.0
        matrix[np.ix_(own, np.arange(a, b + 1))] = natural_spline(x[a : b + 1], finer[own])
    return (tuple(map(float, finer)),), matrix


def _near(one: float, knots: Array) -> bool:
    return bool(np.min(np.abs(knots - one)) < 1e-9 * max(float(np.ptp(knots)), 1e-300))


def natural_spline(knots: Array, at: Array) -> Array:
    """Matrix from values at `knots`, shape (n,), to those of the natural cubic spline through them at `at`, (m, n)."""
    n = len(knots)
    i = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, n - 2)
    h, eye = np.diff(knots), np.eye(n)
    b = (at - knots[i]) / h[i]
    found = (1.0 - b)[:, None] * eye[i] + b[:, None] * eye[i + 1]
    if n < 3:
        return np.asarray(found)
    # second derivatives: tridiagonal, 0 at both ends
    bends, slopes = np.eye(n), np.zeros((n, n))
    for k in range(1, n - 1):
        bends[k, k - 1 : k + 2] = h[k - 1] / 6.0, (h[k - 1] + h[k]) / 3.0, h[k] / 6.0
        slopes[k, k - 1 : k + 2] = 1.0 / h[k - 1], -1.0 / h[k - 1] - 1.0 / h[k], 1.0 / h[k]
    second = np.linalg.solve(bends, slopes)
    a, size = 1.0 - b, (h[i] ** 2 / 6.0)[:, None]
    return np.asarray(found + size * ((a**3 - a)[:, None] * second[i] + (b**3 - b)[:, None] * second[i + 1]))


def _penalty(knots: Sequence[Sequence[float]]) -> Array:
    """Squared changes of slope over each channel, in units of its range, and a little of the squares themselves."""
    each = [_bends(one) for one in knots]
    if len(each) == 1:
        found = each[0]
    else:
        sizes = [np.eye(len(one)) for one in knots]
        found = np.kron(each[0], sizes[1]) + np.kron(sizes[0], each[1])
    return np.asarray(found + _SIZE * np.eye(len(found)))


def _bends(knots: Sequence[float]) -> Array:
    """The bend at 0 of a channel with both signs is free: friction has a kink there."""
    n, span = len(knots), max(knots[-1] - knots[0], 1e-300)
    steps = [(b - a) / span for a, b in pairwise(knots)]
    second = np.zeros((max(n - 2, 0), n))
    for i in range(n - 2):
        if knots[i + 1] == 0.0:
            continue
        a, b = steps[i], steps[i + 1]
        second[i, i : i + 3] = np.array([1.0 / a, -1.0 / a - 1.0 / b, 1.0 / b]) * np.sqrt(0.5 * (a + b)) / n
    return np.asarray(second.T @ second)
