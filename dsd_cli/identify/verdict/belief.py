"""Belief that alternatives share by their held-out likelihood, block by block, and whether an effect is there whatever
else is: beside laws that name no physics, and with those in its place.

Each draw gives the blocks new random weights (Bayesian bootstrap) and each alternative a posterior weight by its
held-out log-likelihood less its penalty; the mean over the draws is the probability. So no single block decides, and
correlation within blocks does not count as evidence (pseudo-BMA+; Yao et al. 2018).
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.freeform import GAIN, FreeformFits
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.discrepancy import beyond_noise
from dsd_cli.identify.verdict.places import PLACE, more_in_other_half, of_places
from dsd_cli.signals.log import Array

DRAWS, SEED = 400, 20261121


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
    the position, unless a function of the position does as well without it. What laws of the position leave is what
    they leave in the other half of the travel, too: several of them together imitate any smooth function of it.

    misfit : whether more is left than the sensor leaves; without, nothing stands in for anything.
    """

    def __init__(self, search: Search, whole: Fit, misfit: bool) -> None:
        self.search, self.whole, self.misfit = search, whole, misfit
        self.left = beyond_noise(search, whole)

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

        Of what is left beside an effect only the background counts that no model of an axis says better; of a function
        of its own channels, which does better in its place, all that is left, for what stands in for another law leaves
        a good part of that.
        """
        rmse = self.search.problem.errors.rmse
        own = max(rmse(rest) ** 2 - rmse(self.whole) ** 2, 0.0)

        def share(left: float) -> float:
            return own / max(own + (POLICY.stands_in * left) ** 2, 1e-300)

        placed, left = of_places(member.effect) and self.elsewhere > 0.0, self.left
        if placed:  # what no function of the position takes over acts beside it
            beside, left = self._of_no_place(member), self.elsewhere
            instead = 1.0 - beside
        else:
            beside, instead = self._shares(member) if self.misfit else (1.0, 0.0)
        background = min(self.left, POLICY.least_unknown * self.search.problem.errors.force)
        if member.effect.memory:  # no function of the channels does what another law with memory does
            background = self.left
        return beside * share(background) + instead * share(left)

    def imitates(self, member: Term, there: float) -> bool:
        """Whether a law of the position that the other half of the travel speaks against is rather not there."""
        return there < POLICY.even and of_places(member.effect) and self.elsewhere > 0.0

    def _of_no_place(self, member: Term) -> float:
        """Share of what a law of the position takes off that a free function of the position does not take over: of the
        pitch of magnets that is finer than such a function all, of a weight nothing."""
        fits, on = self._part[2], (PLACE,)
        worth = float(fits.without(member.id).sum() - fits.without("").sum())
        own = float(fits.without(member.id, on).sum() - fits.without("", on).sum())
        return min(max(own / max(worth, 1e-300), 0.0), 1.0)

    def _shares(self, member: Term) -> tuple[float, float]:
        """Belief that an effect acts beside whatever else does, and that a function of its own channels acts instead;
        the rest is that of functions of other channels, or of nothing, instead."""
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
        return float(shares[: len(beside)].sum()), float(shares[len(beside) + 1 :][of_own].sum())
