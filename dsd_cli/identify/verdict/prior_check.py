"""What the user gave, held against the log before any long search: a value that is given wrongly makes that search add
one effect after the other in its place, each of them found, none of them there.

So the search is first made with nothing given. Where that explains the log, and the log is then against what was given,
only the effects of that search are asked with it: what they leave is the given value's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from dsd_cli.effects import kind_of
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.recordings.excerpts import excerpts
from dsd_cli.identify.recordings.levels import may_differ, with_levels
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.levels import Levelled, levelled
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.contradictions import Contradiction, freed, told_far_off
from dsd_cli.identify.verdict.discrepancy import above_floor
from dsd_cli.identify.verdict.levels import log_levels
from dsd_cli.identify.verdict.limits import limits_of
from dsd_cli.plant.model import PlantModel

Report = Callable[[str, float], None]


def prior_check(
    recordings: Sequence[Recording],
    model: PlantModel,
    settings: Settings,
    report: Report = lambda _what, _share: None,
) -> tuple[Settings, tuple[Contradiction, ...]]:
    """(settings with the effects that are worth a search, what the log says against what was given).

    Raises
    ------
    DataError, UsageError : as `pose`.
    """
    looked = replace(settings, against=settings.against or ())
    known = settings.known
    if not known or settings.against is not None:
        return looked, ()
    apart = _free(tuple(excerpts(recordings)), model, replace(settings, known=PriorKnowledge()), report)
    free, whole = apart.search, apart.whole
    estimates = free.problem.values(whole).estimates
    by_log = log_levels(apart.levels, estimates, [r.name for r in recordings])
    against = told_far_off(known, estimates, recordings[0].sample_time, by_log)
    if not against or above_floor(free, whole) or _to_mend(free, whole, settings):
        return looked, ()
    levels = tuple(one for one in apart.levels if one.name not in known.fixed)
    told = Search(pose(with_levels(apart.plain, levels), model, settings))
    asked = {kind_of(t.id) for t in free.added(whole.terms)} | _as_good(told, whole)
    worth = tuple(name for name in told.problem.candidates if name in asked)
    return replace(looked, effects=worth, against=against, levels=levels), against


def _free(parts: tuple[Recording, ...], model: PlantModel, settings: Settings, report: Report) -> Levelled:
    """What the logs say with nothing given; a level that differs between them would look like a value given wrongly."""
    if may_differ(parts):
        return levelled(parts, model, settings, (), report)
    search = Search(pose(parts, model, settings))
    return Levelled(parts, parts, search, search.run(search.refit))


def _to_mend(free: Search, whole: Fit, settings: Settings) -> bool:
    """Whether the log itself is to be mended first: a u that is late or smoothed bends values."""
    limits = limits_of(free, whole, replace(settings, known=PriorKnowledge()), None)
    return bool(limits.blocked or limits.time.late or limits.time.smoothed)


def _as_good(told: Search, whole: Fit) -> set[str]:
    """The effect that alone, beside the set that was found with nothing given, does what the freed values do."""
    known = told.solver.known
    pinned = tuple(Term.of(t.id, known.pinned(t.id, t.shape)) for t in whole.terms)
    free = Search(freed(told.problem))
    best = next(iter(told.options(told.fit(pinned, whole.tap))), None)
    if best is None or told.evidence(best.fit) < free.evidence(free.fit(whole.terms, whole.tap)):
        return set()
    return {kind_of(best.effect)}
