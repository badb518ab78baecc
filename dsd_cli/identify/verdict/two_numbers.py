"""What is missing, and is that all? Two questions that are answered apart, each with a probability of its own.

How sure a name is follows from three things by one rule, the same for the verdict and for every member of the set: the
belief in it against every effect in its place, what it takes off against what all that was found leaves beyond the
sensor's noise, for an effect that stands in for another leaves a good part of that, and how many independent equations
there are for a set of that size. docs/how/identify.md has the diagram that its two numbers were read from.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.missing import Missing, Unexplained
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.discrepancy import Discrepancy, above_floor, surely_left
from dsd_cli.identify.verdict.evidence import Membership
from dsd_cli.identify.verdict.limits import Limits
from dsd_cli.identify.verdict.pushes import pushes_leave_more

#: Probability from which on an effect is rather there than not.
EVEN = 0.5


def surest_of(search: Search, whole: Fit, limits: Limits) -> float:
    """Upper bound on any probability: by the number of independent equations, and by the log itself. Every effect was
    chosen among many, beside every other: with few equations many effects explain any moves. And where none was found,
    few equations show little."""
    rows, size = search.problem.blocks.rows, _size(search, whole)
    most = rows / (rows + POLICY.rows_of_a_choice * size**2)
    if not size and rows < POLICY.few_rows:
        most = POLICY.surest_in_part
    very_few = size > 1 and rows < POLICY.least_rows_per_effect * size
    doubtful = very_few or pushes_leave_more(search, whole)
    return min(POLICY.surest_untold if doubtful else POLICY.surest, most, limits.surest)


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


def unexplained_of(search: Search, whole: Fit, beyond: Discrepancy, nothing: float) -> Unexplained:
    """What a set leaves. nothing : probability that nothing is missing beside it, where neither a function of the
    channels nor the sensor's floor says that something is."""
    share = _left(search, whole) / max(search.problem.errors.force, 1e-300)
    if beyond.unknown:
        return Unexplained(share, 0.9, beyond.on)
    return Unexplained(share, 0.6 if above_floor(search, whole) else 1.0 - nothing)


def _left(search: Search, fit: Fit) -> float:
    """rms beyond the sensor's noise, unit of u."""
    return math.sqrt(max(surely_left(search, fit) ** 2 - search.problem.floor**2, 0.0))
