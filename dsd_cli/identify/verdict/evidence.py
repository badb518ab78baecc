"""Probabilities by resampling the held-out blocks, and effects that the recordings cannot distinguish.

Each draw gives the blocks new random weights (Bayesian bootstrap) and each alternative a posterior weight by its
held-out log-likelihood less its penalty; the mean over the draws is the probability. So no single block decides, and
correlation within blocks does not count as evidence (pseudo-BMA+; Yao et al. 2018).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit.bank import has_friction
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Option, Search
from dsd_cli.signals.log import Array

DRAWS, SEED = 400, 20261121
#: Name of the alternative without any further effect.
NOTHING = ""


@dataclass(frozen=True)
class Membership:
    """An effect of the found set against every effect that could replace it.

    probabilities : effect (or `NOTHING`) -> share of belief. rivals : effects that explain the recordings as well;
    alike : those of them whose likelihood is less, but by no more than the model misfits anyway, and that change what
    the model had given as little. surest : no verdict on it may be surer.
    """

    effect: str
    probabilities: Mapping[str, float]
    rivals: tuple[str, ...]
    alike: tuple[str, ...] = ()
    surest: float = 1.0

    @property
    def place(self) -> float:
        """Belief that it, or one of its rivals, is there."""
        return sum(self.probabilities.get(name, 0.0) for name in (self.effect, *self.rivals))


def memberships(search: Search, whole: Fit, effects: Iterable[str], unknown: bool) -> dict[str, Membership]:
    """Of each of these effects; `unknown` : something remains that nothing explains."""
    misfit = unknown or search.problem.reconstructed("velocity") or search.noise.inflation > POLICY.most_inflation
    return {name: membership(search, whole, name, misfit) for name in effects}


def membership(search: Search, whole: Fit, effect_id: str, misfit: bool) -> Membership:
    """Take one effect out of the found set and try every other effect instead of it.

    Parameters
    ----------
    misfit : something unknown remains, or rows are far from independent: then a lead in likelihood may come from
        what is unknown, and an effect that explains nearly as much is a tie.
    """
    plain = search.problem.errors
    member = next(t for t in whole.terms if t.id == effect_id)
    rest = search.fit(tuple(t for t in whole.terms if t is not member), whole.tap)
    options = [o for o in search.options(rest) if o.effect != effect_id]
    own = Option(effect_id, whole, search.evidence(whole))
    worth = plain.rmse(rest) ** 2 - plain.rmse(whole) ** 2

    def share(option: Option) -> float:
        return (plain.rmse(rest) ** 2 - plain.rmse(option.fit) ** 2) / max(worth, 1e-300)

    def may_be(option: Option) -> bool:
        """At stops and turns rows count little as evidence, but what is far off there is no rival."""
        far_off = plain.rmse(option.fit) > POLICY.rival_error * plain.rmse(whole)
        return option.evidence > search.evidence(rest) and not far_off

    def rivals(option: Option) -> bool:
        if share(option) < POLICY.rival_share or not may_be(option):
            return False
        lead = search.gains(option.fit, whole)
        spread = float(np.std(lead, ddof=1)) * math.sqrt(len(lead))
        return float(lead.sum()) < POLICY.rival_deviations * spread or not search.matters(option.fit, whole)

    def alike_to(option: Option) -> bool:
        return misfit and share(option) > POLICY.rival_share_in_misfit and may_be(option)

    as_well = [o for o in options if alike_to(o)]
    found = dict.fromkeys(o.effect for o in (*as_well, *filter(rivals, options)))
    as_told = _changed(search, whole) + math.log(POLICY.changed_for_name)
    alike = [o.effect for o in as_well if _changed(search, o.fit) <= as_told and not get_effect(o.effect).of_time]
    shares = probabilities(search, rest, [own, *options])
    surest = 1.0 if _told(search, whole, effect_id) else POLICY.even
    if member.effect.listed and has_friction(whole.terms) and search.problem.reconstructed("velocity"):
        surest = min(surest, POLICY.even)  # a speed that wanders turns friction round: that looks like a push
    if not (search.problem.reconstructed("position") and _of_position(effect_id)):
        return Membership(effect_id, shares, tuple(found), tuple(alike), surest)
    afloat = [o.effect for o in options if _of_position(o.effect)]
    surest = min(surest, POLICY.even)
    return Membership(effect_id, shares, tuple(dict.fromkeys([*found, *afloat])), tuple(alike), surest)


def _told(search: Search, whole: Fit, effect_id: str) -> bool:
    """Whether any value of an effect, beside all that was found, is away from 0 by more than its standard error makes
    likely: a gain without a value comes from what the errors count as unknown."""
    estimates = search.problem.values(whole).estimates
    own = [e for name, e in estimates.items() if name.startswith(f"{effect_id}.")]
    return not own or any(e.held or abs(e.value) > POLICY.told_deviations * e.std_error for e in own)


def _changed(search: Search, fit: Fit) -> float:
    """The largest |log| of the factors by which a fit changes the sizes of the model's effects, infinite where
    it takes a force away or turns it round: with a spring in place of a cubic one, a known weight would have to be six
    times what it was believed to be."""
    given, found = search.problem.model.effects, search.problem.scale.model(fit).effects
    sizes = [
        (values[p.name], found[name][p.name])
        for name, values in given.items()
        if name in found
        for p in get_effect(name).parameters
        if p.linear and not p.listed and not p.whole_turn and p.name in values
    ]
    return max((abs(math.log(now / was)) if now * was > 0.0 else math.inf for was, now in sizes if was), default=0.0)


def _of_position(effect_id: str) -> bool:
    """Whether the effect is a force that depends on the position alone: without its zero, one passes for another."""
    effect = get_effect(effect_id)
    return effect.role is Role.APPLIED and tuple(effect.needs) == ("position",)


def probabilities(search: Search, rest: Fit, options: list[Option]) -> dict[str, float]:
    """Probability of each option, and of none of them (`NOTHING`)."""
    gains = np.stack([np.zeros(len(rest.losses)), *(search.gains(rest, o.fit) for o in options)])
    prices = np.array([0.0, *(search.price(o.fit.terms) - search.price(rest.terms) for o in options)])
    shares = shared_belief(gains, prices)
    return dict(zip((NOTHING, *(o.effect for o in options)), shares.tolist(), strict=True))


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
