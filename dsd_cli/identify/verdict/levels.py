"""What is said of levels that differ between logs, and of effects in whose place such levels would do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from dsd_cli.effects import get_effect
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.blocks import grams, losses, solve
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import Deviations, may_differ
from dsd_cli.identify.results import Diagnosis, Estimate, Estimates, LogLevels
from dsd_cli.identify.search.levels import Levelled, by_log, varying
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.contradictions import no_surer

#: Of a deviation: from so many means on it is no share of the mean, from so many % on without decimals.
_MOST_MEANS, _WHOLE_PERCENT = 10.0, 10.0


def with_levels_said(found: Diagnosis, search: Search, whole: Fit, levelled: Levelled) -> Diagnosis:
    """A diagnosis with the levels beside which it was made; its error as given is that of one model for all logs."""
    found = _with_stand_ins(found, stand_ins(search, whole))
    if not levelled.levels:
        return found
    levels = log_levels(levelled.levels, search.problem.values(whole).estimates, found.logs)
    score = search.problem.errors_for(found.given, levelled.plain).of_model(found.given)
    if search.problem.holdout:
        score = replace(score, heldout_rmse=found.score.heldout_rmse)
    return replace(found, score=score, levels=levels, warnings=(*found.warnings, *said_of(levels)))


def log_levels(deviations: Sequence[Deviations], values: Estimates, logs: Sequence[str]) -> tuple[LogLevels, ...]:
    """The level of each log, out of the mean that was fitted; 0 where the model has no such effect."""
    return tuple(_log_levels(one, values.get(one.name), tuple(logs)) for one in deviations)


def _log_levels(one: Deviations, fitted: Estimate | None, logs: tuple[str, ...]) -> LogLevels:
    unit = get_effect(one.effect).parameter(one.parameter).unit
    mean = fitted or Estimate(0.0, 0.0, unit)
    own = mean.std_error if math.isfinite(mean.std_error) else 0.0
    values = (Estimate(mean.value + d, math.hypot(own, s), unit) for d, s in zip(one.by_log, one.errors, strict=True))
    return LogLevels(one, mean.value, logs, tuple(values))


def said_of(levels: Sequence[LogLevels]) -> tuple[str, ...]:
    """A sentence for each log and each value that differs there."""
    found = []
    for one in levels:
        by = one.deviations
        for log, value, d, s in zip(one.logs, one.values, by.by_log, by.errors, strict=True):
            if abs(d) > POLICY.value_deviations * s:
                found.append(
                    f"{log}: {by.name} is {value.value:.4g} +- {value.std_error:.2g} here, {_away(d, one.mean)} the"
                    f" mean of the logs, {one.mean:.4g}"
                )
    return tuple(found)


def _away(deviation: float, mean: float) -> str:
    """How far from the mean: as a share of it where that says more."""
    if abs(deviation) > _MOST_MEANS * abs(mean):
        return f"{deviation:+.4g} off"
    share = 100.0 * abs(deviation / mean)
    return (
        f"{share:{'.0f' if share >= _WHOLE_PERCENT else '.2g'}} % {'more' if deviation * mean > 0.0 else 'less'} than"
    )


def stand_ins(search: Search, whole: Fit) -> dict[str, tuple[str, ...]]:
    """Found effects in whose place levels that differ between the logs would explain as much -> the effects of those.

    A force seen at one place in each log, and not between, may be a function of the place or a level of each log.
    """
    problem = search.problem
    if not may_differ(problem.recordings):
        return {}
    most = -_loss(search, whole, []) - search.price(whole.terms)
    found = {}
    for member in search.added(whole.terms):
        if member.effect.coupling is not None and search.equations.counting < 1.0:
            continue  # rows that count have no load in them
        rest = search.without(whole, member)
        tried = {names: _evidence(search, rest, names) for names in _groups(search, rest, member)}
        best = max(tried, key=lambda names: tried[names], default=())
        if best and tried[best] > most - POLICY.least_gain:
            found[member.id] = best
    return found


def _groups(search: Search, rest: Fit, member: Term) -> list[tuple[str, ...]]:
    """Sets of effects whose values may differ between logs."""
    keys = [key for key, _ in varying(search, rest, search.problem.errors.bank)]
    names = [name for name in dict.fromkeys(key[0] for key in keys) if name != member.id]
    return [group for size in range(1, len(names) + 1) for group in combinations(names, size)]


def _evidence(search: Search, rest: Fit, names: Sequence[str]) -> float:
    """Nats of a fit with a level per log of these effects."""
    bank, logs = search.problem.errors.bank, search.equations.logs_of_rows
    there, columns, price = {t.id for t in rest.terms}, [], search.price(rest.terms)
    for (name, _, _), column in varying(search, rest, bank):
        made = by_log(column, logs) if name in names else []
        if made:
            columns += made if name in there else [column, *made]
            price += POLICY.effect_price * (len(made) + (name not in there))
    return -_loss(search, rest, columns) - price


def _loss(search: Search, fit: Fit, columns: Sequence[np.ndarray]) -> float:
    """Held-out squares of a fit with more columns, nats."""
    blocks, rows = search.problem.blocks, (*search.freeform(fit).base, *columns)
    found = grams([search.equations.whitened(x) for x in rows], blocks)
    return float(losses(solve(found.fitted), found, blocks).sum()) / search.noise.nats


def _with_stand_ins(found: Diagnosis, rivals: dict[str, tuple[str, ...]]) -> Diagnosis:
    """An effect in whose place levels would do is named with them, and no surer than one that has no value."""
    named = {name: effects for name, effects in rivals.items() if name in found.found}
    if not named:
        return found
    ranking = tuple(
        replace(c, indistinguishable_from=tuple(dict.fromkeys((*c.indistinguishable_from, *named.get(c.effect, ())))))
        for c in found.ranking
    )
    said = tuple(
        f"{name} may stand in for levels of {' and '.join(effects)} that differ between the logs: free in each log,"
        " they explain as much; logs that go over the same travel at the same speeds would show which"
        for name, effects in named.items()
    )
    return no_surer(replace(found, ranking=ranking, warnings=(*found.warnings, *said)), POLICY.even, named)
