"""Which of several effects is taken: the one with most evidence, a simpler one, or the commonest of those that tie."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from dsd_cli.effects import get_effect
from dsd_cli.identify.fit.bank import Term, Terms
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY


@dataclass(frozen=True)
class Option:
    """A set of effects with one more (or another) in it, fitted; `effect` is that one."""

    effect: str
    fit: Fit
    evidence: float


class Search(Protocol):
    """What of a search is asked for here (`search.sets`)."""

    allowed: tuple[str, ...]

    def fit(self, terms: Terms, near: int) -> Fit: ...

    def evidence(self, fit: Fit) -> float: ...

    def price(self, terms: Terms) -> float: ...

    def added(self, terms: Terms) -> Terms: ...

    @property
    def practical(self) -> Callable[[Fit, Fit], bool]: ...


def preferred(search: Search, options: Sequence[Option]) -> Option | None:
    """The one with most evidence; a cheaper one if the difference does not matter in practice, and the commonest of
    those that do the same."""
    if not options:
        return None
    best = max(options, key=lambda o: o.evidence)
    cheaper = [o for o in options if search.price(o.fit.terms) < search.price(best.fit.terms)]
    as_good = [o for o in cheaper if not search.practical(o.fit, best.fit)]
    best = max(as_good, key=lambda o: o.evidence) if as_good else best
    return min((o for o in options if _the_same(search, o, best)), key=lambda o: get_effect(o.effect).rarity)


def in_common_terms(search: Search, fit: Fit) -> Fit:
    """With the commonest of the effects that do the same in place of each member: moved in one direction, dry friction
    and a load are one column, and so are viscous friction and its asymmetry."""
    for term in search.added(fit.terms):
        rest, here = tuple(t for t in fit.terms if t != term), {t.id for t in fit.terms}
        commoner = [e for e in map(get_effect, search.allowed) if e.rarity < term.effect.rarity and e.id not in here]
        for effect in sorted((e for e in commoner if not (e.searched or e.listed)), key=lambda e: e.rarity):
            other = search.fit((*rest, Term(effect.id)), fit.tap)
            option = Option(effect.id, other, search.evidence(other))
            if _the_same(search, option, Option(term.id, fit, search.evidence(fit))):
                return in_common_terms(search, other)
    return fit


def _the_same(search: Search, one: Option, best: Option) -> bool:
    """Whether they explain the same with as many parameters."""
    near = one.evidence > best.evidence - POLICY.least_gain and not search.practical(one.fit, best.fit)
    return one is best or (near and math.isclose(search.price(one.fit.terms), search.price(best.fit.terms)))
