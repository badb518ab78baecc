"""A set of effects at its delay, what it explains of the recordings, whether one explains surely more than another, and
which is taken: the one with most evidence, a simpler one, or the commonest of those that tie."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dsd_cli.effects import Effect, Role, get_effect
from dsd_cli.identify.fit.bank import SHARE, Term, Terms
from dsd_cli.identify.fit.blocks import spread_over_blocks
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.freeform import FreeformFits, freeform_fits
from dsd_cli.identify.fit.problem import Problem
from dsd_cli.identify.fit.row_weights import shared_inflation, unpredicted_share
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.values import MOST_SHARE
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.scan import Scan
from dsd_cli.signals.once import Answers, once, with_answers
from dsd_cli.signals.passes import mixed
from dsd_cli.signals.rounding import ROUNDING

#: Steps that a delay walks from where it was, and the share of one from which on the next is nearer.
MOST_WALKED, HALF_A_STEP = 12, 0.5


class Evidence:
    """Of sets of effects for a problem; `base` : effects that the model has, `allowed` : those that may be added."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.solver, self.noise, self.base = problem, problem.solver, problem.noise, problem.base
        self.practical, self.allowed = problem.practical, problem.candidates
        self.ranges, self.taps = problem.ranges, problem.solver.taps(problem.most_tap)
        self._tried: dict[tuple[Terms, int], Answers] = {}

    @property
    def equations(self) -> Equations:
        """Whitened ones."""
        return self.problem.equations

    def added(self, terms: Terms) -> Terms:
        """Those that the model does not have."""
        return tuple(t for t in terms if t.id not in {b.id for b in self.base})

    def fit(self, terms: Terms, near: int) -> Fit:
        """At the best delay near `near` steps: the share of a further step says which way to go.

        Where the values want a later command and the forward form refuses one, a force is missing that leans like lag:
        the delay stays at whole steps, or it would take a part of J. Noise that u alone has draws the share to a half,
        where it is least: there the next steps are tried, where u is what is explained.
        """
        least, most = self.taps[0], self.taps[-1]
        tap, tried = min(max(near, least), most), set()
        while True:
            tried.add(tap)
            fit = self.solver.fit(terms, tap)
            share = float(fit.total[SHARE])
            refused = share > MOST_SHARE and fit.forward[1 + SHARE] == 0.0 and least < most
            if refused or (tap == most and share > 1.0):
                return self.solver.fit(terms, tap, whole_steps=True)
            step = math.floor(share) if share > 1.0 else -1 if share == 0.0 else 0
            if inside := step == 0 and fit.inverse:
                step = 1 if share > HALF_A_STEP else -1
            following = min(max(tap + step, least), most)
            if step == 0 or following in tried or len(tried) > MOST_WALKED:
                return fit
            if (step < 0 or inside) and self.solver.squares(terms, following) >= fit.squares:
                return fit
            tap = following

    def without(self, fit: Fit, *members: Term) -> Fit:
        """A fit of the others, from the same delay on."""
        return self.fit(tuple(t for t in fit.terms if t not in members), fit.tap)

    def freeform(self, fit: Fit) -> FreeformFits:
        """Free-form functions beside a fit, judged in these rows."""
        problem = self.problem
        return freeform_fits(problem.errors.bank, self.equations, problem.blocks, fit, self.solver.inertia)

    def taps_for(self, term: Term, tap: int) -> list[int]:
        """Delays to try with an effect that is late itself: before it was known, delay stood in for it."""
        if term.effect.lateness is None:
            return [tap]
        late = term.effect.lateness(term.shape) / self.solver.bank.tap_time
        tried = {round(tap - share * late) for share in (0.5, 0.65, 0.8, 0.9, 1.0)}
        return sorted({min(max(n, self.taps[0]), self.taps[-1]) for n in tried})

    def scan(self, terms: Terms, tap: int) -> Scan:
        """What another effect would gain beside these."""
        return with_answers(Scan(self.solver, terms, tap, self.taps_for), self._tried.setdefault((terms, tap), {}))

    def evidence(self, fit: Fit) -> float:
        """Held-out log-likelihood (up to a constant) less the price of the effects beyond the model's, nats."""
        return -self.nats(fit.loss) - self.price(fit.terms)

    def nats(self, squares: float, more: float = 0.0) -> float:
        """Negative log-likelihood of a sum of squares; the variance is that of the noise, or what is left if more.

        more : rows beyond those of the logs that the squares are of.

        What is left beyond the noise is force that no effect describes, and what takes a hundredth off it is no surer
        than if it were noise: N/2 ln of it, from where it exceeds the noise on.
        """
        rows = self.equations.counted + more
        over = 2.0 * squares / (rows * self.noise.nats)
        return 0.5 * rows * (over if over < 1.0 else 1.0 + math.log(over))

    def price(self, terms: Terms) -> float:
        """Nats for having chosen these effects and searched their shapes."""
        return sum(
            POLICY.effect_price * (1 + t.effect.searched) + POLICY.pulse_price * len(t.shape.get("edges", ()))
            for t in self.added(terms)
        )

    def gains(self, before: Fit, after: Fit) -> np.ndarray:
        """Nats per block, shape (B,), without prices."""
        return self.gained(before.losses, after.losses)

    def gained(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """The same of held-out squares, shape (B,) each: shares of the whole gain as of what squares fall."""
        left, less = float(before.sum()), float(after.sum())
        scale = (self.nats(left) - self.nats(less)) / (left - less) if left != less else 1.0 / self.noise.nats
        return (before - after) * scale

    def lead(self, before: Fit, after: Fit) -> float:
        """Evidence that one fit has over another, nats: of a law in noise of the colour of what it leaves, of a line in
        time or a push by what the past of the residual does not predict."""
        gained = (self.nats(before.loss) - self.nats(after.loss)) / self.by_chance(before, after)
        if _of_time(before) != _of_time(after):
            gained = min(gained, 0.5 * self.equations.counted * math.log(self._news(before) / self._news(after)))
        return gained - self.price(after.terms) + self.price(before.terms)

    def _news(self, fit: Fit) -> float:
        """Mean square of what the past of a residual does not predict of it."""
        left = self._left(fit)[self.equations.kept]
        return max(float(left @ left) * unpredicted_share(left), 1e-300)

    @once
    def by_chance(self, before: Fit, after: Fit) -> float:
        """How many times more the difference of two fits explains by chance of what the second leaves than of noise
        that is white (at least 1), by Bartlett's formula."""
        was, left = (self._left(fit)[self.equations.kept] for fit in (before, after))
        row, noise = after.loss / max(self.equations.counted, 1.0), self.noise
        taken = max(row, noise.variance * noise.inflation)  # what `nats` takes for the variance of a row
        of_white = max(row, noise.variance) / taken
        return max(shared_inflation(left, was - left) * of_white, 1.0)

    def _left(self, fit: Fit) -> np.ndarray:
        """Whitened residual of the form that is evidence, shape (N,)."""
        return mixed(self.solver.bank.rows(fit.terms, fit.tap), fit.forward)

    def hardly_less(self, one: Fit, best: Fit) -> bool:
        """Whether a fit leaves no more beyond the best than any model of an axis does beyond its machine: of such a
        misfit the law with more freedom explains a part."""
        errors = self.problem.errors
        return errors.rmse(one) ** 2 - errors.rmse(best) ** 2 < (POLICY.least_unknown * errors.force) ** 2

    def matters(self, before: Fit, after: Fit) -> bool:
        """Whether going from one fit to the other is certain and of use. A force that only others hold, and that no
        more than any misfit shows, is of none: in a spring beside a weight is any small even function of the place."""
        if self.lead(before, after) < POLICY.least_gain:
            return False
        new = [t for t in after.terms if t.id not in {b.id for b in before.terms}]
        if self.hardly_less(before, after) and any(self.problem.errors.cancelled(after, t) for t in new):
            return False
        spread = _events(before) != _events(after) or spread_over_blocks(self.gains(before, after))
        return spread and self.practical(before, after)


def _of_time(fit: Fit) -> set[Term]:
    """Effects that are functions of time alone, whatever the motion."""
    return {t for t in fit.terms if t.effect.of_time}


def _events(fit: Fit) -> set[Term]:
    """Single events, which have a price of their own: one block may be all that sees one."""
    return {t for t in fit.terms if t.effect.listed}


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
    what nothing but that stiffness holds explains no more than any misfit.

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
        if (plain := in_plain_laws(search, fit, term)) is not None:
            others_hold_it = search.problem.errors.cancelled(fit, term)
            if search.evidence(plain) > own.evidence or (others_hold_it and search.hardly_less(plain, fit)):
                return plain
        for pair in _pairs(term.effect, [name for name in search.allowed if name not in here]):
            other = search.fit((*rest, *map(Term, pair)), fit.tap)
            if search.evidence(other) > own.evidence:
                return other
    return fit


def _before(one: Effect, other: Effect) -> bool:
    """Whether one of two that do the same is named: the simpler, else the commoner."""
    return _simpler(one, other) or (one.rarity < other.rarity and not _simpler(other, one))


def _simpler(one: Effect, other: Effect) -> bool:
    """Whether one has fewer sizes, on no other channels: a stiffness than a weight, which it is over a small travel."""
    return one.role is other.role and {*one.needs} <= {*other.needs} and 0 < one.sizes < other.sizes


def in_plain_laws(search: Evidence, fit: Fit, member: Term) -> Fit | None:
    """A fit with the plain laws that are together what a member is over a small travel; None if there are none."""
    here = {t.id for t in fit.terms}
    plain = _simple(member.effect, [name for name in search.allowed if name not in here])
    rest = tuple(t for t in fit.terms if t != member)
    return search.fit((*rest, *map(Term, plain)), fit.tap) if plain else None


def _simple(effect: Effect, allowed: Sequence[str]) -> list[str]:
    """The commonest laws of one size that are simpler than a sine of known period, as many as it has sizes; of any
    other effect none."""
    if effect.searched or not any(p.whole_turn for p in effect.parameters):
        return []
    found = sorted((e.rarity, e.id) for e in map(get_effect, allowed) if _plain(e) and _simpler(e, effect))
    return [name for _, name in found[: effect.sizes]] if len(found) >= effect.sizes else []


def _pairs(effect: Effect, allowed: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Two forces of one size each, without a shape, that may be what one with a searched shape bends itself to: Coulomb
    friction beside a drag is a Stribeck friction of hardly a quarter of the top speed. Of any other effect none."""
    if not effect.searched or effect.sizes != 1 or effect.role is not Role.FRICTION:
        return
    needs = {*effect.needs}
    yield from combinations([n for n in allowed if _plain(e := get_effect(n)) and {*e.needs} <= needs], 2)


def _plain(effect: Effect) -> bool:
    """Whether it is a force of one size and no shape."""
    return effect.role in (Role.APPLIED, Role.FRICTION) and effect.sizes == 1 and not (effect.searched or effect.listed)


def _as_good(search: Evidence, one: Option, best: Option) -> bool:
    """Whether a lead of the best over one that costs no more is not certain, or over a cheaper one does not matter, or
    over a simpler one is no more than any misfit."""
    saved = search.price(best.fit.terms) - search.price(one.fit.terms)
    if search.lead(one.fit, best.fit) < POLICY.least_gain:
        return saved > -ROUNDING
    simpler = saved > -ROUNDING and _simpler(get_effect(one.effect), get_effect(best.effect))
    misfit = simpler and search.hardly_less(one.fit, best.fit)
    return misfit or (saved > ROUNDING and not search.practical(one.fit, best.fit))
