"""Belief that alternatives share by their held-out likelihood, block by block, and whether an effect is there whatever
else is: beside laws that name no physics, and with those in its place.

Each draw gives the blocks new random weights (Bayesian bootstrap) and each alternative a posterior weight by its
held-out log-likelihood less its penalty; the mean over the draws is the probability. So no single block decides, and
correlation within blocks does not count as evidence (pseudo-BMA+; Yao et al. 2018).

Held-out blocks of time hold no place that a fit has not seen, so that a weight, a spring and some sines together pass
for any smooth force of the position, such as that of a cable chain. Fitted in one half of the travel, a law predicts
the other; what only interpolates does not.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from dsd_cli.effects import Effect, Role
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.blocks import solve, total_gram
from dsd_cli.identify.fit.freeform import GAIN, FreeformFits
from dsd_cli.identify.fit.row_weights import many_sure
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.discrepancy import Discrepancy, above_floor, discrepancy_of, force_beyond, only_at_stops
from dsd_cli.signals.log import Array

DRAWS, SEED = 400, 20261121
PLACE = "position"


def belief_by_squares(squares: Array) -> Array:
    """Share of belief, shape (m,), of rivals that leave these held-out squares on each of B blocks, shape (m, B).

    By the profile likelihood, N/2 ln, with N = B: what none of the rivals follows is alike all through a block, and
    decides by far too much where it counts as noise of single rows.
    """
    left = np.maximum(squares.sum(axis=1), 1e-300)
    least, more = left.argmin(), left - left.min()
    nats = 0.5 * squares.shape[1] * np.log(left / left.min())
    gains = (squares[least] - squares) * (nats / np.where(more > 0.0, more, 1.0))[:, None]
    return shared_belief(gains, np.zeros(len(squares)))


def shared_belief(gains: Array, prices: Array) -> Array:
    """gains: nats per block, shape (m, B)."""
    blocks = gains.shape[1]
    weights = np.random.default_rng(SEED).dirichlet(np.ones(blocks), DRAWS) * blocks
    totals = POLICY.tempering * (weights @ gains.T - prices)
    totals -= totals.max(axis=1, keepdims=True)
    belief = np.exp(totals)
    return np.asarray((belief / belief.sum(axis=1, keepdims=True)).mean(axis=0))


#: Channels of a function without a name; () is none.
Law = tuple[str, ...]


class UnnamedLaws:
    """Functions of the channels beside the set that was found, and in the place of its members.

    A set that leaves something is one of several: the rest may be a function of any channels, and an effect either acts
    beside that, or stands in for it. Each function, and none, is fitted with the effect and without it, and these share
    the belief (Bayesian model averaging; Hoeting et al. 1999). So dry friction stays sure where what is left depends on
    the position, unless a function of that does as well without it. What laws of it leave in the other half counts too.
    """

    def __init__(self, search: Search, whole: Fit, beyond: Discrepancy) -> None:
        self.search, self.whole = search, whole
        self.left, self.certain = force_beyond(search, whole, beyond), beyond.unknown or beyond.certain

    @cached_property
    def elsewhere(self) -> float:
        """rms beyond the sensor's noise, unit of u, that the set leaves in the half of the travel where it was not
        fitted; 0 where what that is more than in its own is too little to be missing."""
        more = more_in_other_half(self.search, self.whole)
        return math.hypot(self.left, math.sqrt(more)) if more > self.search.problem.least_missing**2 else 0.0

    @cached_property
    def _part(self) -> tuple[Search, Fit, FreeformFits]:
        part = self.search.excerpt or self.search
        fit = self.whole if part is self.search else part.fit(self.whole.terms, self.whole.tap)
        return part, fit, part.freeform(fit)

    def belief(self, member: Term, rest: Fit) -> float:
        """That what a member explains is there as such. rest : the set without it.

        Of what is left beside an effect only the background counts that no model of an axis says better; where another
        law of its own channels does better in its place all of that, for what stands in leaves a good part.
        """
        rmse = self.search.problem.errors.rmse
        worth, left = max(rmse(rest) ** 2 - rmse(self.whole) ** 2, 0.0), self.left

        def share(left: float, part: float = 1.0) -> float:
            return part * worth / max(part * worth + left**2, 1e-300)

        beside, instead = [(1.0, 1.0)], 0.0
        if of_places(member.effect) and self.elsewhere > 0.0:  # what no function of the position takes over acts beside
            of_no_place, left = self._part_beside(member, (PLACE,)), self.elsewhere
            beside, instead = [(of_no_place, 1.0)], 1.0 - of_no_place
        elif left > 0.0 and (self._asked(member) or above_floor(self.search, self.whole)):
            beside, instead = self._shares(member)
        background = min(self.left, POLICY.least_unknown * self.search.problem.errors.force)
        if member.effect.memory:  # no function of the channels does what another law with memory does
            background = POLICY.stands_in * self.left
        there = sum(likely * share(background, part) for likely, part in beside)
        return there + instead * share(POLICY.stands_in * left)

    def _asked(self, member: Term) -> bool:
        """Whether a law beside it, or in its place, is looked for in little that is left. What acts on u has no
        columns; and of what is left at stops alone functions follow how each stop came about, if none is certain."""
        return member.effect.role is not Role.INPUT and (self.certain or not only_at_stops(self.search, self.whole))

    def imitates(self, member: Term, there: float) -> bool:
        """Whether another law is rather there, by the other half of the travel."""
        return there < POLICY.even and of_places(member.effect) and self.elsewhere > 0.0

    def _part_beside(self, member: Term, on: Law) -> float:
        """Share of what an effect takes off that a free function of these channels does not take over: beside one of
        the position all of the pitch of magnets that is finer, and none of a weight; beside one of the speed, of
        friction by the load, what the load shows at one speed."""
        fits = self._part[2]
        worth, own = (float(fits.without(member.id, law).sum() - fits.without("", law).sum()) for law in ((), on))
        return min(max(own / worth, 0.0), 1.0) if worth > 0.0 else 1.0

    def _shares(self, member: Term) -> tuple[list[tuple[float, float]], float]:
        """([belief that an effect acts beside a law, or alone; its part beside that], belief that a function of its own
        channels acts instead); the rest is that of functions of other channels, or of nothing, instead."""
        search, fit, fits = self._part
        own = set(member.effect.needs or ("time",))
        groups = [g for g in fits.groups() if "u" in own or "u" not in g]  # a loop's u answers whatever acts
        of_own = [own <= {"u" if name == GAIN else name for name in group} for group in groups]
        rest = search.without(fit, member)
        beside: list[Law] = [(), *(g for g, mine in zip(groups, of_own, strict=True) if not mine)]
        instead: list[Law] = [(), *groups]
        # an event in time has no columns, and what is left without it is fitted anew
        alone = search.freeform(rest) if member.effect.listed else fits
        squares = [fits.without("", on) for on in beside] + [alone.without(member.id, on) for on in instead]
        prices = [POLICY.unknown_nats * bool(on) for on in (*beside, *instead)]  # each is the best of some ten
        prices = [x + search.price((member,)) * (i < len(beside)) for i, x in enumerate(prices)]
        likeliest = min(squares, key=lambda left: float(left.sum()))
        gains = np.stack([search.gained(likeliest, left) for left in squares]) / search.by_chance(rest, fit)
        shares = shared_belief(gains, np.array(prices))
        parts = [(float(share), self._part_beside(member, on)) for share, on in zip(shares, beside, strict=False)]
        return parts, float(shares[len(beside) + 1 :][of_own].sum())


def without_imitating(search: Search, whole: Fit, named: set[str], beyond: Discrepancy) -> tuple[Fit, Discrepancy]:
    """A set and what is beyond it; without the members that imitate another law, if any are named, which is unknown."""
    if not named:
        return whole, beyond
    rest = search.without(whole, *(t for t in whole.terms if t.id in named))
    return rest, replace(discrepancy_of(search, rest), unknown=True)


def of_places(effect: Effect) -> bool:
    """Whether it is a force that the position alone decides, or a constant one, which is the simplest of them."""
    alone = effect.role is Role.APPLIED and not (effect.memory or effect.of_time or effect.listed)
    return alone and {*effect.needs} <= {PLACE}


def more_in_other_half(search: Search, fit: Fit) -> float:
    """Mean square, unit of u, that the values of a fit in one half of the travel leave in the other beyond what those
    of both leave, and beyond what their errors make of it; 0 without laws of the position that were added, or without a
    position that is sure."""
    laws = [t for t in search.added(fit.terms) if of_places(t.effect)]
    if not any(t.effect.needs for t in laws) or search.problem.reconstructed(PLACE):
        return 0.0
    part, fit = search.searched(fit)
    fits, chance = part.freeform(fit), part.by_chance(part.without(fit, *laws), fit)
    halves, rows = _halves(fits)
    (here, seen), (there, other) = halves
    both = np.append(1.0, -solve((here + there)[None])[0])
    row = 2.0 * chance / fits.equations.counted
    more = _left(here, other, row) + _left(there, seen, row) - float(both @ (seen + other) @ both)
    return max(more, 0.0) / max(rows, 1)


def _halves(fits: FreeformFits) -> tuple[list[tuple[Array, Array]], int]:
    """Of each half of the travel, with as many rows in either: the inner products of what is explained and the columns,
    (whitened, in the unit of u where the direction of the motion is sure), shapes (p+1, p+1); how many rows are so."""
    equations, base = fits.equations, np.stack(fits.base)
    at = equations.acting([piece.values[PLACE] for piece in fits.pieces], smooth=False, held=False)
    kept, sure = equations.kept > 0.0, many_sure(equations, nearly=True)
    far = at > np.median(at[kept])
    judged = kept if sure is None else kept & sure
    white, plain = np.stack([equations.whitened(x) for x in base]), base * judged
    halves = [(total_gram([*(white * half)]), total_gram([*(plain * half)])) for half in (far, ~far)]
    return halves, int(judged.sum())


def _left(here: Array, there: Array, row: float) -> float:
    """Sum of squares there, unit of u, beyond what the errors of the values make of it. here : whitened. row : by which
    all that is left here, squared, is the variance that a row of it has for the values."""
    values = np.append(1.0, -solve(here[None])[0])
    size = np.sqrt(np.maximum(np.diag(here)[1:], 1e-300))
    scaled = np.outer(size, size)
    errors = row * float(values @ here @ values) * np.linalg.pinv(here[1:, 1:] / scaled, 1e-9)
    return float(values @ there @ values - np.sum(errors * there[1:, 1:] / scaled))
