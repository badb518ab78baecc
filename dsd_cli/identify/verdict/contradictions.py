"""Warnings about values that the user knows: at a bound, or contradicted by the log (prior or held value)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

from dsd_cli.identify.fit.problem import Problem
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, NONE, UNKNOWN, Diagnosis, Estimates
from dsd_cli.identify.search.sets import Search

#: The least share of a value (of a sample, for a delay) by which a contradiction is worth saying.
LEAST_SHARE = 0.005


class Contradiction(str):
    """A sentence about a value that the log has otherwise than it was told.

    value : its name. kind : how it was told: "held", by its "bound", or by a "prior", which gives way.
    """

    value: str
    kind: Literal["held", "bound", "prior"]

    @classmethod
    def of(cls, value: str, kind: Literal["held", "bound", "prior"], text: str) -> Contradiction:
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
    """
    hard = [w for w in found.warnings if isinstance(w, Contradiction) and w.hard]
    if found.verdict in (NONE, UNKNOWN) or not hard:
        return found
    said = contradictions(search, whole, search.problem.values(whole).estimates)
    about = {one.about for one in said}
    gone = [one for one in hard if one.about not in about]
    stays = tuple(one for one in found.warnings if one not in gone)
    if not any(one.hard for one in said):
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
    search = Search(free)
    loose = search.fit(fit.terms, fit.tap)
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


def _freed(problem: Problem) -> Problem:
    """The same problem without any prior, bound or held value."""
    solver = problem.solver
    return replace(problem, solver=Solver(solver.bank, solver.blocks, solver.inertia))
