"""The search where the motion is reconstructed and wanders: effects and the true path are found beside each other.

On a path that is off, two or three substitutes may stand in for one law. So the model as it is, and each effect that
depends on the place alone, are asked as well, on the path that suits them best.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from dsd_cli.identify.fit.bank import has_friction
from dsd_cli.identify.fit.path_estimate import Placed, depends_on_path, placed, without_drift
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.search.task import Task, searched_as_is, searched_with
from dsd_cli.plant.model import PlantModel

Found = tuple[Search, Fit]
#: Rounds in which a set settles on its path, and a path beside its set; each halves a step too far.
_ROUNDS = 6
#: Paths that are followed, of effects that are asked alone, each on the path that suits it.
_PATHS_ALONE = 2
#: Why an effect cannot be told that another path explains as well.
LOOKS_THE_SAME = "a reconstructed speed or position that is off by a constant looks the same: log the position"


def searched(task: Task) -> Found:
    """(search that is ready to judge on all rows, the set of effects that nothing betters any more).

    Raises DataError, UsageError as `pose`.
    """
    found = searched_as_is(task)
    if not any(r.walk > 0.0 for r in task.recordings):
        return found
    paths = _Paths(task)
    first = found
    for _ in range(_ROUNDS):
        path = paths.settled(*found)
        if not paths.better(path, found):
            break
        found = searched_as_is(replace(task, recordings=path[0].problem.recordings))
    simpler = paths.simpler(first[0], found)
    if simpler is None:
        return found
    tied = [] if simpler[0].added(simpler[1].terms) else [t.id for t in found[0].added(found[1].terms)]
    rest = replace(task.settings, effects=tuple(name for name in found[0].allowed if name not in tied))
    search, whole = searched_as_is(replace(task, recordings=simpler[0].problem.recordings, settings=rest))
    untestable = {**search.problem.untestable, **dict.fromkeys(tied, LOOKS_THE_SAME)}
    search.problem = replace(search.problem, untestable=untestable)
    return search, whole


@dataclass(frozen=True)
class _Paths:
    """Recordings whose motion wanders, and what is asked of them."""

    task: Task

    def _with(self, recordings: tuple[Recording, ...], found: PlantModel) -> Found:
        search, fit = searched_with(replace(self.task, recordings=recordings), found)
        return search, search.converged(fit)

    def settled(self, search: Search, fit: Fit) -> Found:
        """The path that suits this set, and the set there."""
        best = search, fit
        for _ in range(_ROUNDS):
            moved = without_drift(search.problem, fit, self.task.recordings)
            search, fit = self._with(moved, search.problem.scale.model(fit))
            if not self.better((search, fit), best):
                break
            best = search, fit
        return best

    def better(self, after: Found, before: Found) -> bool:
        """Whether the held-out error falls by enough."""
        return _error(after) < (1.0 - POLICY.clear_fall) * _error(before)

    def simpler(self, search: Search, found: Found) -> Found | None:
        """Fewer effects that on their own path explain as much as the set that was found, or nearly; None if none do.

        No effect at all first: a speed that is off by a constant makes a constant load of viscous friction. Then one.

        search : of candidates, on the motion as it was reconstructed.
        """
        count = len(found[0].added(found[1].terms))
        limit = (1.0 + POLICY.nearly_the_same) * _error(found)
        if count and any(map(depends_on_path, search.base)):
            path = self._followed(search, search.refit)
            if _error(path) < limit:
                return path
        if count < 2 and _error(found) < POLICY.floor_factor * found[0].problem.floor:
            return None
        asked = [(o.fit, o.fit.terms[-1]) for o in search.options(search.refit)]
        fits = [fit for fit, term in asked if depends_on_path(term) and not has_friction((term,))]
        starts = [(placed(search.problem, fit, self.task.recordings), fit) for fit in fits]
        starts = [(start, fit) for start, fit in starts if start.left < (1.0 - POLICY.clear_fall) ** 2 * start.before]
        starts.sort(key=lambda start: start[0].left)
        paths = [self._followed(search, fit, start) for start, fit in starts[:_PATHS_ALONE]]
        limit = limit if count > 1 else (1.0 - POLICY.clear_fall) * _error(found)
        return min((p for p in paths if _error(p) < limit), key=_error, default=None)

    def _followed(self, search: Search, fit: Fit, start: Placed | None = None) -> Found:
        """A set on the path that suits it, from the zero and the constant speed that leave least."""
        begin = start or placed(search.problem, fit, self.task.recordings)
        return self.settled(*self._with(begin.recordings, search.problem.scale.model(fit)))


def _error(found: Found) -> float:
    """Held-out rms, unit of u."""
    return found[0].problem.errors.rmse(found[1])
