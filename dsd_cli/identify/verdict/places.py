"""Whether laws of the position hold at places where they were not fitted: one half of the travel from the other.

Held-out blocks of time hold no place that a fit has not seen, so that a weight, a spring and some sines together pass
for any smooth force of the position, such as that of a cable chain. Fitted in one half of the travel, a law predicts
the other; what only interpolates does not.
"""

from __future__ import annotations

import numpy as np

from dsd_cli.effects import Effect, Role
from dsd_cli.identify.fit.blocks import solve, total_gram
from dsd_cli.identify.fit.freeform import FreeformFits
from dsd_cli.identify.fit.row_weights import clear_rows
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import Array

PLACE = "position"


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
    part = search.excerpt or search
    fit = fit if part is search else part.fit(fit.terms, fit.tap)
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
    kept, sure = equations.kept > 0.0, clear_rows(equations)
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
