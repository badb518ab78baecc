"""Which of several effects is taken: the one with most evidence, a simpler one, or the commonest of those that tie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dsd_cli.effects import Effect, get_effect
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.evidence import Evidence
from dsd_cli.signals.rounding import ROUNDING


@dataclass(frozen=True)
class Option:
    """A set of effects with one more (or another) in it, fitted; `effect` is that one."""

    effect: str
    fit: Fit
    evidence: float


def preferred(search: Evidence, options: Sequence[Option]) -> Option | None:
    """The cheapest, and then the commonest, of those of which the one with most evidence leads by too little to be
    certain, or to matter in practice; one of more sizes only if none of fewer on the same channels is among them."""
    if not options:
        return None
    best = max(options, key=lambda o: o.evidence)
    as_good = [o for o in options if _as_good(search, o, best)]
    effects = [get_effect(o.effect) for o in as_good]
    first = [o for o, e in zip(as_good, effects, strict=True) if not any(_simpler(other, e) for other in effects)]
    return min(first, key=lambda o: (search.price(o.fit.terms), get_effect(o.effect).rarity, -o.evidence))


def in_common_terms(search: Evidence, fit: Fit) -> Fit:
    """With the commonest of the effects that do the same in place of each member: moved in one direction, dry friction
    and a load are one column, and so are viscous friction and its asymmetry. Over a small travel a weight is a load and
    a stiffness, and beside a stiffness that holds it a cubic one: these are taken where they explain more, and where
    nothing but that stiffness holds the weight.

    What is simpler and what is commoner may go round in a circle: it ends where it was before.
    """
    been: set[frozenset[str]] = set()
    while (here := frozenset(t.id for t in fit.terms)) not in been:
        been.add(here)
        fit = _one_commoner(search, fit)
    return fit


def _one_commoner(search: Evidence, fit: Fit) -> Fit:
    """With one member in commoner terms; the same where there is none."""
    for term in search.added(fit.terms):
        rest, here = tuple(t for t in fit.terms if t != term), {t.id for t in fit.terms}
        own = Option(term.id, fit, search.evidence(fit))
        commoner = [e for e in map(get_effect, search.allowed) if _before(e, term.effect) and e.id not in here]
        for effect in sorted((e for e in commoner if not (e.searched or e.listed)), key=lambda e: e.rarity):
            other = search.fit((*rest, Term(effect.id)), fit.tap)
            if _as_good(search, Option(effect.id, other, search.evidence(other)), own):
                return other
        if simple := _simple(term.effect, [name for name in search.allowed if name not in here]):
            other = search.fit((*rest, *map(Term, simple)), fit.tap)
            lead = POLICY.least_gain if search.problem.errors.cancelled(fit, term) else 0.0
            if own.evidence - search.evidence(other) < lead:
                return other
    return fit


def _before(one: Effect, other: Effect) -> bool:
    """Whether one of two that do the same is named: the simpler, else the commoner."""
    return _simpler(one, other) or (one.rarity < other.rarity and not _simpler(other, one))


def _simpler(one: Effect, other: Effect) -> bool:
    """Whether one has fewer sizes, on no other channels: a stiffness than a weight, which it is over a small travel."""
    return one.role is other.role and {*one.needs} <= {*other.needs} and 0 < one.sizes < other.sizes


def _simple(effect: Effect, allowed: Sequence[str]) -> list[str]:
    """The commonest laws of one size that are simpler than a sine of known period, as many as it has sizes; of any
    other effect none."""
    if effect.searched or not any(p.whole_turn for p in effect.parameters):
        return []
    alike = (e for e in map(get_effect, allowed) if _simpler(e, effect) and e.sizes == 1)
    found = sorted((e.rarity, e.id) for e in alike if not (e.searched or e.listed))
    return [name for _, name in found[: effect.sizes]] if len(found) >= effect.sizes else []


def _as_good(search: Evidence, one: Option, best: Option) -> bool:
    """Whether a lead of the best over one that costs no more is not certain, or over a cheaper one does not matter."""
    saved = search.price(best.fit.terms) - search.price(one.fit.terms)
    if search.lead(one.fit, best.fit) < POLICY.least_gain:
        return saved > -ROUNDING
    return saved > ROUNDING and not search.practical(one.fit, best.fit)
