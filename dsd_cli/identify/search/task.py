"""Which set of effects explains recordings: of any length, sought in excerpts and judged on all rows; and where the
motion is reconstructed and wanders, effects and the true path beside each other.

On a path that is off, two or three substitutes may stand in for one law. So the model as it is, and each effect that
depends on the place alone, are asked as well, on the path that suits them best.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsd_cli.effects import kind_of
from dsd_cli.identify.fit.bank import has_friction
from dsd_cli.identify.fit.driven_load import both_driven
from dsd_cli.identify.fit.path_estimate import Placed, depends_on_path, placed, without_drift
from dsd_cli.identify.fit.problem import Problem, asked_of_all, pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import excerpts, with_part
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.sets import Option, Search
from dsd_cli.plant.model import PlantModel


class Judge(Search):
    """A search over all rows that takes candidates and their shapes from one over excerpts."""

    def __init__(self, problem: Problem, excerpt: Search) -> None:
        super().__init__(problem)
        self.excerpt: Search = excerpt

    @cached_property
    def refit(self) -> Fit:
        """The model's own effects with all values free, in the shapes that they have in the excerpts."""
        return self.fit(self.excerpt.refit.terms, self.excerpt.refit.tap)

    def _all_options(self, current: Fit) -> list[Option]:
        found = self.excerpt.options(self.excerpt.fit(current.terms, current.tap))
        return [self._also_here(current, option) for option in found]

    def challenger(self, rest: Fit, member: str, own: float) -> Option | None:
        """See `Search.challenger`."""
        share = self.excerpt.problem.blocks.rows / self.problem.blocks.rows
        best = self.excerpt.challenger(self.excerpt.fit(rest.terms, rest.tap), member, share * own)
        return None if best is None else self._also_here(rest, best)

    def _also_here(self, current: Fit, found: Option) -> Option:
        """The last effect of an option of the excerpts beside a fit to all rows."""
        fit = self.fit((*current.terms, found.fit.terms[-1]), found.fit.tap)
        return Option(found.effect, fit, self.evidence(fit))


Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Task:
    """What is searched for: the effects that `model` lacks of recordings; no fit sees those of `holdout`.

    report : called with what is being done and the share that is done.
    """

    recordings: tuple[Recording, ...]
    model: PlantModel
    settings: Settings
    holdout: tuple[Recording, ...] = ()
    report: Progress = lambda _what, _share: None


def searched_with(task: Task, found: PlantModel) -> tuple[Search, Fit]:
    """(search that is ready to judge, the set that a model has which was found elsewhere), nothing searched for.

    found : the model with more effects in it.
    """
    found = task.settings.known.applied(found)
    recordings, holdout = both_driven(task.recordings, task.holdout, found)
    parts = excerpts(recordings)
    search = Search(pose(parts, task.model, task.settings, holdout, near=found.delay))
    terms, tap = terms_of(found), round(found.delay / search.solver.bank.tap_time)
    search = Search(search.problem.measured_again(search.fit(terms, tap)))
    whole = search.fit(terms, tap)
    judge = _over_all(search, recordings, holdout, whole)
    return judge, whole if judge is search else judge.fit(terms, whole.tap)


def posed(recordings: Sequence[Recording], model: PlantModel, settings: Settings, near: float) -> Search:
    """A search on all rows, nothing searched for: noise, and shapes of the model's effects, are those of excerpts.

    near : about the delay, s.
    """
    search = Search(pose(excerpts(recordings), model, settings, near=near))
    return _over_all(search, recordings, (), search.refit)


def searched_as_is(task: Task) -> tuple[Search, Fit]:
    """(search that is ready to judge on all rows, the set of effects that nothing betters any more), on the motion as
    the recordings have it. Raises as `pose`.
    """
    parts = excerpts(task.recordings)
    search, whole = _found(task, parts)
    judge, judged = _on_all(task, search, whole)
    worst = None if judge is search else _less_explained(judge, judged, parts)
    if worst is None:
        return judge, judged
    del search, judge, judged  # their rows and columns are as large as those that come
    return _on_all(task, *_found(task, with_part(parts, task.recordings, *worst), begun=whole))


def _over_all(search: Search, recordings: Sequence[Recording], holdout: Sequence[Recording], fit: Fit) -> Search:
    """The search over all rows that takes its candidates from one over excerpts; that itself where nothing was left
    out: the logs are short enough to be searched as they are."""
    if sum(r.samples for r in search.problem.recordings) == sum(r.samples for r in recordings):
        return search
    return Judge(asked_of_all(search.problem, recordings, holdout, fit), search)


def _found(task: Task, parts: Sequence[Recording], begun: Fit | None = None) -> tuple[Search, Fit]:
    """(search of these parts with the noise measured beside the set, that set); `begun` : one that was found in fewer
    parts."""
    search, report = Search(pose(parts, task.model, task.settings, task.holdout)), task.report
    if begun is None:
        report("sets of effects", 0.2)
        whole = search.run(search.refit, lambda share: report("sets of effects", 0.2 + 0.3 * share), to_friction=True)
        if has_friction(whole.terms) and not has_friction(search.refit.terms):
            again = Search(search.problem.measured_again(whole))
            if again.equations.row_weight is not None:  # friction decides which rows count
                search, whole = again, again.settled(again.fit(whole.terms, whole.tap))
            whole = search.run(whole)
    else:
        whole = search.fit(begun.terms, begun.tap)
    search = Search(search.problem.measured_again(whole))
    report("sets of effects, the noise measured anew", 0.5)
    whole = search.run(search.settled(search.fit(whole.terms, whole.tap)))
    kept = _kept(search, task.settings)
    if kept is not None and kept.terms != whole.terms:
        whole = max(whole, search.run(kept), key=search.evidence)
    return search, whole


def _kept(search: Search, settings: Settings) -> Fit | None:
    """What the last rung found, as far as it is asked for; single events are found beside the laws."""
    if settings.begun is None:
        return None
    asked, own = {kind_of(name) for name in search.allowed}, {t.id for t in search.base}
    there = [t for t in terms_of(settings.begun) if t.id in own or (kind_of(t.id) in asked and not t.effect.listed)]
    if not own <= {t.id for t in there}:
        return None
    return search.settled(search.fit(tuple(there), round(settings.begun.delay / search.solver.bank.tap_time)))


def _on_all(task: Task, search: Search, whole: Fit) -> tuple[Search, Fit]:
    """(see `_over_all`, the set fitted to all rows)."""
    judge = _over_all(search, task.recordings, task.holdout, whole)
    if judge is search:
        return search, whole
    return judge, judge.settled(judge.fit(whole.terms, whole.tap))


def _less_explained(judge: Search, fit: Fit, parts: Sequence[Recording]) -> tuple[int, float] | None:
    """(recording, time in s) of the window that is explained less well than the excerpts, if that matters."""
    errors, equations = judge.problem.errors, judge.equations
    squares = errors.residual(fit, held_out=False) ** 2
    times = equations.by_stretch(equations.of_rows([s.frame.times for s in equations.stretches]))
    place = equations.owners
    seen = _seen(times, place, parts)
    worst, usual = (0.0, 0, 0.0), 0.0
    by_stretch = zip(
        equations.by_stretch(squares), times, place, equations.by_stretch(seen), equations.row_times, strict=True
    )
    for x, t, i, known, row_time in by_stretch:
        rows = max(int(POLICY.unexplained_seconds / row_time), 1)
        if len(x) >= rows:
            means = np.convolve(x, np.ones(rows) / rows, "valid")
            inside = np.convolve(known, np.ones(rows), "valid") >= rows
            usual = max(usual, float(means[inside].max(initial=0.0)))
            k = int(np.argmax(means))
            worst = max(worst, (float(means[k]), i, float(t[k + rows // 2])))
    noticed = worst[0] > POLICY.unexplained_factor * usual
    matters = worst[0] - usual > (POLICY.much_force * errors.force) ** 2
    return (worst[1], worst[2]) if noticed and matters else None


def _seen(times: Sequence[np.ndarray], place: Sequence[int], parts: Sequence[Recording]) -> np.ndarray:
    """1 in rows that the excerpts contain, otherwise 0."""
    found = []
    for t, i in zip(times, place, strict=True):
        inside = np.zeros(len(t), dtype=bool)
        for piece in parts[i].pieces:
            inside |= (t >= piece["t"][0]) & (t <= piece["t"][-1])
        found.append(inside.astype(np.float64))
    return np.concatenate(found)


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
