"""What is missing, and is that all? Two questions that are answered apart, each with a probability of its own.

An effect may stand in for something unknown only as far as that is as large as the effect itself: what it takes off the
held-out error bounds its probability, against what all that was found leaves beyond the sensor's noise.
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


def surest_of(search: Search, whole: Fit, limits: Limits) -> float:
    """Upper bound on any probability: by the number of independent equations for each effect, and by the log itself."""
    rows, size = search.problem.blocks.rows, _size(search, whole)
    few = rows < max(POLICY.few_rows, POLICY.rows_per_effect * size)
    most = POLICY.surest_in_part if few else POLICY.surest
    very_few = size > 1 and rows < POLICY.least_rows_per_effect * size
    doubtful = very_few or pushes_leave_more(search, whole)
    return min(POLICY.surest_untold if doubtful else most, limits.surest)


def _size(search: Search, whole: Fit) -> int:
    """Number of effects that were found; beside laws each push is one of its own."""
    found = search.added(whole.terms)
    laws = [t for t in found if not t.effect.listed]
    pushes = sum(len(t.shape["edges"]) for t in found if t.effect.listed)
    return len(laws) + pushes if laws else min(pushes, 1)


def missing_of(search: Search, whole: Fit, members: Mapping[str, Membership], surest: float) -> tuple[Missing, ...]:
    """The effects of the set that was found, the surest first. surest : no probability is higher, for this log."""
    found = []
    for name, member in members.items():
        belief = member.probabilities.get(name, 0.0) / (1.0 + len(member.rivals))
        found.append(Missing(name, min(belief * _share_told(search, whole, name), surest, member.surest)))
    return tuple(sorted(found, key=lambda one: -one.probability))


def _share_told(search: Search, whole: Fit, name: str) -> float:
    """Power that an effect takes off beside the others, over that and what is left beyond the sensor's noise."""
    rest = search.fit(tuple(t for t in whole.terms if t.id != name), whole.tap)
    rmse = search.problem.errors.rmse
    own = max(rmse(rest) ** 2 - rmse(whole) ** 2, 0.0)
    return own / max(own + _left(search, whole) ** 2, 1e-300)


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
