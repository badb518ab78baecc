"""Warnings about values that the user knows: at a bound, or contradicted by the log (prior or held value)."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from typing import Any, Literal

from dsd_cli.identify.fit.bank import Terms
from dsd_cli.identify.fit.direction import best_delay
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.problem import Problem
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, INERTIA, NONE, UNKNOWN, Diagnosis, Estimate, Estimates, LogLevels
from dsd_cli.identify.search.sets import Search

#: The channel with which an inertia that is held wrongly errs.
ACCELERATION = "acceleration"
#: The least share of a value (of a sample, for a delay) by which a contradiction is worth saying.
LEAST_SHARE = 0.005
#: Before a search a value must be so far off, as a share (a delay: in samples) and in standard deviations.
FAR_SHARE, FAR_SAMPLES, FAR_DEVIATIONS = 0.02, 0.5, 5.0


#: How a value was told.
Kind = Literal["held", "bound", "prior"]


class Contradiction(str):
    """A sentence about a value that the log has otherwise than it was given.

    value : its name. kind : how it was given: "held", by its "bound", or by a "prior". hard : whether the value is kept
    from where the log would have it; most priors give way.
    """

    value: str
    kind: Kind
    hard: bool

    @classmethod
    def of(cls, value: str, kind: Kind, text: str, hard: bool = True) -> Contradiction:
        """That sentence, which begins with the name."""
        found = cls(f"{value} {text}")
        found.value, found.kind, found.hard = value, kind, hard
        return found

    @property
    def about(self) -> tuple[str, str]:
        """What the sentence is about; its figures follow each fit."""
        return self.value, self.kind


def contradictions(search: Search, fit: Fit, estimates: Estimates) -> tuple[Contradiction, ...]:
    """One sentence each, about the values of a fit."""
    known = search.solver.known
    if not known:
        return ()
    found: list[Contradiction | None] = []
    told = [name for name, e in estimates.items() if e.held or e.at_bound or name in known.priors]
    alone = _alone(search.problem, fit) if told else {}
    for name, estimate in estimates.items():
        low, high = known.limits(name)
        side = next((s for s, b in (("lower", low), ("upper", high)) if math.isclose(estimate.value, b)), "")
        if estimate.at_bound and side:
            sure = name in alone and _beyond(estimate.value, alone[name])
            wanted = "less" if side == "lower" else "more"
            text = f"stands on its {side} bound, {estimate.value:.4g}: the log asks for {wanted}"
            text += f", alone it says {_said(alone[name])}" if sure else ""
            found.append(Contradiction.of(name, "bound", text, hard=sure))
        if name in alone and (estimate.held or name in known.priors):
            found.append(_beside(search.problem, known, name, estimate, alone[name]))
    return tuple(one for one in found if one is not None)


def _beside(
    problem: Problem, known: PriorKnowledge, name: str, fitted: Estimate, alone: Estimate
) -> Contradiction | None:
    """What is to be said of a value that is held or has a prior, beside what the log alone says of it."""
    if not fitted.held:
        kept = _off(problem, name, fitted.value, alone, known.priors[name][0])
        if not abs(fitted.pull) > POLICY.contradicting_deviations:
            return _told_otherwise(known, name, alone) if kept else None
        value, spread = known.priors[name]
        text = (
            f"= {fitted.value:.4g} pulls against its prior {value:.4g} +- {spread:.2g} by {abs(fitted.pull):.1f} sigma"
        )
        text += f", and is kept from what this log alone says, {_said(alone)}" if kept else ""
        return Contradiction.of(name, "prior", text, hard=kept)
    if not _off(problem, name, fitted.value, alone):
        return None
    sigma = abs(alone.value - fitted.value) / alone.std_error
    text = f"is held at {fitted.value:.4g}; this log alone says {_said(alone)} ({sigma:.1f} sigma off)"
    return Contradiction.of(name, "held", text)


def _beyond(bound: float, alone: Estimate) -> bool:
    """Whether a log alone has a value beyond its bound by more than scatter: standing there, the fit says the same."""
    return abs(alone.value - bound) > max(alone.std_error, LEAST_SHARE * abs(bound))


def _off(problem: Problem, name: str, value: float, alone: Estimate, prior: float = 0.0) -> bool:
    """Whether a value is off what the log alone says of it, by more than its error and by a size that matters beside it
    and its prior."""
    if not alone.std_error > 0.0:
        return False
    size = problem.equations.sample_time if name == DELAY else max(abs(value), abs(prior))
    least = max(POLICY.contradicting_deviations * alone.std_error, LEAST_SHARE * size)
    return abs(alone.value - value) > least


def _said(alone: Estimate) -> str:
    return f"{alone.value:.4g} +- {alone.std_error:.2g}"


def _alone(problem: Problem, fit: Fit) -> Estimates:
    """The values of the same effects where nothing is given of any."""
    free = freed(problem)
    return free.values(_loose(Search(free), fit.terms, fit.tap)).estimates


def against_told(found: Diagnosis, search: Search, whole: Fit, asked: Settings) -> Diagnosis:
    """An effect that stands beside a value that the log contradicts may stand in for it: not sure.

    Whether it does contradict it is asked beside the whole set that was found: what one effect leaves another takes.
    What is unknown beside such a value may be that value, and nothing is missing only as long as it is believed.

    asked : with the effects of the model that were taken in this climb, which may stand in as well, and with what the
    first look found against what was given.
    """
    if not search.solver.known or found.blocked:
        return found
    beside = contradictions(search, whole, search.problem.values(whole).estimates)
    in_place = in_place_of(search, whole, asked.taken)
    first = [one for one in asked.against or () if isinstance(one, Contradiction)]
    said = {one.about: one for one in (*(one for some in in_place.values() for one in some), *beside, *first)}
    told = [w for w in found.warnings if isinstance(w, Contradiction)]
    if found.verdict != UNKNOWN:  # beside the whole set, what is kept from the log by an effect alone may be as told
        told = [one for one in told if not one.hard or one.about in said]
    better = [one for one in first if one.kind != "bound"]  # beside all that the log lacks
    said = said | {one.about: one for one in (*told, *better)}
    others = [w for w in found.warnings if not isinstance(w, Contradiction)]
    stand_ins = {name: tuple(dict.fromkeys(one.value for one in some)) for name, some in in_place.items()}
    found = replace(found, warnings=(*others, *said.values()), stand_ins=stand_ins)
    found = no_surer(found, POLICY.even) if in_place else beside_told(found, found.warnings)
    kept = kept_values(said.values())
    if found.verdict != UNKNOWN or not kept:
        return found
    depends_on = (ACCELERATION,) if kept == (INERTIA,) else found.depends_on  # u and speed make up what J is off by
    names = " and ".join(kept)
    again = f"ask again without the given values of {names}: what the log gives then, and whether anything is missing"
    return replace(found, advice=(again,), depends_on=depends_on)


def kept_values(said: Iterable[str]) -> tuple[str, ...]:
    """Values that are kept from where the log would have them, of what is said."""
    return tuple(dict.fromkeys(one.value for one in said if isinstance(one, Contradiction) and one.hard))


def beside_told(found: Diagnosis, said: Sequence[str]) -> Diagnosis:
    """No verdict is sure beside a value that is kept from where the log would have it."""
    return no_surer(found, POLICY.even) if kept_values(said) else found


def no_surer(found: Diagnosis, most: float, effects: Collection[str] | None = None) -> Diagnosis:
    """No probability of these effects above that, of all of them if None: not as the verdict, nor in the set that was
    found, nor in the ranking."""

    def less(one: Any) -> Any:
        named = effects is None or one.effect in effects
        return replace(one, probability=min(one.probability, most)) if named else one

    ranking, missing = (tuple(map(less, one)) for one in (found.ranking, found.missing))
    said = effects is None or found.verdict in effects
    sure, more = min(found.probability, most) if said else found.probability, found.unexplained
    if found.verdict == NONE:
        more = replace(more, probability=max(more.probability, 1.0 - sure))
    return replace(found, probability=sure, ranking=ranking, missing=missing, unexplained=more)


def in_place_of(search: Search, whole: Fit, taken: Sequence[str] = ()) -> dict[str, tuple[Contradiction, ...]]:
    """Effect of a set -> values that would be others if they were free, and then do what it does."""
    known, here = search.solver.known, {t.id for t in whole.terms}
    names = [name for name in known.names if name not in known.seen]
    members = [t for t in whole.terms if t in search.added(whole.terms) or t.id in taken]
    if not names or not members:
        return {}
    told = {name.partition(".")[0] for name in names} - here
    absent = [o.fit.terms[-1] for o in search.options(search.refit) if o.effect in told]
    free, found = Search(freed(search.problem)), dict[str, tuple[Contradiction, ...]]()
    # what explains no more than the set beside what was told is another reading of the log, not a contradiction
    least = max(
        free.evidence(free.fit(whole.terms, whole.tap)) - POLICY.least_gain, search.evidence(whole) + POLICY.least_gain
    )
    for member in members:
        rest = tuple(t for t in whole.terms if t != member)
        sets = [rest, *((*rest, term) for term in absent if term.id != member.id)]
        instead = max((_loose(free, terms, whole.tap) for terms in sets), key=free.evidence)
        if free.evidence(instead) > least:
            estimates = free.problem.values(instead).estimates
            otherwise = (_told_otherwise(known, name, estimates[name]) for name in names if name in estimates)
            if kept := tuple(one for one in otherwise if one is not None):
                found[member.id] = kept
    return found


def _loose(free: Search, terms: Terms, tap: int) -> Fit:
    """Effects with all values free; what was held may have moved the delay far off."""
    anywhere = best_delay(free.solver, free.problem.beside, free.problem.most_tap, believed=free.problem.model.delay)
    return min((free.fit(terms, near) for near in {tap, anywhere}), key=lambda one: one.squares)


def told_far_off(
    known: PriorKnowledge, estimates: Estimates, sample_time: float, levels: Sequence[LogLevels] = ()
) -> tuple[Contradiction, ...]:
    """What estimates of logs alone say of values of which something is given, where a fit is kept far from that.

    levels : of single logs; a value that is held is held in each of them.
    """
    by_log = {one.deviations.name: one for one in levels if one.deviations.name in known.fixed}
    found = []
    for name in (name for name in known.names if name in estimates and name not in known.seen):
        each = by_log[name].values if name in by_log else (estimates[name],)
        told = known.fixed.get(name, 0.0)
        off = max(each, key=lambda one: abs(one.value - told) / max(one.std_error, 1e-300))
        least = FAR_SAMPLES * sample_time if name == DELAY else FAR_SHARE * abs(off.value)
        logs = by_log[name].logs if name in by_log else ()
        said = ", ".join(f"{_said(value)} ({log})" for value, log in zip(each, logs, strict=False))
        found.append(_told_otherwise(known, name, off, FAR_DEVIATIONS, least, said))
    return tuple(one for one in found if one is not None and one.hard)


def _told_otherwise(
    known: PriorKnowledge,
    name: str,
    alone: Estimate,
    deviations: float = POLICY.contradicting_deviations,
    least: float = 0.0,
    said: str = "",
) -> Contradiction | None:
    """What a log says by itself of a value, where that is not what was given, by so many deviations and `least`.

    said : what several logs say by themselves, `alone` being that of the one that is off most.
    """
    if not alone.std_error > 0.0:
        return None
    low, high = known.limits(name)
    value, spread = known.priors.get(name, (known.fixed.get(name, min(max(alone.value, low), high)), 0.0))
    off = abs(alone.value - value)
    if not off > max(deviations * math.hypot(alone.std_error, spread), LEAST_SHARE * abs(value), least):
        return None
    kind: Kind = "prior" if spread else "held" if name in known.fixed else "bound"
    what = {"prior": f"has the prior {value:.4g} +- {spread:.2g}", "held": f"is held at {value:.4g}"}
    text = what.get(kind, f"is kept within {low:g} to {high:g}")
    kept = off * alone.std_error**2 / (alone.std_error**2 + spread**2)  # what a prior of that spread takes of it
    size = max(abs(alone.value), abs(value))
    hard = kept > max(POLICY.contradicting_deviations * alone.std_error, LEAST_SHARE * size)
    sigma = off / math.hypot(alone.std_error, spread)
    whose = f"the logs alone say {said}" if said else f"this log alone says {_said(alone)}"
    return Contradiction.of(name, kind, f"{text}; {whose} ({sigma:.1f} sigma off)", hard)


def freed(problem: Problem) -> Problem:
    """The same problem without any prior, bound or held value."""
    return replace(problem, solver=problem.solver.knowing(PriorKnowledge()))
