"""Which channel makes the axis move: it is what acceleration, friction and place of a motion add up to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from typing import NamedTuple

import numpy as np

from dsd_cli.signals.facts import slope_of
from dsd_cli.signals.log import Array
from dsd_cli.signals.twins import WINDOWS, averages, lead_of

#: Blocks of rows that are averaged into one, at most so many of them; two such sizes are tried.
BLOCKS = (4000, 600)
#: Samples by which the cause may come before the motion.
EARLIER = (0, 1, 2, 4, 8, 16)
#: Parts of the log of which every other one is foretold from the rest.
PARTS = 10
#: Rows of a regression for each of its columns, at least.
ROWS_PER_COLUMN = 8
#: A later lag, or another cause, is the better one from this much more of the variance on.
BETTER = 0.005
#: Nearer than this to another share it could be that one as well.
AS_WELL = 0.05
#: A channel of which one column of the motion alone leaves less than this is that column in another unit.
SAME = 0.015
_CONSTANT, _FREE = 3, 4  # among the columns of the motion; those before have no place


class Cause(NamedTuple):
    """`share` of the channel's variance that the motion explains in rows held out; `alone`: by one column alone.

    `placed` : without the place the motion explains less.
    """

    share: float
    alone: float
    lag: int
    placed: bool = False


def motion_columns(dt: float, x: Array, kind: str, size: int) -> Array:
    """Acceleration, velocity, direction, one (and place and its square, of weights and springs) of the means of blocks.

    Of shape (blocks, k). x : position or velocity, shape (n,); kind : which. size : samples in a block.
    """
    rows = x.size // size
    mean = x[: rows * size].reshape(rows, size).mean(axis=1)
    step = dt * size
    if kind == "velocity":
        v, a = mean[1:-1], (mean[2:] - mean[:-2]) / (2.0 * step)
        place: list[Array] = []
    else:
        v, a = (mean[2:] - mean[:-2]) / (2.0 * step), (mean[2:] - 2.0 * mean[1:-1] + mean[:-2]) / step**2
        place = [mean[1:-1], (mean[1:-1] - mean.mean()) ** 2]
    rest = 0.02 * float(np.sqrt(np.mean(v**2))) + 1e-300
    return np.column_stack([a, v, v / np.hypot(v, rest), np.ones(v.size), *place])


def cause_of(dt: float, x: Array, kind: str, u: Array) -> Cause:
    """How well `u`, as it was some samples before, is a sum of what the motion `x` has; both finite, shape (n,)."""
    best = Cause(0.0, 0.0, 0)
    # of what a spoiled file holds (1e307) a power is no number any more; of a power of two all digits stay
    x, u = (np.ldexp(one, -np.frexp(np.abs(one).max(initial=0.0))[1]) for one in (x, u))
    for blocks in BLOCKS:
        size = max(x.size // blocks, 1)
        columns = motion_columns(dt, x, kind, size)
        if columns.shape[0] < ROWS_PER_COLUMN * columns.shape[1]:
            continue
        for lag in EARLIER:
            late = np.concatenate([np.full(lag, u[0]), u[: u.size - lag]])
            rows = u.size // size
            y = late[: rows * size].reshape(rows, size).mean(axis=1)[1:-1]
            share = _held_out(columns, y)
            if share > best.share + BETTER:
                alone = max(_held_out(columns[:, [k, _CONSTANT]], y) for k in range(columns.shape[1]) if k != _CONSTANT)
                best = Cause(share, alone, lag, _held_out(columns[:, :_FREE], y) < share - AS_WELL)
    return best


def _held_out(columns: Array, y: Array) -> float:
    """Share of the variance of y that the columns explain where they were not fitted, two ways; below 0 is 0."""
    scale = np.abs(columns).max(axis=0)
    columns = columns[:, scale > 0.0] / scale[scale > 0.0]
    part = (np.arange(y.size) * PARTS // max(y.size, 1)) % 2
    left = total = 0.0
    for fitted in (0, 1):
        on = part == fitted
        if np.count_nonzero(on) < 2 * columns.shape[1] or np.count_nonzero(~on) < 2:
            return 0.0
        theta = np.linalg.lstsq(columns[on], y[on], rcond=1e-8)[0]
        left += float(np.sum((y[~on] - columns[~on] @ theta) ** 2))
        total += float(np.sum((y[~on] - y.mean()) ** 2))
    return max(0.0, 1.0 - left / total) if total > 0.0 else 0.0


AS_TOLD, ONLY_CAUSE = "as you say", "nothing else says that it is the motion"


@dataclass(frozen=True)
class Guess:
    """A channel's column, why it is taken for that, and what speaks against it ("" for nothing)."""

    column: str
    reason: str
    doubt: str = ""


class Motion(NamedTuple):
    """A column and the role that it has or may have, position or velocity."""

    column: str
    kind: str


@dataclass
class Look:
    """What is known so far: values without holes, on steps of `dt` (1 where there is no clock).

    `rivals` : role -> columns that are called so as well, best first. `steps` : those of two levels, which no motion
    explains, and one of which may be u. `asked` : what was asked for, by its name. `again` : by what it does, or the
    motion by another sensor.
    """

    values: dict[str, Array]
    t: Array
    dt: float
    found: dict[str, Guess]
    never_motion: frozenset[str] = frozenset()
    never_cause: frozenset[str] = frozenset()
    rivals: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    steps: frozenset[str] = frozenset()
    asked: frozenset[str] = frozenset()
    causes: dict[str, Cause] = field(default_factory=dict)
    again: frozenset[str] = frozenset()

    def free(self) -> list[str]:
        taken = {guess.column for guess in self.found.values()}
        return [name for name in self.values if name not in taken]

    def named_too(self, role: str) -> list[str]:
        """Those of them whose names make them that as well."""
        return [name for name in self.rivals.get(role, ()) if name in self.free()]

    def movable(self) -> list[str]:
        """Those of them that may be a motion that was measured."""
        return [name for name in self.free() if name not in self.never_motion | self.asked]


#: A channel makes an axis move from this share of it on that the motion explains; less than the second is a guess.
IS_CAUSE, CLEARLY = 0.3, 0.7


def find_cause(look: Look) -> None:
    """u: what the motion explains best; where no motion is known, the pair that does so best."""
    found = look.found
    motions = [Motion(found[role].column, role) for role in ("velocity", "position") if role in found]
    motions = [one for one in motions if one.column in look.values]
    known = bool(motions)
    candidates = [found["u"].column] if "u" in found and found["u"].column in look.values else look.free()
    if known and "position" not in found and look.named_too("velocity"):
        motions = [_of_speeds(look, motions[0], [name for name in candidates if name not in look.never_cause])]
    if "u" in found and known:
        _doubt_cause(look, motions)
        return
    if known:
        pairs = [(name, one.column) for name in candidates for one in motions if one.column != name]
        look.again |= {x for x, moved in pairs if lead_of(look.values[x], look.values[moved]) is not None}
    candidates = [name for name in candidates if name not in look.never_cause | look.again]
    if not known:
        kinds = ("velocity", "position")
        motions = [Motion(name, kind) for name in look.movable() for kind in kinds]
    best = _best(look, motions, candidates, known)
    if best is None or best[0] < (IS_CAUSE if known else CLEARLY):
        return
    if known or "u" in found or not _as_likely(look, *best):
        _take(look, *_raw(look, *best, candidates))


def _of_speeds(look: Look, first: Motion, candidates: Sequence[str]) -> Motion:
    """Of several that only their names make the velocity the one that explains what makes it move best."""
    called = [first, *(Motion(name, "velocity") for name in look.named_too("velocity"))]
    share, best, cause = _best(look, called, candidates, True) or (0.0, first, "")
    if share < CLEARLY or best == first:
        return first
    look.found["velocity"] = Guess(best.column, f"it explains {cause} better than {first.column} does")
    return best


def _best(
    look: Look, motions: Sequence[Motion], candidates: Sequence[str], known: bool
) -> tuple[float, Motion, str] | None:
    """What is explained best, how well, and by which motion; `known`: there is no doubt that these are motions."""
    best: tuple[float, Motion, str] | None = None
    of_speed: dict[tuple[str, str], float] = {}
    some = {} if known else {name: look.values[name] for name in {*candidates, *(one.column for one in motions)}}
    copies = {frozenset((a, b)) for a, b in permutations(some, 2) if averages(some[a], some[b])}
    for motion in motions:
        x = look.values[motion.column]
        for name in candidates:
            y = look.values[name]
            if name == motion.column or {motion.column, name} in copies or lead_of(x, y) is not None:
                continue
            cause = cause_of(look.dt, x, motion.kind, y)
            if cause.alone > 1.0 - SAME:  # the motion itself in another unit
                continue
            if cause.share > look.causes.get(name, Cause(0.0, 0.0, 0)).share:
                look.causes[name] = cause
            simpler = max(cause.alone, of_speed.setdefault((motion.column, name), cause.share))
            if best is None or cause.share > best[0] + BETTER:
                speed = not known and cause.placed and simpler > cause.share - AS_WELL  # whose friction it is
                best = cause.share, motion._replace(kind="velocity") if speed else motion, name
    return best


def _as_likely(look: Look, share: float, motion: Motion, name: str) -> bool:
    """Whether, where neither the motion nor what causes it is known, others do as well: these two turned, another u,
    or these two as position and velocity, with one of the others for u or none."""
    turned = look.causes.get(motion.column, Cause(0.0, 0.0, 0)).share > share - AS_WELL
    slope = slope_of(look.t, look.values[motion.column], look.values[name], WINDOWS)
    return bool(turned or slope.share > share - AS_WELL or _as_well(look, share, motion, name))


def _raw(look: Look, share: float, motion: Motion, name: str, candidates: Sequence[str]) -> tuple[float, Motion, str]:
    """The same with the channel that was averaged to make what is explained best: that is late, and no cause."""
    may = {one: look.causes[one].share for one in candidates if one in look.causes and one != motion.column}
    raw = [one for one in may if may[one] > IS_CAUSE and averages(look.values[one], look.values[name])]
    best = max(raw, key=lambda one: may[one], default=name)
    return may.get(best, share), motion, best


def _doubt_cause(look: Look, motions: Sequence[Motion]) -> None:
    """Of forces that only names make u, one gives way to another that the motion explains clearly better.

    None is u where that does so by less. The motion in another unit, and what was asked for, make no doubt.
    """
    mine = look.found["u"].column
    others = look.named_too("u")
    if mine not in look.values or not others:
        return
    moved = [look.values[one.column] for one in motions]
    for name in (mine, *others):
        causes = [cause_of(look.dt, x, one.kind, look.values[name]) for x, one in zip(moved, motions, strict=True)]
        same = name != mine and any(np.corrcoef(x, look.values[name])[0, 1] ** 2 > 1.0 - SAME for x in moved)
        look.causes[name] = Cause(0.0, 1.0, 0) if same else max(causes, key=lambda one: one.share)
    most = max(look.causes[name].share for name in others)  # a current, or the voltage that makes it, as well
    best = next(name for name in others if look.causes[name].share > most - AS_WELL)
    share, own = look.causes[best].share, look.causes[mine].share
    if share - own > IS_CAUSE:
        look.found["u"] = Guess(best, f"the motion explains {100 * share:.0f} % of it, and {100 * own:.0f} % of {mine}")
    elif own < CLEARLY and share - own > AS_WELL and best not in look.asked:
        del look.found["u"]


def _as_well(look: Look, share: float, motion: Motion, name: str) -> list[str]:
    """Other channels that the motion explains about as well."""
    besides = (name, motion.column)
    return [one for one, cause in look.causes.items() if one not in besides and cause.share > share - AS_WELL]


def _take(look: Look, share: float, motion: Motion, name: str) -> None:
    found = look.found
    if not any(role in found for role in ("velocity", "position")):
        found[motion.kind] = Guess(motion.column, f'its {_parts(motion.kind)} explain "{name}"', ONLY_CAUSE)
    if "u" in found:
        return
    why = f"{_parts(motion.kind)} of {motion.column} explain {100 * share:.0f} % of it"
    others = _as_well(look, share, Motion(found[motion.kind].column, motion.kind), name)
    doubt = f"{others[0]} is explained as well" if others else "" if share > CLEARLY else "that is not much"
    found["u"] = Guess(name, why, doubt)


def _parts(kind: str) -> str:
    return "acceleration, speed, direction and place" if kind == "position" else "acceleration, speed and direction"
