"""Several effects of one kind in a set: which name the next one has, and whether a log distinguishes two of them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from dsd_cli.effects import Ranges, free_name, get_effect, kind_of
from dsd_cli.identify.fit.bank import Term, Terms
from dsd_cli.identify.policy import POLICY


def names_to_try(allowed: Iterable[str], here: Collection[str], ranges: Ranges) -> Iterator[str]:
    """Effects that may be added to those that are `here`: one that is there already under its next name, if it repeats
    and the log may distinguish one more of it."""
    tried = set()
    for name in allowed:
        kind, repeats = kind_of(name), get_effect(name).repeats
        if name in here:
            name = free_name(kind, here) if repeats is not None and repeats(ranges) else ""
        if name and kind not in tried:
            tried.add(kind)
            yield name


def apart(one: Term, others: Iterable[Term], ranges: Ranges) -> bool:
    """Whether an effect differs from those of its kind by as many periods in the log as it takes to distinguish two."""
    periods = one.effect.periods
    if periods is None:
        return True
    kind, own = kind_of(one.id), periods(one.shape, ranges)
    alike = (t for t in others if t.id != one.id and kind_of(t.id) == kind)
    return all(abs(periods(t.shape, ranges) - own) >= POLICY.periods_apart for t in alike)


def renamed(terms: Terms, alike: Terms) -> Terms:
    """The same effects, those of one kind in the order of `alike` and under the first names that the others leave."""
    names, left = {t.id for t in terms} - {t.id for t in alike}, iter(alike)
    found = []
    for term in terms:
        if term in alike:
            term = next(left)
            term = Term(free_name(kind_of(term.id), names), term.items)
            names.add(term.id)
        found.append(term)
    return tuple(found)
