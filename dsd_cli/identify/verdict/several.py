"""Several effects of one kind in the set that was found: the one that is worth most alone has the first name."""

from __future__ import annotations

from dsd_cli.effects import free_name, kind_of
from dsd_cli.identify.fit.bank import Term, Terms
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.search.sets import Option, Search
from dsd_cli.identify.search.several import renamed


def strongest_first(search: Search, whole: Fit) -> tuple[Fit, list[Option]]:
    """(the set with those of a kind numbered by what they are worth alone, the first of each kind of several alone).

    Names of which the user knows something stay.
    """
    added = search.added(whole.terms)
    kinds = dict.fromkeys(kind_of(t.id) for t in added if t.effect.repeats is not None)
    terms, first = whole.terms, []
    for kind in kinds:
        alike = tuple(t for t in added if kind_of(t.id) == kind)
        if any(search.solver.known.concerns(t.id) for t in alike):
            continue
        if len(alike) > 1:
            ranked = sorted(_alone(search, kind, alike, whole.tap), key=lambda pair: -pair[0].evidence)
            first.append(ranked[0][0])
            alike = tuple(term for _, term in ranked)
        terms = renamed(terms, alike)
    return (whole if terms == whole.terms else search.fit(terms, whole.tap)), first


def _alone(search: Search, kind: str, alike: Terms, tap: int) -> list[tuple[Option, Term]]:
    """Each beside the effects of the model, under the first name that is free there."""
    name = free_name(kind, {t.id for t in search.base})
    fits = [(search.fit((*search.base, Term(name, t.items)), tap), t) for t in alike]
    return [(Option(name, fit, search.evidence(fit)), term) for fit, term in fits]
