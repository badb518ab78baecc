"""Which set of effects explains recordings of any length: sought in excerpts, judged on all rows."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dsd_cli.effects import kind_of
from dsd_cli.identify.fit.bank import Term, has_friction
from dsd_cli.identify.fit.driven_load import both_driven
from dsd_cli.identify.fit.problem import Problem, asked_of_all, pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.fit.values import terms_of
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import excerpts, with_part
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import Estimates
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
    the recordings have it. Raises as `pose`."""
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
        whole = search.run(search.with_play(whole))
    else:
        whole = search.fit(begun.terms, begun.tap)
    search = Search(search.problem.measured_again(whole))
    report("sets of effects, the noise measured anew", 0.5)
    whole = search.run(search.settled(search.fit(whole.terms, whole.tap)))
    kept = _kept(search, task.settings)
    if kept is not None and kept.terms != whole.terms:
        whole = max(whole, search.run(kept), key=search.evidence)
    return search, identified_only(search, whole)


def _kept(search: Search, settings: Settings) -> Fit | None:
    """What the last rung found, as far as it is asked for; single events are found beside the laws."""
    if settings.begun is None:
        return None
    asked, own = {kind_of(name) for name in search.allowed}, {t.id for t in search.base}
    there = [t for t in terms_of(settings.begun) if t.id in own or (kind_of(t.id) in asked and not t.effect.listed)]
    if not own <= {t.id for t in there}:
        return None
    return search.settled(search.fit(tuple(there), round(settings.begun.delay / search.solver.bank.tap_time)))


def identified_only(search: Search, whole: Fit) -> Fit:
    """The set without effects that were found among lines of which no force is identified: what is left at stops and
    turns repeats with the motion, and is a sum of lines to any accuracy, but the rows that identify values do not have
    it; nor do fast moves one that is a few counts of an encoder long."""
    while (told := _told(search, whole)) is not whole:
        whole = search.settled(told)
    return whole


def _told(search: Search, whole: Fit) -> Fit:
    """Without those, one after the other, shapes as they are; the same fit if there are none."""
    while lines := [t for t in search.added(whole.terms) if t.effect.periods is not None]:
        estimates = search.problem.values(whole, as_found=True).estimates
        sizes = {t: _deviations(t, estimates) for t in lines}
        least = min(sizes, key=lambda t: sizes[t])
        if sizes[least] > POLICY.value_deviations:
            break
        whole = search.without(whole, least)
    return whole


def _deviations(line: Term, estimates: Estimates) -> float:
    """Standard errors by which the largest force of a line is away from 0; angles are none."""
    forces = [p.name for p in line.effect.parameters if p.linear and p.unit != "rad"]
    found = [estimates[f"{line.id}.{name}"] for name in forces]
    told = (math.inf if e.held else abs(e.value) / e.std_error for e in found if e.held or e.std_error > 0.0)
    return max(told, default=0.0)


def _on_all(task: Task, search: Search, whole: Fit) -> tuple[Search, Fit]:
    """(see `_over_all`, the set fitted to all rows)."""
    judge = _over_all(search, task.recordings, task.holdout, whole)
    return judge, whole if judge is search else judge.settled(judge.fit(whole.terms, whole.tap))


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
