"""Further effects of a kind whose values no log identifies are not there, whatever they gain."""

from __future__ import annotations

import math

from dsd_cli.effects import kind_of
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import Estimates
from dsd_cli.identify.search.sets import Search


def identified_only(search: Search, whole: Fit) -> Fit:
    """The set without further effects of a kind of which no force is identified: what is left at stops and turns
    repeats with the motion, and is a sum of lines to any accuracy, but the rows that identify values do not have it."""
    while (told := _told(search, whole)) is not whole:
        whole = search.settled(told)
    return whole


def _told(search: Search, whole: Fit) -> Fit:
    """Without those, one after the other, shapes as they are; the same fit if there are none."""
    while any(kind_of(t.id) != t.id for t in search.added(whole.terms)):
        estimates = search.problem.values(whole, as_found=True).estimates
        sizes = {t: _deviations(t, estimates) for t in search.added(whole.terms) if kind_of(t.id) != t.id}
        least = min(sizes, key=lambda t: sizes[t])
        if sizes[least] > POLICY.value_deviations:
            break
        whole = search.fit(tuple(t for t in whole.terms if t != least), whole.tap)
    return whole


def _deviations(term: Term, estimates: Estimates) -> float:
    """Standard errors by which the largest force of an effect is away from 0; angles are none."""
    names = [p.name for p in term.effect.parameters if p.linear and p.unit != "rad"]
    found = [estimates[f"{term.id}.{name}"] for name in names]
    told = (math.inf if e.held else abs(e.value) / e.std_error for e in found if e.held or e.std_error > 0.0)
    return max(told, default=0.0)
