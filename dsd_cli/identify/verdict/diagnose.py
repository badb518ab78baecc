"""Which physical effect is missing: what the user gave is held against the log, then the set searched and judged.

A value that is given wrongly makes a search add one effect after the other in its place, each of them found, none of
them there. So the search is first made with nothing given. Where that explains the log, and the log is then against
what was given, only the effects of that search are asked with it: what they leave is the given value's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from dsd_cli.effects import free_name, kind_of
from dsd_cli.errors import DataError
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.direction import tells_by_motion
from dsd_cli.identify.fit.laws_of_u import laws_of_u
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import excerpts, may_differ, with_levels
from dsd_cli.identify.recordings.recording import Mended, Recording
from dsd_cli.identify.results import DELAY, NONE, Diagnosis, Estimates
from dsd_cli.identify.search.levels import Levelled, levelled
from dsd_cli.identify.search.sets import Option, Search
from dsd_cli.identify.search.shapes import renamed
from dsd_cli.identify.search.task import Progress, Task
from dsd_cli.identify.verdict.command_time import on_time, was_late
from dsd_cli.identify.verdict.contradictions import Contradiction, against_told, freed, told_far_off
from dsd_cli.identify.verdict.discrepancy import above_floor, borne_out, discrepancy_of, noise_of_u, without_imitations
from dsd_cli.identify.verdict.end_stop import EndStops, end_stops
from dsd_cli.identify.verdict.judgement import Verdict
from dsd_cli.identify.verdict.levels import log_levels, with_levels_said
from dsd_cli.identify.verdict.limits import limits_of
from dsd_cli.identify.verdict.own_values import own_values
from dsd_cli.identify.verdict.probability import memberships
from dsd_cli.identify.verdict.pushes import pushed
from dsd_cli.identify.verdict.resonance import with_response
from dsd_cli.plant.model import ObserverSettings, PlantModel

Told = Callable[[Sequence[Contradiction]], None]
Found = Callable[[Search, Fit], None]


def diagnose(
    recordings: Sequence[Recording],
    model: PlantModel,
    observer: ObserverSettings,
    settings: Settings | None = None,
    holdout: Sequence[Recording] = (),
    progress: Progress | None = None,
    on_told: Told = lambda _: None,
    on_found: Found = lambda _search, _whole: None,
) -> Diagnosis:
    """The effect that is missing most, "inertia" or "delay" if a value is wrong, "none" or "unknown".

    recordings : of one rig, fitted together. holdout : recordings that no fit sees; held-out errors are then of those.
    model : believed; its values are fitted along, its effects stay. progress : called with what is being done and the
        share that is done; on_told : if the log is against what was given; on_found : with search and whole set.

    Raises DataError, UsageError : too short, no motion, or a needed channel is missing; recordings of different rates.
    """
    report = progress or (lambda _what, _share: None)
    given = partial(diagnose, model=model, observer=observer, settings=settings, progress=progress)
    again = partial(given, on_told=on_told, on_found=on_found)
    asked, against = prior_check(recordings, model, settings or Settings(), report)
    if against:
        on_told(against)
    apart = _either_way(Task(tuple(recordings), model, asked, tuple(holdout), report))
    task, search, whole = apart.task, apart.search, apart.whole
    beyond = discrepancy_of(search, whole)
    shown = with_response(search, whole, task, beyond.unknown or above_floor(search, whole))
    if shown.search is not search:
        search, whole, beyond = shown.search, shown.whole, discrepancy_of(shown.search, shown.whole)
    if shown.seen is None:
        whole, beyond = borne_out(search, *without_imitations(search, *pushed(search, whole, beyond)))
    report("how sure", 0.8)
    whole, first = strongest_first(search, whole)
    limits = limits_of(search, whole, shown.settings, shown.seen or shown.other)
    act = partial(on_time, limits.time, model) if limits.idle is None else limits.idle.taken_off
    if (mended := act(apart.plain, holdout)) is not None:
        return _of_mended(mended, again)
    stops, answer = _without_stops(end_stops(search, whole, beyond, apart.plain, holdout), again, on_found)
    if answer is not None:
        return answer
    members = {} if limits.blocked or shown.seen is not None else memberships(search, whole, beyond)
    options = [*search.options(search.refit), *first]
    own = own_values(search, shown, missing=bool(members))
    verdict = Verdict(search, options, whole, members, own, beyond, shown, limits)
    if verdict.rising:  # what raises the error stands in for something else: the search begins again without it
        return again(apart.plain, settings=task.settings.without([verdict.rising]), holdout=holdout)
    on_found(search, whole)
    diagnosis = with_levels_said(against_told(verdict.diagnosis(), search, whole, task.settings), search, whole, apart)
    diagnosis = stops.beside(diagnosis) if stops is not None else diagnosis
    report("done", 1.0)
    return replace(diagnosis, inverse=search.solver.inverse)


def _without_stops(
    stops: EndStops | None, again: Callable[..., Diagnosis], on_found: Found
) -> tuple[EndStops | None, Diagnosis | None]:
    """(end stops, if all depends on them that depended on the position; the answer without them, if it names anything:
    where nothing else is missing, they are)."""
    if stops is None:
        return None, None
    ends: list[tuple[Search, Fit]] = []
    try:
        answer = _of_mended(stops.mended, partial(again, on_found=lambda *end: ends.append(end)))
    except DataError:  # too little is left
        return None, None
    if not stops.confirmed(*ends[-1]):
        return None, None
    if answer.verdict == NONE:
        return stops, None
    on_found(*ends[-1])
    return stops, answer


def _of_mended(mended: Mended, again: Callable[..., Diagnosis]) -> Diagnosis:
    """The answer of mended recordings, with what was wrong with them said, and what else was wrong."""
    diagnosis = again(mended.recordings, holdout=mended.holdout)
    diagnosis = _without_delay(diagnosis) if was_late(mended) else diagnosis
    last = diagnosis.mended or mended
    said = dict.fromkeys((*mended.said, *last.said))
    return replace(diagnosis, warnings=(*mended.said, *diagnosis.warnings), mended=replace(last, said=tuple(said)))


def _without_delay(found: Diagnosis) -> Diagnosis:
    """An answer without a standard error of the delay."""

    def gone(values: Estimates) -> Estimates:
        known = {DELAY: replace(values[DELAY], std_error=math.nan, grade="not")} if DELAY in values else {}
        return {**values, **known}

    return replace(
        found,
        estimates=gone(found.estimates),
        refitted_values=gone(found.refitted_values),
        whole_values=gone(found.whole_values),
    )


def _either_way(task: Task) -> Levelled:
    """The motion by u, or u by the motion; where the one taken leaves more than the sensor does, the other if it leaves
    clearly less. Each is less by its own measure: of what hardly matters to the other little is left in any case.

    An axis that sticks and slips accelerates hard for moments, so that J a is a fair part of u, and yet what u does
    not explain is most of that: friction and cogging, which the motion explains all of. So is noise that u alone has.
    A dead zone is no function of the motion, but the motion shows it, however small a part of u J a is. A set without
    any force has explained nothing of either: what it leaves of u and J a together is small where J a is. A law of u
    explains u by itself: the other way is held against what is left without it.
    """
    found = levelled(task)
    search, whole, inverse = found.search, found.whole, found.search.solver.inverse
    if inverse and (laws := laws_of_u(search.added(whole.terms))):
        whole = search.without(whole, *laws)
    bank, drifts = search.problem.errors.bank, search.problem.reconstructed("velocity")
    tells = inverse or tells_by_motion(bank, whole.tap, search.solver.inertia)
    more = above_floor(search, whole) or (not inverse and noise_of_u(search, whole))
    if task.settings.inverse is not None or drifts or not (tells and more):
        return found
    there = levelled(replace(task, settings=replace(task.settings, inverse=not inverse)))
    less = _unexplained(there.search, there.whole) < POLICY.other_way * _unexplained(search, whole, bool(whole.terms))
    return there if less or (not inverse and noise_of_u(there.search, there.whole)) else found


def _unexplained(search: Search, whole: Fit, beside_u: bool = False) -> float:
    """Share that is left of u, or of J a; `beside_u`: of both together, for forces of that size move the axis."""
    errors, solver = search.problem.errors, search.solver
    moved = errors.moving(solver.inertia) if beside_u else solver.inertia * errors.accelerates
    return errors.rmse(whole) / max(errors.force if solver.inverse else moved, 1e-300)


def strongest_first(search: Search, whole: Fit) -> tuple[Fit, list[Option]]:
    """(the set with those of a kind numbered by the error that is left without each, the largest first; of each kind of
    several the first alone).

    Names of which the user knows something stay.
    """
    added = search.added(whole.terms)
    kinds = dict.fromkeys(kind_of(t.id) for t in added if t.effect.repeats is not None)
    terms, first = whole.terms, []
    for kind in kinds:
        alike = [t for t in added if kind_of(t.id) == kind]
        if any(search.solver.known.concerns(t.id) for t in alike):
            continue
        if len(alike) > 1:
            alike.sort(key=lambda t: -search.problem.errors.rmse(search.without(whole, t)))
            first.append(_alone(search, Term(kind, alike[0].items), whole.tap))
        terms = renamed(terms, tuple(alike))
    return (whole if terms == whole.terms else search.fit(terms, whole.tap)), first


def _alone(search: Search, line: Term, tap: int) -> Option:
    """It beside the effects of the model, under the first name that is free there."""
    term = Term(free_name(line.id, {t.id for t in search.base}), line.items)
    fit = search.fit((*search.base, term), tap)
    return Option(term.id, fit, search.evidence(fit))


def prior_check(
    recordings: Sequence[Recording],
    model: PlantModel,
    settings: Settings,
    report: Progress = lambda _what, _share: None,
) -> tuple[Settings, tuple[Contradiction, ...]]:
    """(settings with the effects that are worth a search, what the log says against what was given).

    Raises DataError, UsageError as `pose`.
    """
    report("preparing", 0.0)
    looked = replace(settings, against=settings.against or ())
    known = settings.known
    if not known or settings.against is not None:
        return looked, ()
    apart = _free(Task(excerpts(recordings), model, replace(settings, known=PriorKnowledge()), (), report))
    free, whole = apart.search, apart.whole
    estimates = free.problem.values(whole).estimates
    by_log = log_levels(apart.levels, estimates, [r.name for r in recordings])
    against = told_far_off(known, estimates, recordings[0].sample_time, by_log)
    if not against or above_floor(free, whole):
        return looked, ()
    limits = limits_of(free, whole, replace(settings, known=PriorKnowledge()), None)
    if limits.blocked or limits.idle is not None or limits.time.said:  # what is to be mended first bends values
        return looked, ()
    levels = tuple(one for one in apart.levels if one.name not in known.fixed)
    told = Search(pose(with_levels(apart.plain, levels), model, settings))
    asked = {kind_of(t.id) for t in free.added(whole.terms)} | _as_good(told, whole)
    worth = tuple(name for name in told.problem.candidates if name in asked)
    return replace(looked, effects=worth, against=against, levels=levels), against


def _free(task: Task) -> Levelled:
    """What the logs say with nothing given; a level that differs between them would look like a value given wrongly."""
    if may_differ(task.recordings):
        return levelled(task)
    search = Search(pose(task.recordings, task.model, task.settings))
    return Levelled(task.recordings, task, search, search.run(search.refit))


def _as_good(told: Search, whole: Fit) -> set[str]:
    """The effect that alone, beside the set that was found with nothing given, does what the freed values do."""
    known = told.solver.known
    pinned = tuple(Term.of(t.id, known.pinned(t.id, t.shape)) for t in whole.terms)
    free = Search(freed(told.problem))
    best = next(iter(told.options(told.fit(pinned, whole.tap))), None)
    if best is None or told.evidence(best.fit) < free.evidence(free.fit(whole.terms, whole.tap)):
        return set()
    return {kind_of(best.effect)}
