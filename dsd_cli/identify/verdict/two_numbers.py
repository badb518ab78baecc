"""What is missing, and is that all? Two questions that are answered apart, each with a probability of its own.

How sure a name is follows from three things by one rule, the same for the verdict and for every member of the set: the
belief in it against every effect in its place, what it takes off against what all that was found leaves beyond the
sensor's noise, for an effect that stands in for another leaves a good part of that, and how many independent equations
there are for a set of that size. docs/how/identify.md has the diagram that its two numbers were read from.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.missing import Missing, Unexplained
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.drift_search import LOOKS_THE_SAME
from dsd_cli.identify.search.sets import Option, Search
from dsd_cli.identify.verdict.discrepancy import Discrepancy, above_floor, surely_left
from dsd_cli.identify.verdict.evidence import NOTHING, Membership, probabilities
from dsd_cli.identify.verdict.limits import Limits
from dsd_cli.identify.verdict.pushes import pushes_leave_more


def surest_of(search: Search, whole: Fit, limits: Limits) -> float:
    """Upper bound on any probability: by the number of independent equations, and by the log itself. Every effect was
    chosen among many, beside every other, and so was none: with few equations many effects explain any moves."""
    rows, size = search.problem.blocks.rows, max(_size(search, whole), 1)
    most = rows / (rows + POLICY.rows_of_a_choice * size**2)
    surest = POLICY.even if pushes_leave_more(search, whole) else POLICY.surest
    return min(surest, most, limits.surest)


def _size(search: Search, whole: Fit) -> int:
    """Number of effects that were found; each push is one of its own."""
    return sum(len(t.shape["edges"]) if t.effect.listed else 1 for t in search.added(whole.terms))


def missing_of(search: Search, whole: Fit, members: Mapping[str, Membership], surest: float) -> tuple[Missing, ...]:
    """The effects of the set that was found, the surest first. surest : no probability is higher, for this log."""
    found = [
        Missing(name, probability_of(search, whole, member, member.probabilities.get(name, 0.0), surest))
        for name, member in members.items()
    ]
    return tuple(sorted(found, key=lambda one: -one.probability))


def probability_of(search: Search, whole: Fit, member: Membership, belief: float, surest: float) -> float:
    """That an effect is missing. belief : in it, against every other in its place. surest : as in `missing_of`."""
    return min(belief * _no_stand_in(search, whole, member.effect), surest, member.surest)


def _no_stand_in(search: Search, whole: Fit, name: str) -> float:
    """Power that an effect takes off beside the others, over that and what a stand-in that leaves as much would."""
    rest = search.fit(tuple(t for t in whole.terms if t.id != name), whole.tap)
    rmse = search.problem.errors.rmse
    own = max(rmse(rest) ** 2 - rmse(whole) ** 2, 0.0)
    return own / max(own + (POLICY.stands_in * _left(search, whole)) ** 2, 1e-300)


def left_over(search: Search, whole: Fit) -> float:
    """Probability that what a set leaves is a force that no effect describes."""
    return POLICY.surest_unknown * _force(search, _left(search, whole))


def nothing_missing(search: Search, options: Sequence[Option]) -> float:
    """Probability that nothing is missing: effects of a practical size that no block confirms have half at most, as
    what is left at stops and in creeping has, where nothing is sure.

    An effect that cannot be tested keeps the odds that its price says; one that another path explains as well, even
    ones.
    """
    useful = [o for o in options if search.practical(search.refit, o.fit)]
    prior, untestable = math.exp(-POLICY.effect_price), search.problem.untestable.values()
    untested = sum(1.0 if why == LOOKS_THE_SAME else prior for why in untestable)
    rmse, noise = search.problem.errors.rmse(search.refit), POLICY.floor_factor * search.problem.floor
    left = _force(search, math.sqrt(max(rmse**2 - noise**2, 0.0)))
    likely = 0.5 + 0.5 * probabilities(search, search.refit, useful)[NOTHING]
    return likely * (1.0 - POLICY.even * left) / (1.0 + untested)


def _force(search: Search, left: float) -> float:
    """Probability that an rms beyond the noise, unit of u, is a force: its power over that and the power of what no
    model of an axis says better."""
    return left**2 / max(left**2 + (POLICY.least_unknown * search.problem.errors.force) ** 2, 1e-300)


def unexplained_of(search: Search, whole: Fit, beyond: Discrepancy, nothing: float) -> Unexplained:
    """What a set leaves. nothing : probability that nothing is missing beside it, where neither a function of the
    channels nor the sensor's floor says that something is."""
    share, on = _left(search, whole) / max(search.problem.errors.force, 1e-300), beyond.on if beyond.unknown else ()
    left = beyond.unknown or above_floor(search, whole)
    return Unexplained(share, left_over(search, whole) if left else 1.0 - nothing, on)


def _left(search: Search, fit: Fit) -> float:
    """rms beyond the sensor's noise, unit of u."""
    return math.sqrt(max(surely_left(search, fit) ** 2 - search.problem.floor**2, 0.0))
