"""What the user told, held against the log before any long search: a value that is told wrongly makes that search add
one effect after the other in its place, each of them found, none of them there.

So the search is first made with nothing told. Where that explains the log, and the log is then against what was told,
only the effects of that search are asked with it: what they leave is the told value's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dsd_cli.effects import kind_of
from dsd_cli.identify.fit.asked import Settings
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.known import Known
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.recordings.excerpts import excerpts
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.beyond import above_floor
from dsd_cli.identify.verdict.contradictions import Contradiction, freed, told_far_off
from dsd_cli.identify.verdict.limits import limits_of
from dsd_cli.plant.model import PlantModel


def first_look(
    recordings: Sequence[Recording], model: PlantModel, settings: Settings
) -> tuple[Settings, tuple[Contradiction, ...]]:
    """(settings with the effects that are worth a search, what the log says against what was told).

    Raises
    ------
    DataError, UsageError : as `pose`.
    """
    looked = replace(settings, against=settings.against or ())
    if not settings.known or settings.against is not None:
        return looked, ()
    parts = excerpts(recordings)
    free = Search(pose(parts, model, replace(settings, known=Known())))
    whole = free.run(free.refit)
    estimates = free.problem.values(whole).estimates
    against = told_far_off(settings.known, estimates, recordings[0].sample_time)
    if not against or above_floor(free, whole) or _to_mend(free, whole, settings):
        return looked, ()
    told = Search(pose(parts, model, settings))
    asked = {kind_of(t.id) for t in free.added(whole.terms)} | _as_good(told, whole)
    worth = tuple(name for name in told.problem.candidates if name in asked)
    return replace(looked, effects=worth, against=against), against


def _to_mend(free: Search, whole: Fit, settings: Settings) -> bool:
    """Whether the log itself is to be mended first: a u that is late or smoothed bends values."""
    limits = limits_of(free, whole, replace(settings, known=Known()), None)
    return bool(limits.blocked or limits.time.late or limits.time.smoothed)


def _as_good(told: Search, whole: Fit) -> set[str]:
    """The effect that alone, beside the set that was found with nothing told, does what the freed values do."""
    known = told.solver.known
    pinned = tuple(Term.of(t.id, known.pinned(t.id, t.shape)) for t in whole.terms)
    free = Search(freed(told.problem))
    best = next(iter(told.options(told.fit(pinned, whole.tap))), None)
    if best is None or told.evidence(best.fit) < free.evidence(free.fit(whole.terms, whole.tap)):
        return set()
    return {kind_of(best.effect)}
