"""Effects that stand in for a gain of u, or an inertia, that varies with the position, the speed or the time."""

from __future__ import annotations

import math
from typing import NamedTuple

from dsd_cli.identify.fit.bank import Terms
from dsd_cli.identify.fit.freeform import GAIN, Freeform, FreeformFits, freeform_fits
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.discrepancy import Discrepancy


class _Law(NamedTuple):
    """u g(x): what x is, the effects that are still needed beside it, the loss that both leave where it is held out."""

    on: tuple[str, ...]
    terms: Terms
    loss: float


def without_imitations(search: Search, whole: Fit, beyond: Discrepancy) -> tuple[Fit, Discrepancy]:
    """A set that was found and what is beyond it, without the effects that nobody needs beside a varying gain.

    Together with that gain the others must leave less than the whole set did: an arm whose inertia follows its angle
    looks like a weight and a constant load, but not so well.
    """
    part = search.excerpt or search
    fit = whole if part is search else part.fit(whole.terms, whole.tap)
    if not part.added(fit.terms):
        return whole, beyond
    beside = _fits(part, fit)
    found = (_law(part, fit, beside.fit_with(group)) for group in beside.groups() if group[0] == GAIN)
    laws = [law for law in found if law is not None]
    if not laws:
        return whole, beyond
    best = min(laws, key=lambda law: law.loss)
    rest = search.fit(best.terms, whole.tap)
    plain, left = search.problem.errors.rmse(rest), _left(part, fit.tap, best)
    if left > (1.0 - POLICY.unknown_fall) * search.problem.errors.rmse(whole):
        return whole, beyond
    return rest, Discrepancy(best.on, min(left, plain), True, beyond.noise)


def _law(search: Search, whole: Fit, beside: Freeform) -> _Law | None:
    """`beside` : that gain beside the whole set. None where it explains nothing there, or needs all of it."""
    on, nats = beside.on, search.noise.nats
    if beside.gain < POLICY.unknown_nats * nats:
        return None
    terms, loss = whole.terms, beside.loss
    for term in reversed(search.added(whole.terms)):
        rest = tuple(t for t in terms if t != term)
        without = _fits(search, search.solver.fit(rest, whole.tap)).fit_with(on).loss
        if without - loss < (search.price((term,)) + POLICY.least_gain) * nats:
            terms, loss = rest, without
    better = loss < float(beside.without.sum()) - POLICY.unknown_nats * nats
    return _Law(on, terms, loss) if better and terms != whole.terms else None


def _left(search: Search, tap: int, law: _Law) -> float:
    """Held-out rms that a law leaves beside its effects, unit of u."""
    fit = search.solver.fit(law.terms, tap)
    fall = _fits(search, fit).fit_with(law.on, whitened=False).gain / max(int(search.equations.kept.sum()), 1)
    return math.sqrt(max(search.problem.errors.rmse(fit) ** 2 - fall, 0.0))


def _fits(search: Search, fit: Fit) -> FreeformFits:
    problem = search.problem
    return freeform_fits(problem.errors.bank, search.equations, problem.blocks, fit, search.solver.inertia)
