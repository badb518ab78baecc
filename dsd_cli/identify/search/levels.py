"""Levels that differ between the logs of one rig: friction that warmed up, an offset of one day.

A force that depends on the place or the speed is no level, wherever the logs were taken: what a function of the motion
does as well is not identified.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dsd_cli.effects import get_effect
from dsd_cli.identify.fit.bank import Bank, Term, has_friction
from dsd_cli.identify.fit.blocks import Grams, grams, losses, solve, spread_over_blocks, squares, total_gram
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.freeform import freeform_fits
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.row_weights import inflation, many_sure
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import Deviations, excerpts, may_differ, with_levels
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.drift_search import searched
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.task import Task
from dsd_cli.signals.log import Array
from dsd_cli.signals.passes import mixed

#: Channels of the motion whose functions stand beside the levels.
_MOTION = (("velocity",), ("position",))
#: Of the rows of a regression in the forward form: what drives.
_DRIVE = 1
#: Of the size of columns, added to make them invertible: functions of two channels have the constant in common.
_RIDGE = 1e-7
#: Of the mean square of a column in the log that has most of it, that each log has: else there is nothing to compare.
_LEAST_SIZE = 1e-3
#: Effect, parameter, and the column that it multiplies.
Key = tuple[str, str, int]


class Asked:
    """Levels per log beside a fit and functions of its motion: regressions out of one set of inner products."""

    def __init__(self, search: Search, fit: Fit, pair: tuple[str, ...] = ()) -> None:
        self.search, self.fit, problem = search, fit, search.problem
        plain, white = _without_known(problem.errors.bank), search.equations
        self.logs = white.logs_of_rows
        fits = freeform_fits(plain, white, problem.blocks, fit, search.solver.inertia)
        fits = replace(fits, apart=POLICY.level_knots_apart)
        groups = [g for g in fits.groups() if g in (*_MOTION, pair)]
        rows, of_u = list(fits.base), [] if fit.inverse else [_DRIVE]
        for group in groups:
            made = fits.columns(group)[0]
            of_u += range(len(rows), len(rows) + len(made)) if "u" in group else ()
            rows += made
        self._motion = [i for i in range(1, len(rows)) if i not in of_u]
        self._others, self.columns = list(range(1, len(rows))), dict[Key, list[int]]()
        for key, column in varying(search, fit, plain):
            made = by_log(column, self.logs)
            if made:
                self.columns[key] = list(range(len(rows), len(rows) + len(made)))
                rows += made
        sure = _sure(white, has_friction(fit.terms))
        self._counted = float(sure.sum())
        self._rows, made = rows, [white.whitened(x) * sure for x in rows]
        self._white, self._nats = grams(made, problem.blocks), min(search.noise.nats, _nats(made, sure))

    def told(self, key: Key) -> bool:
        """Whether the motion leaves enough of its columns: logs at other places identify no levels. u itself has
        them."""
        motion = self._motion if self.fit.inverse else [0, *self._motion]
        return all(
            self._squares(self._white, motion, i) > POLICY.level_own_share * self._white.total[i, i]
            for i in self.columns[key]
        )

    def gain(self, key: Key, names: Sequence[Key]) -> float:
        """Nats on held-out blocks, without a price."""
        return float(self._gains(self._white, key, names).sum()) / self._nats

    def certain(self, key: Key, names: Sequence[Key]) -> bool:
        """Whether it differs between logs beside those levels, on held-out blocks, too."""
        if not self.clear(key, names):
            return False
        gains = self._gains(self._white, key, names) / self._nats
        price = POLICY.effect_price * len(self.columns[key])
        return float(gains.sum()) - price > POLICY.least_gain and spread_over_blocks(gains)

    def clear(self, key: Key, names: Sequence[Key]) -> bool:
        """Whether it differs by more than its error, and by what is of use."""
        one = self.values(key, names)
        most = max(abs(d) / max(s, 1e-300) for d, s in zip(one.by_log, one.errors, strict=True))
        return most > POLICY.value_deviations and self._of_use(key, names)

    def alike(self, key: Key, names: Sequence[Key]) -> tuple[str, ...]:
        """Effects whose levels would do in its place: motion in one direction does not distinguish friction from a
        load."""
        used, rest = self._used(key, names)
        least = self._losses(self._white, used).sum() + POLICY.least_gain * self._nats
        others = [one for one in self.columns if one not in names]
        return tuple(one[0] for one in others if self._losses(self._white, [*rest, *self.columns[one]]).sum() < least)

    def _of_use(self, key: Key, names: Sequence[Key]) -> bool:
        """See `Problem.falls`; of all rows, for the blocks have shown that it is there."""
        count = max(int(self.search.equations.kept.sum()), 1)
        was, now = (math.sqrt(self._squares(self._plain, which) / count) for which in reversed(self._used(key, names)))
        return self.search.problem.falls(was, now, self.fit)

    def values(self, key: Key, names: Sequence[Key]) -> Deviations:
        """Beside all others, with the jackknife's standard errors."""
        used, _ = self._used(key, names)
        found, at = self._white.of([0, *used]), [used.index(i) for i in self.columns[key]]
        stack = np.concatenate([found.total[None], found.total - found.held_out])
        theta = -self._inertia * solve(stack, _RIDGE)[:, at]
        theta = np.column_stack([theta, -theta.sum(axis=1)])
        count = len(theta) - 1
        spread = np.sqrt((count - 1.0) * np.mean((theta[1:] - theta[1:].mean(axis=0)) ** 2, axis=0))
        effect, parameter, column = key
        return Deviations(effect, parameter, column, *(tuple(x.tolist()) for x in (theta[0], spread)))

    def _gains(self, found: Grams, key: Key, names: Sequence[Key]) -> Array:
        """By how much the squares of each held-out block fall with it, shape (B,)."""
        used, rest = self._used(key, names)
        return self._losses(found, rest) - self._losses(found, used)

    def _used(self, key: Key, names: Sequence[Key]) -> tuple[list[int], list[int]]:
        """Columns with those levels, and the same without that of `key`."""
        used = [*self._others, *(i for n in names for i in self.columns[n])]
        return used, [i for i in used if i not in self.columns[key]]

    @cached_property
    def _inertia(self) -> float:
        """J over that of the forward form, by the inverse form beside functions of the motion and all levels.

        0 where it is none. The noise of the acceleration is taken off. Functions of u would explain u. 1 where the
        inverse form is solved itself.
        """
        if self.fit.inverse:
            return 1.0
        gram = self._white.of([_DRIVE, 0, *self._motion, *(i for at in self.columns.values() for i in at)]).total.copy()
        noise = self.search.solver.bank.variance * self.search.solver.inertia**2 * self._counted
        gram[1, 1] -= min(noise, 0.5 * gram[1, 1])
        return max(float(solve(gram[None], _RIDGE)[0][0]), 0.0)

    @staticmethod
    def _squares(found: Grams, used: Sequence[int], target: int = 0) -> float:
        """What those columns leave of a row, all rows fitted."""
        gram = found.of([target, *used]).total
        return squares(gram, solve(gram[None], _RIDGE)[0])

    @cached_property
    def _plain(self) -> Grams:
        """Of rows in the unit of u."""
        problem = self.search.problem
        return grams([x * problem.equations.kept for x in self._rows], problem.blocks)

    def _losses(self, found: Grams, used: Sequence[int]) -> Array:
        some = found.of([0, *used])
        return losses(solve(some.fitted, _RIDGE), some, self.search.problem.blocks)


def by_log(column: Array, logs: NDArray[np.int_]) -> list[Array]:
    """A column for each log but the last, which has minus their sum; none where one log has nothing in the column."""
    count = int(logs.max()) + 1
    size = np.bincount(logs, column**2, count) / np.maximum(np.bincount(logs, minlength=count), 1)
    if size.min() <= _LEAST_SIZE * size.max():
        return []
    last = np.where(logs == count - 1, column, 0.0)
    return [np.where(logs == i, column, 0.0) - last for i in range(count - 1)]


def varying(search: Search, fit: Fit, bank: Bank) -> Iterator[tuple[Key, Array]]:
    """Values that may differ between logs, of effects of the fit and of those that may be added, and their columns."""
    for name in dict.fromkeys((*(t.id for t in fit.terms), *search.allowed)):
        effect = get_effect(name)
        if not effect.varies or effect.searched or effect.memory or effect.split is not None:
            continue
        columns = bank.columns(Term(name), fit.tap, held=has_friction(fit.terms))
        linear = (p.name for p in effect.parameters if p.linear)
        for i, (parameter, column) in enumerate(zip(linear, columns, strict=True)):
            if parameter in effect.varies and f"{name}.{parameter}" not in search.solver.known.fixed:
                yield (name, parameter, i), column


def _without_known(bank: Bank) -> Bank:
    """The same rows in the unit of u without any levels known of single logs."""
    equations = bank.equations
    if not any(s.levels for s in equations.stretches):
        return bank
    return Bank(replace(equations, stretches=tuple(replace(s, levels=()) for s in equations.stretches)))


def _nats(rows: Sequence[Array], counted: Array) -> float:
    """Squares per nat of what all columns leave of the first row: levels that are not known yet are no noise."""
    gram = total_gram(rows)
    left = rows[0] - mixed(rows[1:], solve(gram[None], _RIDGE)[0])
    free = max(float(counted.sum()) - len(rows), 0.1 * float(counted.sum()))
    return 2.0 * float(left @ left) / free * inflation(left)


def _sure(equations: Equations, held: bool) -> Array:
    """1 in rows in which the direction of friction is sure, if there is any; in all if few are so."""
    sure = many_sure(equations) if held else None
    return (equations.kept if sure is None else sure).astype(np.float64)


#: Rounds of levels and sets that are found beside each other, and the change of a level that ends them.
_ROUNDS, _SETTLED = 9, 2e-3


@dataclass(frozen=True)
class Levelled:
    """A search that knows the levels of each log: the recordings of `task` have them as forces.

    plain : the recordings without.
    """

    plain: tuple[Recording, ...]
    task: Task
    search: Search
    whole: Fit
    levels: tuple[Deviations, ...] = ()


def levelled(task: Task) -> Levelled:
    """The search over these recordings, with levels per log where they differ. Raises as `pose`."""
    if not may_differ(task.recordings):
        return _beside(task, ())
    if task.settings.levels is not None:
        return _beside(task, task.settings.levels)
    now = _at_first(Search(pose(excerpts(task.recordings), task.model, task.settings, task.holdout)))
    for _ in range(_ROUNDS):
        found = _beside(task, now)
        then = deviations(found.search, found.whole)
        if _the_same(then, now):
            return found
        if not then:
            break
        now = then
    return _beside(task, ())  # levels that go on changing, or that none are left beside, stand in for something else


def _beside(task: Task, levels: tuple[Deviations, ...]) -> Levelled:
    """The search beside these levels."""
    there = replace(task, recordings=with_levels(task.recordings, levels))
    return Levelled(task.recordings, there, *searched(there), levels)


def _at_first(search: Search) -> tuple[Deviations, ...]:
    """Levels beside functions of the motion, and of u, alone: a search that knows none stands in for them as it can."""
    return deviations(search, search.refit) or deviations(search, search.refit, ("u",))


def _the_same(a: Sequence[Deviations], b: Sequence[Deviations]) -> bool:
    """Whether these are the same levels, within a standard error or a small share."""
    if [x.name for x in a] != [x.name for x in b]:
        return False
    pairs = ((p, q, s) for x, y in zip(a, b, strict=True) for p, q, s in zip(x.by_log, y.by_log, x.errors, strict=True))
    return all(abs(p - q) <= max(s, _SETTLED * abs(q)) for p, q, s in pairs)


def deviations(search: Search, fit: Fit, more: tuple[str, ...] = ()) -> tuple[Deviations, ...]:
    """Levels that differ between the logs beside a fit, whatever levels are known already.

    more : channels of a further function that may be there.
    """
    asked = Asked(search, fit, more)
    names = [key for key in asked.columns if asked.told(key)]
    while names:
        doubtful = [key for key in names if not asked.certain(key, names)]
        if not doubtful:
            break
        names.remove(min(doubtful, key=lambda key: asked.gain(key, names)))
    return tuple(replace(asked.values(key, names), alike=asked.alike(key, names)) for key in names)
