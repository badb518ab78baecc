"""Warnings about values that the user knows: at a bound, or contradicted by the log (prior or held value)."""

from __future__ import annotations

import math
import re
from dataclasses import replace

from dsd_cli.identify.fit.problem import Problem
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, NONE, UNKNOWN, Diagnosis, Estimates
from dsd_cli.identify.search.sets import Search

#: The least share of a value (of a sample, for a delay) by which a contradiction is worth saying.
LEAST_SHARE = 0.005
#: What each sentence begins with: the value, and how it stands to what was told of it.
SENTENCE = re.compile(r"(\S+) (?:= \S+ )?(is held at|pulls against|stands on) ")


def contradictions(search: Search, fit: Fit, estimates: Estimates) -> tuple[str, ...]:
    """One sentence each, about the values of a fit."""
    known = search.solver.known
    if not known:
        return ()
    found = []
    for name, estimate in estimates.items():
        low, high = known.limits(name)
        side = next((s for s, b in (("lower", low), ("upper", high)) if math.isclose(estimate.value, b)), "")
        if estimate.at_bound and side:
            found.append(f"{name} stands on its {side} bound, {estimate.value:.4g}: the log asks for more")
        if abs(estimate.pull) > POLICY.contradicting_deviations:
            value, spread = known.priors[name]
            found.append(
                f"{name} = {estimate.value:.4g} pulls against its prior {value:.4g} +- {spread:.2g} by"
                f" {abs(estimate.pull):.1f} sigma"
            )
    return (*found, *_of_held(search.problem, fit, estimates))


def against_told(found: Diagnosis, search: Search, whole: Fit) -> Diagnosis:
    """An effect that stands beside a held or bounded value that the log contradicts may stand in for it: not sure.

    Whether it does contradict it is asked beside the whole set that was found: what one effect leaves another takes.
    """
    if found.verdict in (NONE, UNKNOWN) or not any(map(_is_hard, found.warnings)):
        return found
    said = contradictions(search, whole, search.problem.values(whole).estimates)
    about = {_about(one) for one in said}
    stays = tuple(one for one in found.warnings if not _is_hard(one) or _about(one) in about)
    if not any(map(_is_hard, said)):
        return replace(found, warnings=stays)
    surest = POLICY.surest_against_told
    ranking = tuple(replace(c, probability=min(c.probability, surest)) for c in found.ranking)
    return replace(found, warnings=stays, ranking=ranking, probability=min(found.probability, surest))


def _about(sentence: str) -> tuple[str, ...]:
    """(value, how it stands to what was told); () of any other sentence."""
    same = SENTENCE.match(sentence)
    return same.groups() if same else ()


def _is_hard(sentence: str) -> bool:
    """Whether it says that a value is kept from where the log would have it; a prior gives way."""
    return _about(sentence)[1:] in (("is held at",), ("stands on",))


def _of_held(problem: Problem, fit: Fit, estimates: Estimates) -> list[str]:
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
            found.append(
                f"{name} is held at {given[name]:.4g}; this log alone says {alone.value:.4g} +- {alone.std_error:.2g}"
                f" ({sigma:.1f} sigma off)"
            )
    return found


def _freed(problem: Problem) -> Problem:
    """The same problem without any prior, bound or held value."""
    solver = problem.solver
    return replace(problem, solver=Solver(solver.bank, solver.blocks, solver.inertia))
