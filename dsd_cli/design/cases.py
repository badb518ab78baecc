"""Which inner products are asked for: each likely plant of an explanation, under each form of its rivals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from dsd_cli.design.explanations import Explanation
from dsd_cli.design.limits import Limits
from dsd_cli.design.rows import Model
from dsd_cli.design.targets import Targets
from dsd_cli.effects import Ranges, get_effect
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.search.sets import Search

#: Other shapes that a rival may take.
_MOST_SHAPES = 4


@dataclass(frozen=True)
class Case:
    """Inner products that are asked for: plant number `draw` of an explanation, under the effects of another."""

    truth: int
    draw: int
    rival: int
    model: Model


@dataclass(frozen=True)
class Expected:
    """nats : (truth, rival) -> lead of the truth, by the places of explanations. of_use : its power over the least one
    that is of use: below 1 the two explain the same, however many nats there are. errors : of values, by name. ranges :
    of nats, the least and the most of the plants that were simulated."""

    nats: Mapping[tuple[int, int], float]
    of_use: Mapping[tuple[int, int], float]
    errors: Mapping[str, float]
    ranges: Mapping[tuple[int, int], tuple[float, float]] = field(default_factory=dict)


def cases_of(search: Search, targets: Targets, draws: int, ranges: Ranges) -> list[Case]:
    """Of all pairs in both directions, and of the truth under itself; the first explanation in any case.

    ranges : what logs and motion together may contain.
    """
    explanations, ids = targets.explanations, [{t.id for t in e.fit.terms} for e in targets.explanations]
    # a rival that has all effects of the truth explains any motion as well, and only its price decides
    pairs = {(a, b) for pair in targets.pairs for a, b in (pair, pair[::-1]) if not ids[a] <= ids[b]}
    pairs |= {(a, a) for p in pairs for a in p} | {(0, 0)}
    shapes = [_shapes(search, e, ranges) for e in explanations]
    return [
        Case(a, d, b, model)
        for a, b in sorted(pairs)
        for d in range(min(draws, len(explanations[a].draws)))
        for model in (shapes[b] if a != b else (explanations[b].model,))
    ]


def _shapes(search: Search, rival: Explanation, ranges: Ranges) -> tuple[Model, ...]:
    """Of a rival: as fitted, and its added effects at other starting shapes."""
    found = [rival.model]
    for term in search.added(rival.fit.terms):
        for other in other_shapes(term, ranges):
            terms = tuple(other if t == term else t for t in rival.fit.terms)
            found.append(replace(rival.model, terms=terms))
    return tuple(found)


def other_shapes(term: Term, ranges: Ranges) -> list[Term]:
    """The effect at a few of the starting shapes that a search over such ranges begins with, from end to end."""
    if not term.effect.searched or term.effect.listed:
        return []
    starts = get_effect(term.id).starts(ranges)
    places = np.unique(np.linspace(0, len(starts) - 1, min(_MOST_SHAPES, len(starts))).round().astype(int))
    return [Term.of(term.id, starts[i]) for i in places]


def ranges_within(found: Ranges, limits: Limits) -> Ranges:
    """What logs contain, and a motion that goes as far as the limits."""
    return found._replace(
        top_speed=max(found.top_speed, limits.velocity),
        travel=max(found.travel, limits.high - limits.low),
        top_drive=max(found.top_drive, limits.u),
    )
