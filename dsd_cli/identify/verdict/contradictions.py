"""Warnings about values that the user knows: at a bound, or contradicted by the log (prior or held value)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

from dsd_cli.identify.fit.bank import Terms
from dsd_cli.identify.fit.delay import best_delay
from dsd_cli.identify.fit.known import Known
from dsd_cli.identify.fit.problem import Problem
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, NONE, UNKNOWN, Diagnosis, Estimate, Estimates
from dsd_cli.identify.search.sets import Search

#: The least share of a value (of a sample, for a delay) by which a contradiction is worth saying.
LEAST_SHARE = 0.005


#: How a value was told.
Kind = Literal["held", "bound", "prior"]


class Contradiction(str):
    """A sentence about a value that the log has otherwise than it was told.

    value : its name. kind : how it was told: "held", by its "bound", or by a "prior", which gives way.
    """

    value: str
    kind: Kind

    @classmethod
    def of(cls, value: str, kind: Kind, text: str) -> Contradiction:
        """That sentence, which begins with the name."""
        found = cls(f"{value} {text}")
        found.value, found.kind = value, kind
        return found

    @property
    def about(self) -> tuple[str, str]:
        """What the sentence is about; its figures follow each fit."""
        return self.value, self.kind

    @property
    def hard(self) -> bool:
        """Whether the value is kept from where the log would have it."""
        return self.kind != "prior"


def contradictions(search: Search, fit: Fit, estimates: Estimates) -> tuple[Contradiction, ...]:
    """One sentence each, about the values of a fit."""
    known = search.solver.known
    if not known:
        return ()
    found = []
    for name, estimate in estimates.items():
        low, high = known.limits(name)
        side = next((s for s, b in (("lower", low), ("upper", high)) if math.isclose(estimate.value, b)), "")
        if estimate.at_bound and side:
            text = f"stands on its {side} bound, {estimate.value:.4g}: the log asks for more"
            found.append(Contradiction.of(name, "bound", text))
        if abs(estimate.pull) > POLICY.contradicting_deviations:
            value, spread = known.priors[name]
            text = (
                f"= {estimate.value:.4g} pulls against its prior {value:.4g} +- {spread:.2g} by"
                f" {abs(estimate.pull):.1f} sigma"
            )
            found.append(Contradiction.of(name, "prior", text))
    return (*found, *_of_held(search.problem, fit, estimates))


def against_told(found: Diagnosis, search: Search, whole: Fit) -> Diagnosis:
    """An effect that stands beside a held or bounded value that the log contradicts may stand in for it: not sure.

    Whether it does contradict it is asked beside the whole set that was found: what one effect leaves another takes.
    What is unknown beside such a value may be that value.
    """
    hard = [w for w in found.warnings if isinstance(w, Contradiction) and w.hard]
    if found.verdict == UNKNOWN and hard and not found.blocked:
        return replace(found, probability=min(found.probability, POLICY.surest_against_told))
    if found.verdict in (NONE, UNKNOWN):
        return found
    beside = contradictions(search, whole, search.problem.values(whole).estimates)
    in_place = _in_place_of_found(search, whole)  # a prior so narrow that it does not give way is among these
    said = {one.about: one for one in (*in_place, *beside)}
    gone = [one for one in hard if one.about not in said]
    kept = [one for one in found.warnings if one not in gone]
    there = {one.about for one in kept if isinstance(one, Contradiction)}
    stays = (*kept, *(one for about, one in said.items() if about not in there))
    if not in_place and not any(one.hard for one in said.values()):
        return replace(found, warnings=stays)
    surest = POLICY.surest_against_told
    ranking = tuple(replace(c, probability=min(c.probability, surest)) for c in found.ranking)
    return replace(found, warnings=stays, ranking=ranking, probability=min(found.probability, surest))


def _of_held(problem: Problem, fit: Fit, estimates: Estimates) -> list[Contradiction]:
    """Held values from which the estimate of this log alone differs significantly."""
    held = [name for name, e in estimates.items() if e.held]
    if not held:
        return []
    free = _freed(problem)
    loose = _loose(Search(free), fit.terms, fit.tap)
    values, given = free.values(loose).estimates, flat(problem.scale.model(fit))
    found = []
    for name in held:
        alone = values.get(name)
        if alone is None or not alone.std_error > 0.0:
            continue
        sigma = abs(alone.value - given[name]) / alone.std_error
        size = problem.equations.sample_time if name == DELAY else abs(given[name])
        if sigma > POLICY.contradicting_deviations and abs(alone.value - given[name]) > LEAST_SHARE * size:
            text = (
                f"is held at {given[name]:.4g}; this log alone says {alone.value:.4g} +- {alone.std_error:.2g}"
                f" ({sigma:.1f} sigma off)"
            )
            found.append(Contradiction.of(name, "held", text))
    return found


def _loose(free: Search, terms: Terms, tap: int) -> Fit:
    """Effects with all values free; what was held may have moved the delay far off."""
    anywhere = best_delay(free.solver, free.problem.beside, free.most_tap)
    return min((free.fit(terms, near) for near in {tap, anywhere}), key=lambda one: one.squares)


def _in_place_of_found(search: Search, whole: Fit) -> list[Contradiction]:
    """Values that would be others if they were free, and then do what a found effect does."""
    known, here = search.solver.known, {t.id for t in whole.terms}
    names = [name for name in known.names if name not in known.seen]
    members = search.added(whole.terms)
    if not names or not members:
        return []
    told = {name.partition(".")[0] for name in names} - here
    absent = [o.fit.terms[-1] for o in search.options(search.refit) if o.effect in told]
    free, found = Search(_freed(search.problem)), dict[tuple[str, str], Contradiction]()
    least = free.evidence(free.fit(whole.terms, whole.tap)) - POLICY.least_gain
    for more in ((), *((term,) for term in absent)):
        sets = [(*(t for t in whole.terms if t != member), *more) for member in members]
        instead = max((_loose(free, terms, whole.tap) for terms in sets), key=free.evidence)
        if free.evidence(instead) > least:
            estimates = free.problem.values(instead).estimates
            told_otherwise = (_told_otherwise(known, name, estimates[name]) for name in names if name in estimates)
            found |= {one.about: one for one in told_otherwise if one is not None}
    return list(found.values())


def _told_otherwise(known: Known, name: str, alone: Estimate) -> Contradiction | None:
    """What a log says by itself of a value of a candidate, where that is not what was told."""
    if not alone.std_error > 0.0:
        return None
    low, high = known.limits(name)
    value, spread = known.priors.get(name, (known.fixed.get(name, min(max(alone.value, low), high)), 0.0))
    off = abs(alone.value - value)
    if not off > max(POLICY.contradicting_deviations * math.hypot(alone.std_error, spread), LEAST_SHARE * abs(value)):
        return None
    kind: Kind = "prior" if spread else "held" if name in known.fixed else "bound"
    what = {"prior": f"has the prior {value:.4g} +- {spread:.2g}", "held": f"is held at {value:.4g}"}
    text = what.get(kind, f"is kept within {low:g} to {high:g}")
    return Contradiction.of(name, kind, f"{text}; this log alone says {alone.value:.4g} +- {alone.std_error:.2g}")


def _freed(problem: Problem) -> Problem:
    """The same problem without any prior, bound or held value."""
    solver = problem.solver
    return replace(problem, solver=Solver(solver.bank, solver.blocks, solver.inertia))
