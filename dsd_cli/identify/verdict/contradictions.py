"""Warnings about values that the user knows: at a bound, or contradicted by the log (prior or held value)."""

from __future__ import annotations

import math
import re
from dataclasses import replace

from dsd_cli.identify.fit.problem import Problem
from dsd_cli.identify.fit.solve import Fit, Solver
from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import DELAY, Estimates
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
