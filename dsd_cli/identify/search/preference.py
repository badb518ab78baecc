"""Which of several effects is taken: the one with most evidence, a simpler one, or the commonest of those that tie."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from dsd_cli.effects import get_effect
from dsd_cli.identify.fit.bank import Term, Terms
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.rounding import ROUNDING


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
    """The cheapest, and then the commonest, of those of which the one with most evidence leads by too little to be
    certain, or to matter in practice."""
    if not options:
        return None
    best = max(options, key=lambda o: o.evidence)
    as_good = [o for o in options if _as_good(search, o, best)]
    return min(as_good, key=lambda o: (search.price(o.fit.terms), get_effect(o.effect).rarity, -o.evidence))


def in_common_terms(search: Search, fit: Fit) -> Fit:
    """With the commonest of the effects that do the same in place of each member: moved in one direction, dry friction
    and a load are one column, and so are viscous friction and its asymmetry."""
    for term in search.added(fit.terms):
        rest, here = tuple(t for t in fit.terms if t != term), {t.id for t in fit.terms}
        commoner = [e for e in map(get_effect, search.allowed) if e.rarity < term.effect.rarity and e.id not in here]
        for effect in sorted((e for e in commoner if not (e.searched or e.listed)), key=lambda e: e.rarity):
            other = search.fit((*rest, Term(effect.id)), fit.tap)
            option = Option(effect.id, other, search.evidence(other))
            if _as_good(search, option, Option(term.id, fit, search.evidence(fit))):
                return in_common_terms(search, other)
    return fit


def _as_good(search: Search, one: Option, best: Option) -> bool:
    """Whether a lead of the best over one that costs no more is not certain, or over a cheaper one does not matter."""
    saved = search.price(best.fit.terms) - search.price(one.fit.terms)
    if best.evidence - one.evidence < POLICY.least_gain:
        return saved > -ROUNDING
    return saved > ROUNDING and not search.practical(one.fit, best.fit)
