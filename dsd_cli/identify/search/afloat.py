"""The search where the motion is reconstructed and wanders: effects and the true path are found beside each other.

A set of effects tells where the axis was, and where it was tells the effects. On a path that is off, two or three
substitutes may stand in for one law (a spring and gravity for a cubic spring whose zero is elsewhere). So each effect
that depends on the place is asked alone as well, on the path that suits it best.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from dsd_cli.identify.fit.asked import Settings
from dsd_cli.identify.fit.drift import depends_on_path, placed, without_drift
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.long_logs import searched_as_is, searched_with
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.model import PlantModel

Report = Callable[[str, float], None]
Found = tuple[Search, Fit]


def searched(
    recordings: Sequence[Recording],
    model: PlantModel,
    settings: Settings,
    holdout: Sequence[Recording],
    report: Report = lambda _what, _share: None,
) -> Found:
    """(search that is ready to judge on all rows, the set of effects that nothing betters any more).

    Raises
    ------
    DataError, UsageError : as `pose`.
    """
    found = searched_as_is(recordings, model, settings, holdout, report)
    if not any(r.walk > 0.0 for r in recordings):
        return found
    paths = _Paths(recordings, model, settings, holdout)
    first = found
    for _ in range(POLICY.drift_rounds):
        path = paths.settled(*found)
        if not paths.better(path, found):
            break
        found = searched_as_is(path[0].problem.recordings, model, settings, holdout, report)
    alone = paths.alone(first[0], found)
    if alone is None:
        return found
    return searched_as_is(alone[0].problem.recordings, model, settings, holdout, report)


class _Paths:
    """Recordings whose motion wanders, and what is asked of them."""

    def __init__(
        self, recordings: Sequence[Recording], model: PlantModel, settings: Settings, holdout: Sequence[Recording]
    ) -> None:
        self.recordings, self.model, self.settings, self.holdout = recordings, model, settings, holdout

    def _with(self, recordings: Sequence[Recording], found: PlantModel) -> Found:
        search, fit = searched_with(recordings, found, self.model, self.settings, self.holdout)
        return search, search.converged(fit)

    def settled(self, search: Search, fit: Fit) -> Found:
        """The path that suits this set, and the set there."""
        best = search, fit
        for _ in range(POLICY.path_rounds):
            moved = without_drift(search.problem, fit, self.recordings)
            search, fit = self._with(moved, search.problem.scale.model(fit))
            if not self.better((search, fit), best):
                break
            best = search, fit
        return best

    def better(self, after: Found, before: Found) -> bool:
        """Whether the held-out error falls by enough."""
        return _error(after) < POLICY.drift_gain * _error(before)

    def alone(self, search: Search, found: Found) -> Found | None:
        """One effect that on its own path explains as much as the set that was found, or nearly; None if none does.

        search : of candidates, on the motion as it was reconstructed.
        """
        count = len(found[0].added(found[1].terms))
        if count < 2 and _error(found) < POLICY.floor_factor * found[0].problem.floor:
            return None
        asked = [(o, o.fit.terms[-1]) for o in search.options(search.refit)]
        options = [o for o, term in asked if depends_on_path(term) and "position" in term.effect.needs]
        starts = [(placed(search.problem, o.fit, self.recordings), o.fit) for o in options]
        starts = [(start, fit) for start, fit in starts if start.left < POLICY.drift_gain**2 * start.before]
        starts.sort(key=lambda start: start[0].left)
        model = search.problem.scale.model
        paths = [self.settled(*self._with(p.recordings, model(fit))) for p, fit in starts[: POLICY.paths_alone]]
        limit = (1.0 + POLICY.nearly_the_same if count > 1 else POLICY.drift_gain) * _error(found)
        return min((p for p in paths if _error(p) < limit), key=_error, default=None)


def _error(found: Found) -> float:
    """Held-out rms, unit of u."""
    return found[0].problem.errors.rmse(found[1])
