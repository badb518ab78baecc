"""Levels that differ between the logs of one rig: friction that warmed up, an offset of one day.

Effects say which of their values do (`Effect.varies`). Beside all functions of the motion such a value gets a deviation
in each log; those that are certain and of use are forces that are known to act in that log, and the search begins again
without them. The model keeps the mean of the logs. A force that depends on the place or the speed is no level, wherever
the logs were taken: what a function of the motion does as well is not identified.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from dsd_cli.effects import get_effect
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import excerpts
from dsd_cli.identify.recordings.levels import Deviations, may_differ, with_levels
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.drift_search import searched
from dsd_cli.identify.search.level_fits import Asked
from dsd_cli.identify.search.long_logs import Task
from dsd_cli.identify.search.sets import Search

#: Channels whose functions stand beside the levels in a second look, one pair at a time.
_PAIRS = (("velocity", "position"), ("velocity", "u"))
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
        found = _with_their_effects(_beside(task, now))
        then = deviations(found.search, found.whole)
        if _the_same(then, now):
            return found if _possible(found) else _beside(task, ())
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


def _with_their_effects(found: Levelled) -> Levelled:
    """With each effect whose level differs in place of one that stands in for the mean of its levels: a load that
    differs from log to log is there in one of them at least, and its mean looks like a weight that hardly turns."""
    search, whole = found.search, found.whole
    for name in dict.fromkeys(one.effect for one in found.levels if one.effect in search.allowed):
        if any(t.id == name for t in whole.terms):
            continue
        limit = (1.0 + POLICY.nearly_the_same) * search.problem.errors.rmse(whole)
        rest = (tuple(t for t in whole.terms if t != member) for member in search.added(whole.terms))
        fits = [search.fit((*terms, Term(name)), whole.tap) for terms in rest]
        near = [fit for fit in fits if search.problem.errors.rmse(fit) <= limit]
        if near:
            whole = search.settled(min(near, key=search.problem.errors.rmse))
    return replace(found, whole=whole)


def _possible(found: Levelled) -> bool:
    """Whether no log has a level beyond its bound by more than its error: friction that drives the axis."""
    values = found.search.problem.values(found.whole).estimates
    for one in found.levels:
        lower = get_effect(one.effect).parameter(one.parameter).lower
        mean = values[one.name].value if one.name in values else 0.0
        if any(mean + d < lower - s for d, s in zip(one.by_log, one.errors, strict=True)):
            return False
    return True


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
    for pair in _PAIRS:
        if names:
            beside = Asked(search, fit, pair)
            names = [key for key in names if beside.told(key) and beside.clear(key, names)]
    return tuple(replace(asked.values(key, names), alike=asked.alike(key, names)) for key in names)
