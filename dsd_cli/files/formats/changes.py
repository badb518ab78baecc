"""Channels that were logged only where they changed, as loggers on change of a value leave them.

Between two such values nothing is unknown: the channel kept the first one. A control input acts so until its next
value; a measured motion was read at its usual pace all the while, and each time it was the same. Other channels are
silent because samples were lost, or not sent yet, and then nothing is known.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.signals.log import Array

#: Neighbours farther apart than this many usual steps leave a hole.
HOLE = 2.5
#: The usual step is that of the busiest parts: this quantile, for an axis at rest says nothing.
_BUSY = 0.25
#: Over its holes a motion that was lost goes on as fast as else; one that stood still does less than half of that.
_STOOD = 0.5
#: Noise has another value each time, so that a channel of which most is noise is not silent for it stood still: each of
#: its steps takes some of the one before back, by a correlation of -0.5 where it is all white.
_NOISE = -0.25
#: Where stamps come in bursts, the usual step is one within these: more rows than so many for each value are of that.
_MOST_FILLED = 100
#: A control input alone is known by it where holes are this share of its time, or its levels come again, though never
#: twice in a row, so that so many of them are of this share of its values; or where it has fewer values than any answer
#: needs rows, so that rows at its stamps are of no use.
_MOSTLY, _LEVELS, _USELESS = 0.5, 0.5, 50
#: Values from which on that is seen.
_FEWEST = 3
#: Changes of u and of the motion fall into one row by chance only: at most this share of those of which there are few.
_AT_ONCE = 0.1
#: Signs of life come after this share of the longest silence at least, some changes before that of it.
_AS_LONG, _SOONER = 0.99, 0.5


class Changes(NamedTuple):
    """A channel's stamps and values, shape (n,) each; `pace`: its usual step; `holes`: which steps are longer."""

    t: Array
    x: Array
    pace: float
    holes: NDArray[np.bool_]

    @property
    def never_repeats(self) -> bool:
        """Whether no value comes twice in a row, but after the longest silence: that is a sign of life."""
        steps, same = np.diff(self.t), np.diff(self.x) == 0.0
        if self.t.size < _FEWEST or not same.any():
            return self.t.size >= _FEWEST
        longest = float(steps.max())
        return bool(steps[same].min() > _AS_LONG * longest and np.any(steps[~same] < _SOONER * longest))

    @property
    def stands(self) -> bool:
        """Whether it has holes, and hardly moves in them."""
        if not self.holes.any() or self.holes.all() or self.t[-1] - self.t[0] > _MOST_FILLED * self.t.size * self.pace:
            return False
        steps = np.diff(self.x)
        dense = ~(self.holes[:-1] | self.holes[1:])
        before, after = steps[:-1][dense], steps[1:][dense]
        if before @ after < _NOISE * np.linalg.norm(before) * np.linalg.norm(after):
            return False
        speed = np.abs(steps) / np.diff(self.t)
        return bool(np.median(speed[self.holes]) < _STOOD * np.median(speed[~self.holes]))

    @property
    def rests(self) -> bool:
        """Whether a control input keeps its values, as far as its own stamps and levels say it."""
        steps = np.diff(self.t)
        levels = np.unique(self.x).size
        mostly = steps[self.holes].sum() > _MOSTLY * steps.sum()
        return bool(mostly or levels <= _LEVELS * self.x.size or self.t.size < _USELESS)


def changes_of(t: Array, x: Array) -> Changes:
    """The values that there are; NaN are none. Stamps that go back are of no one recording, and say nothing."""
    rows = np.flatnonzero(np.isfinite(t) & np.isfinite(x))
    if np.any(np.diff(t[rows]) < 0.0):
        rows = rows[:0]
    rows = rows[np.append(np.diff(t[rows]) > 0.0, True)] if rows.size else rows
    steps = np.diff(t[rows])
    pace = float(np.quantile(steps, _BUSY)) if steps.size else 0.0
    return Changes(t[rows], x[rows], pace, steps > HOLE * pace)


def logged_on_change(channels: Mapping[str, Changes], motions: Collection[str]) -> set[str]:
    """Which of these channels have a value only where they changed; `motions`: those that are measured."""
    seen = {name: one for name, one in channels.items() if one.never_repeats}
    found = {name for name, one in seen.items() if name in motions and one.stands}
    measured = [channels[name] for name in motions if channels[name].t.size]
    u = seen.get("u")
    if u is not None and measured and (found or u.rests):
        overlap = u.t[0] <= max(one.t[-1] for one in measured) and min(one.t[0] for one in measured) <= u.t[-1]
        sparse = u.holes.any() or u.pace > HOLE * min(one.pace for one in measured)
        found |= {"u"} if overlap and sparse else set()
    return found


def without_repeats(t: Array, values: Mapping[str, Array], motions: Collection[str]) -> dict[str, Array]:
    """The channels of a table with a row for each change of any of them, each blank again where it is not its own.

    Such rows come in bursts, one for each channel of a loop or more, so that u and the motion hardly ever change in
    the same one, and none repeats all of the one before; {} for others.
    """
    fresh = {name: np.append(True, np.diff(x) != 0.0) for name, x in values.items()}
    steps, moved = np.diff(t), np.zeros(t.size, dtype=bool)
    for name in motions:
        moved |= fresh[name]
    if t.size < _USELESS or "u" not in fresh or not np.all(fresh["u"] | moved) or not np.all(steps >= 0.0):
        return {}
    if np.sum(fresh["u"] & moved) > 1 + _AT_ONCE * min(fresh["u"].sum(), moved.sum()):  # the first row has all
        return {}
    usual = HOLE * float(np.quantile(steps, _BUSY))
    own = [changes_of(t[fresh[name]], values[name][fresh[name]]).pace for name in motions]
    in_bursts = float(steps.mean()) > usual and min(own, default=0.0) > usual
    return {name: np.where(fresh[name], x, np.nan) for name, x in values.items()} if in_bursts else {}


def filled(one: Changes, until: float) -> tuple[Array, Array]:
    """Stamps and values of a motion with those that were not logged: at its pace, as far as `until`."""
    t = np.append(one.t, until) if until > one.t[-1] + one.pace else one.t
    x = np.append(one.x, one.x[-1:]) if t.size > one.x.size else one.x
    many = np.maximum(np.rint(np.diff(t) / one.pace), 1.0).astype(np.int64)
    start = np.repeat(np.arange(many.size), many)
    step = np.arange(start.size) - np.repeat(np.cumsum(many) - many, many)
    between = t[start] + step * (np.diff(t) / many)[start]
    return np.append(between, t[-1]), np.append(x[start], x[-1])


def held_at(one: Changes, rows: Array) -> tuple[Array, Array]:
    """Its own stamps and these rows, and what it is there; from its first value on."""
    t = np.union1d(one.t, rows[rows >= one.t[0]])
    return t, one.x[np.searchsorted(one.t, t, side="right") - 1]
