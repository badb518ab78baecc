"""How sure a name is, and whether that is all: two questions that are answered apart, each with a probability.

How sure a name is follows from three things by one rule, the same for the verdict and for every member of the set: the
belief in it against every effect in its place, the belief that it is there whatever law without a name explains what
all that was found leaves, and how many independent equations there are for a set of that size.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit.bank import has_friction
from dsd_cli.identify.fit.direction import DRY
from dsd_cli.identify.fit.laws_of_u import is_law_of_u
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.results import Estimates, Missing, Unexplained
from dsd_cli.identify.search.drift_search import LOOKS_THE_SAME
from dsd_cli.identify.search.evidence import in_plain_laws
from dsd_cli.identify.search.sets import Option, Search
from dsd_cli.identify.verdict.belief import UnnamedLaws, shared_belief
from dsd_cli.identify.verdict.discrepancy import (
    Discrepancy,
    above_floor,
    beyond_noise,
    force_beyond,
    noise_of_u,
    weightless,
)
from dsd_cli.identify.verdict.limits import Limits
from dsd_cli.identify.verdict.pushes import pushes_leave_more

#: Name of the alternative without any further effect.
NOTHING = ""


@dataclass(frozen=True)
class Membership:
    """An effect of the found set against every effect that could replace it.

    probabilities : effect (or `NOTHING`) -> share of belief. rivals : effects that explain the recordings as well;
    alike : those of them whose likelihood is less, but by no more than the model misfits anyway, and that change what
    the model had given as little. there : belief that it, or what takes its place, acts beside any law without a name.
    imitates : it does what another law does: see `UnnamedLaws.imitates`.
    surest : no verdict on it may be surer.
    """

    effect: str
    probabilities: Mapping[str, float]
    rivals: tuple[str, ...]
    alike: tuple[str, ...] = ()
    there: float = 1.0
    imitates: bool = False
    surest: float = 1.0

    @property
    def place(self) -> float:
        """Belief that it, or one of its rivals, is there."""
        return sum(self.probabilities.get(name, 0.0) for name in (self.effect, *self.rivals))

    def drawn(self, name: str) -> float:
        """Belief in an effect, or in what it has in a draw among it and its rivals, if that is more. What explains a
        log alike is the likelier the more often it is met: by its rank, as words are (Zipf's law)."""
        often = {one: 1.0 / (1 + get_effect(one).rarity) for one in (self.effect, *self.rivals)}
        return max(self.probabilities.get(name, 0.0), self.place * often.get(name, 0.0) / sum(often.values()))

    def belief(self, name: str) -> float:
        """In the effect at least what it has in a draw among its rivals; in one of these no more than that leaves."""
        likely, own = self.probabilities.get(name, 0.0), self.drawn(self.effect)
        return own if name == self.effect else min(likely, self.place - own) if name in self.rivals else likely


def memberships(search: Search, whole: Fit, beyond: Discrepancy) -> dict[str, Membership]:
    """Of each effect that was found, beside what is beyond the set."""
    misfit = beyond.unknown or search.problem.reconstructed("velocity")
    laws = UnnamedLaws(search, whole, beyond)
    proven = search.proven(whole)  # rows show the sum of both, as one of them would
    there = {t: 1.0 if t.id in proven else laws.belief(t, search.without(whole, t)) for t in search.added(whole.terms)}
    return {
        t.id: replace(membership(search, whole, t.id, misfit), there=likely, imitates=laws.imitates(t, likely))
        for t, likely in there.items()
    }


def membership(search: Search, whole: Fit, effect_id: str, misfit: bool) -> Membership:
    """Take one effect out of the found set and try every other effect instead of it.

    misfit : something unknown remains: then a lead in likelihood may come from that, and an effect that explains
        nearly as much is a tie.
    """
    plain = search.problem.errors
    member = next(t for t in whole.terms if t.id == effect_id)
    rest = search.without(whole, member)
    most = POLICY.rival_error * math.hypot(plain.rmse(whole), plain.at_rest(whole))
    # rests are no rows beside friction: what does not hold the axis there is not in its place, however well it moves it
    options = [o for o in search.options(rest) if o.effect != effect_id and plain.at_rest(o.fit) <= most]
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
        doubtful = float(lead.sum()) < POLICY.rival_deviations * spread or not search.matters(option.fit, whole)
        return doubtful or search.hardly_less(option.fit, whole)

    as_well = [o for o in options if misfit and share(o) > POLICY.rival_share_in_misfit and may_be(o)]
    as_told = max(changes(search, whole)) + math.log(POLICY.changed_for_name)
    named = (o for o in as_well if max(changes(search, o.fit)) <= as_told and not get_effect(o.effect).of_time)
    # a speed that wanders turns friction round: that looks like a push
    as_push = member.effect.listed and has_friction(whole.terms) and search.problem.reconstructed("velocity")
    afloat = _of_position(effect_id) and search.problem.reconstructed("position")
    at_place = [o for o in options if afloat and _of_position(o.effect)]
    instead = in_plain_laws(search, whole, member)  # over a small travel a weight is a load and a spring
    tied = instead if instead and rivals(Option(effect_id, instead, search.evidence(instead))) else rest
    together = tied.terms[len(rest.terms) :]
    one_by_one = (o.effect for o in (*as_well, *filter(rivals, options), *at_place))
    beside = search.left_open(whole) if effect_id == DRY else ()
    found = dict.fromkeys((*one_by_one, *(t.id for t in together), *beside))
    estimates = search.values(whole).estimates
    told = is_told(effect_id, estimates) or effect_id in search.proven(whole)
    once = POLICY.surest_in_doubt if member.effect.listed else 1.0  # an event is in one part of the data alone
    surest = POLICY.even if as_push or afloat or together or not told else once
    shares = probabilities(search, rest, [own, *options])
    return Membership(effect_id, shares, tuple(found), tuple(o.effect for o in named), surest=surest)


def is_told(effect_id: str, estimates: Estimates) -> bool:
    """Whether all values of an effect, beside all that was found, are away from 0 by more than their standard errors
    make likely: a gain without a value comes from what the errors count as unknown. A line of amplitude 0 is none,
    whatever its frequency, and friction that builds up over no way that is known is Coulomb's. Of a load any value. Any
    gain that varies passes for one that droops, by a value that is hardly known."""
    effect = get_effect(effect_id)
    own = [p.name for p in effect.parameters if not p.whole_turn and p.name not in effect.broad]
    known = [e for name in own if (e := estimates.get(f"{effect_id}.{name}")) is not None]
    every = any if effect.role is Role.STRUCTURE else all
    gain = effect.role is Role.APPLIED and is_law_of_u(effect)
    least = POLICY.contradicting_deviations if gain else POLICY.told_deviations
    return not known or every(e.held or abs(e.value) > least * e.std_error for e in known)


def changes(search: Search, fit: Fit) -> list[float]:
    """The |log| of the factors by which a fit changes the sizes of the model's effects, infinite where it takes a force
    away or turns it round: with a spring in place of a cubic one, a known weight would have to be six times what it was
    believed to be."""
    given, found = search.problem.model.effects, search.problem.scale.model(fit).effects
    sizes = [
        (values[p.name], found[name][p.name])
        for name, values in given.items()
        if name in found
        for p in get_effect(name).parameters
        if p.linear and not p.listed and not p.whole_turn and p.name in values
    ]
    return [0.0, *(abs(math.log(now / was)) if now * was > 0.0 else math.inf for was, now in sizes if was)]


def _of_position(effect_id: str) -> bool:
    """Whether the effect is a force that depends on the position alone: without its zero, one passes for another."""
    effect = get_effect(effect_id)
    return effect.role is Role.APPLIED and tuple(effect.needs) == ("position",)


def probabilities(search: Search, rest: Fit, options: list[Option]) -> dict[str, float]:
    """Probability of each option, and of none of them (`NOTHING`): by what the best of them gains over each beyond what
    the same columns explain by chance of noise as coloured as what it leaves."""
    fits = (rest, *(o.fit for o in options))
    gains = np.stack([np.zeros(len(rest.losses)), *(search.gains(rest, o.fit) for o in options)])
    best = max(range(len(fits)), key=lambda i: search.evidence(fits[i]))
    chances = np.array([search.by_chance(fit, fits[best]) for fit in fits])
    gains = gains[best] - (gains[best] - gains) / chances[:, None]
    prices = np.array([0.0, *(search.price(o.fit.terms) - search.price(rest.terms) for o in options)])
    shares = shared_belief(gains, prices)
    return dict(zip((NOTHING, *(o.effect for o in options)), shares.tolist(), strict=True))


def surest_of(search: Search, whole: Fit, limits: Limits) -> float:
    """Upper bound on any probability: by the number of independent equations, and by the log itself. Every effect was
    chosen among many, beside every other, and so was none: with few equations many effects explain any moves."""
    rows, size = search.problem.blocks.rows, max(_size(search, whole), 1)
    most = rows / (rows + POLICY.rows_of_a_choice * size**2)
    surest = POLICY.even if pushes_leave_more(search, whole) else POLICY.surest
    return min(surest, most, limits.surest)


def _size(search: Search, whole: Fit) -> int:
    """How much of the set was chosen: effects, those of it that the climb has taken among them, and each shape that was
    searched with them; each push is one of its own."""
    chosen = [t for t in search.base if t not in search.problem.before] + list(search.added(whole.terms))
    return sum(len(t.shape["edges"]) if t.effect.listed else 1 + t.effect.searched for t in chosen)


def missing_of(members: Mapping[str, Membership], surest: float, said: Mapping[str, float]) -> tuple[Missing, ...]:
    """The effects of the set that was found, the surest first. surest : no probability is higher, for this log.
    said : effect -> probability of the verdict."""
    beliefs = [(m, m.belief(name)) for name, m in members.items()]
    found = [Missing(m.effect, said.get(m.effect, probability_of(m, b, surest))) for m, b in beliefs]
    return tuple(sorted(found, key=lambda one: -one.probability))


def probability_of(member: Membership, belief: float, surest: float) -> float:
    """That an effect is missing. belief : in it, against every other in its place. surest : as in `missing_of`."""
    return min(belief * member.there, surest, member.surest)


def perhaps_missing(search: Search, whole: Fit, limits: Limits) -> tuple[Missing, ...]:
    """The effect beside a set that is of use and rather there than not, but gains too little to be certain: of moves at
    one speed viscous friction is all but dry friction. Of many shapes one is of use by chance, more by few moves."""
    useful = [o for o in search.options(whole) if search.practical(whole, o.fit) and not get_effect(o.effect).searched]
    likely = probabilities(search, whole, useful) if useful else {}
    open_ = [o for o in useful if min(likely[o.effect], surest_of(search, o.fit, limits)) >= POLICY.even]
    return tuple(Missing(o.effect, POLICY.even) for o in open_ if search.lead(whole, o.fit) < POLICY.least_gain)


def hidden_in_friction(search: Search, whole: Fit, members: Mapping[str, Membership]) -> tuple[Missing, ...]:
    """The load that may be a part of a dry friction, for all that moves one way and rests show."""
    return tuple(Missing(n, members[DRY].drawn(n)) for n in search.left_open(whole)) if DRY in members else ()


def left_over(search: Search, whole: Fit, beyond: Discrepancy) -> float:
    """Probability that what a set leaves is a force that no effect describes; with even odds, where it may be noise."""
    louder, all_of_it = beyond_noise(search, whole), force_beyond(search, whole, beyond)
    return max(POLICY.surest_in_doubt * _force(search, louder), POLICY.even * _force(search, all_of_it))


def nothing_missing(search: Search, options: Sequence[Option], beyond: Discrepancy) -> float:
    """Probability that nothing is missing: effects of a practical size that no block confirms have half at most, as
    what is left at stops and in creeping has, where nothing is sure, and what a function takes off for certain.

    An effect that cannot be tested keeps the odds of its price; one that another path explains as well, even ones.
    """
    useful = [o for o in options if search.practical(search.refit, o.fit)]
    prior, untestable = math.exp(-POLICY.effect_price), search.problem.untestable.values()
    untested = sum(1.0 if why == LOOKS_THE_SAME else prior for why in untestable)
    rmse, noise = search.problem.errors.rmse(search.refit), POLICY.floor_factor * search.problem.floor
    squares = max(rmse**2 - noise**2, force_beyond(search, search.refit, beyond, POLICY.floor_factor) ** 2)
    left = 0.0 if noise_of_u(search, search.refit) else _force(search, math.sqrt(squares))
    likely = 0.5 + 0.5 * probabilities(search, search.refit, useful)[NOTHING]
    return likely * (1.0 - POLICY.even * left) / (1.0 + untested)


def _force(search: Search, left: float) -> float:
    """Probability that an rms beyond the noise, unit of u, is a force: its power over that and the power of what no
    model of an axis says better."""
    return left**2 / max(left**2 + (POLICY.least_unknown * search.problem.errors.force) ** 2, 1e-300)


def unexplained_of(search: Search, whole: Fit, beyond: Discrepancy, more: float = 0.0) -> Unexplained:
    """What a set leaves. more : probability that more is missing, at the least. Where neither a function of channels
    nor its size says that something is, what is beyond `floor_factor` times the noise, or certain, has even odds."""
    share = force_beyond(search, whole, beyond) / max(search.problem.errors.force, 1e-300)
    likely = POLICY.even * _force(search, force_beyond(search, whole, beyond, POLICY.floor_factor))
    if beyond.unknown or above_floor(search, whole):
        likely = left_over(search, whole, beyond)
    on = beyond.on if beyond.unknown or beyond.certain else ()
    return Unexplained(share, max(likely, more, 1.0 - POLICY.surest), on)


def lowering_together(search: Search, whole: Fit, before: float) -> set[str]:
    """Effects without which a set that lowers the held-out error of the values that would be written, `before`, leaves
    more: a dead zone of the model takes up Coulomb friction, until viscous friction is there as well."""
    added, left = search.added(whole.terms), search.problem.score(whole).heldout_rmse
    if len(added) < 2 or not left < before or weightless(search, whole):
        return set()
    return {t.id for t in added if left < search.problem.score(search.without(whole, t)).heldout_rmse}
