"""Which parts make the motion: the best few of many, exchanged while that helps, then their numbers refined.

Inner products of parts add up, so that a mix is judged without looking at rows again (exchange as in optimal design:
Fedorov 1972). A part that would need more u than allowed is made smaller first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from dsd_cli.design.inverse import Path
from dsd_cli.design.measure import Measure
from dsd_cli.design.motions import KINDS, ROOM, MotionSegment, Room, position_of
from dsd_cli.design.rows import Products
from dsd_cli.signals.log import Array

#: How often the whole is made: the search judges by blocks that no fit saw, so that what one part alone shows would be
#: extrapolation there.
TIMES = 2
#: Different parts, and s of the shortest and the longest; stairs both ways have so many rises of the acceleration.
_PARTS, _SHORTEST, _LONGEST, _RISES = 2, 0.8, 6.0, 16
#: Parts of each kind that are tried, their seed, by how much a part shrinks, and how often.
_TRIED, _SEED, _SHRINK, _SHRINKS = 8, 20261123, 0.75, 10
#: Evaluations of the refinement, for each part.
_REFINED = 12

Report = Callable[[float], None]


@dataclass(frozen=True)
class Sized:
    """A part within its limits, and its inner products."""

    part: MotionSegment
    products: Products


def _all(measure: Measure, parts: Sequence[Sized]) -> Products:
    return sum((one.products for one in parts), measure.nothing)


def joined(parts: Sequence[MotionSegment], room: Room) -> Array:
    """Position of the whole motion: one part after the other, shape (n,)."""
    pieces = [position_of(part, room) for part in parts]
    return np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])


def sized(measure: Measure, room: Room, part: MotionSegment) -> Sized | None:
    """The part, so small that no likely plant needs more u than is allowed; None where it does not help."""
    most, known = ROOM * room.limits.u, measure.search.equations
    reach = known.band.half * known.sample_time + measure.longest_delay + 4.0 * room.step
    rest = int(reach / room.step) + 1  # before and after it: the rows of a log reach into that
    for _ in range(_SHRINKS):
        position = position_of(part, room)
        if not np.ptp(position) > 0.0:
            return None
        path = Path.of(np.pad(position, rest, mode="edge"), room.step)
        largest = measure.most_u(path, 3.0 * room.limits.u)
        if largest <= most:
            return Sized(part, measure.of_paths({0: path}, room.limits.u))
        part = replace(part, scale=part.scale * max(_SHRINK, 0.95 * most / largest))
    return None


def library_of(measure: Measure, room: Room, seconds: float, report: Report = lambda _: None) -> list[Sized]:
    """Parts of every kind, for a motion of so many s: short ones, and long ones in which a slow axis gets farther."""
    random, found, asked = np.random.default_rng(_SEED), list[Sized](), [*product(_lengths(room, seconds), KINDS)]
    for i, (length, kind) in enumerate(asked):
        parts = [MotionSegment(kind, length, tuple(random.uniform(size=4).tolist())) for _ in range(_TRIED)]
        found += [one for part in parts if (one := sized(measure, room, part)) is not None]
        report((i + 1) / len(asked))
    return found


def _lengths(room: Room, seconds: float) -> list[float]:
    """s of parts, together no shorter than was asked for: of several in a motion, and of one alone if it may be."""
    each, fewest = seconds / TIMES, max(math.ceil(seconds / TIMES / _LONGEST), 1)
    most = max(min(_PARTS, int(each / max(_SHORTEST, _RISES * room.quickest))), fewest)
    return [math.ceil(each / n / room.step - 1e-6) * room.step for n in dict.fromkeys((most, fewest))]


def _chosen(measure: Measure, library: Sequence[Sized], seconds: float) -> list[Sized]:
    """Greedily, then each exchanged for a better one while there is one. library : parts of one length."""
    count = max(round(seconds / TIMES / library[0].part.seconds), 1)
    chosen: list[Sized] = []
    for _ in range(count):
        chosen.append(_best(measure, library, chosen))
    for _ in range(2):
        before = [id(one) for one in chosen]
        for i in range(count):
            rest = chosen[:i] + chosen[i + 1 :]
            chosen = [*rest[:i], _best(measure, library, rest), *rest[i:]]
        if [id(one) for one in chosen] == before:
            break
    return chosen


def _best(measure: Measure, library: Sequence[Sized], beside: Sequence[Sized]) -> Sized:
    known = _all(measure, beside)
    return max(library, key=lambda one: measure.worth(TIMES * (known + one.products)))


def optimised(measure: Measure, room: Room, seconds: float, library: Sequence[Sized]) -> tuple[MotionSegment, ...]:
    """The parts of a motion of so many s, the numbers of each where the whole is best. library : for that length."""
    lengths = dict.fromkeys(one.part.seconds for one in library)
    tried = [_chosen(measure, [one for one in library if one.part.seconds == s], seconds) for s in lengths]
    chosen = max(tried, key=lambda some: measure.worth(TIMES * _all(measure, some)))
    for i in range(len(chosen)):
        if not any(chosen[i] is one for one in chosen[:i]):
            rest = _all(measure, [one for k, one in enumerate(chosen) if k != i])
            chosen[i] = _refined_part(measure, room, chosen[i], rest)
    return tuple(one.part for one in chosen)


def _refined_part(measure: Measure, room: Room, part: Sized, rest: Products) -> Sized:
    """One part beside the others, whose inner products are `rest`."""
    from scipy.optimize import minimize

    tried = [(measure.worth(TIMES * (rest + part.products)), part)]

    def loss(values: Array) -> float:
        moved = replace(part.part, values=tuple(np.clip(values, 0.0, 1.0).tolist()), scale=1.0)
        one = sized(measure, room, moved)
        if one is None:
            return 1e3
        tried.append((measure.worth(TIMES * (rest + one.products)), one))
        return -tried[-1][0]

    begin = np.array(part.part.values)
    simplex = np.clip(np.vstack([begin, begin + 0.25 * np.where(begin < 0.5, 1.0, -1.0) * np.eye(4)]), 0.0, 1.0)
    minimize(loss, begin, method="Nelder-Mead", options={"maxfev": _REFINED, "initial_simplex": simplex})
    return max(tried, key=lambda one: one[0])[1]
