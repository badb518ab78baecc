"""Several effects of one kind in the set that was found: the one that is missed most has the first name."""

from __future__ import annotations

from dsd_cli.effects import free_name, kind_of
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.search.repeats import renamed
from dsd_cli.identify.search.sets import Option, Search


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
            alike.sort(key=lambda t: -search.problem.errors.rmse(_without(search, whole, t)))
            first.append(_alone(search, Term(kind, alike[0].items), whole.tap))
        terms = renamed(terms, tuple(alike))
    return (whole if terms == whole.terms else search.fit(terms, whole.tap)), first


def _without(search: Search, whole: Fit, term: Term) -> Fit:
    return search.fit(tuple(t for t in whole.terms if t != term), whole.tap)


def _alone(search: Search, line: Term, tap: int) -> Option:
    """It beside the effects of the model, under the first name that is free there."""
    term = Term(free_name(line.id, {t.id for t in search.base}), line.items)
    fit = search.fit((*search.base, term), tap)
    return Option(term.id, fit, search.evidence(fit))
