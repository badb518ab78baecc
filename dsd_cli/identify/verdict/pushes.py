"""Pushes in time: looked for in what a set leaves and in place of the set, and taken where no law makes them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit.bank import Term
from dsd_cli.identify.fit.row_weights import residual_of_u
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.pulses import event_effect, sharpened, with_pulses
from dsd_cli.identify.search.sets import Search
from dsd_cli.identify.verdict.discrepancy import Discrepancy, above_floor, discrepancy_of, surely_left
from dsd_cli.signals.log import Array

#: Bins of the travel, equally often visited, and delays of the pushes against the motion that chance is judged by.
_BINS, _DELAYS = 20, 200
#: Single laws, those with most evidence, beside which pushes are looked for.
_LAWS = 3
#: Levels that two pushes have, one on top of the other; more without a pause are a force that changes in time.
_ON_TOP = 3


def pushed(search: Search, whole: Fit, beyond: Discrepancy) -> tuple[Fit, Discrepancy]:
    """With pulses in time if nothing unknown remains beside them; otherwise unchanged; strong pulses mean unknown.

    One push in a long log hardly shows in a spectrum or in a function of time, so they are looked for in any case.
    """
    if event_effect(search) is None:
        return whole, beyond
    if (alone := _pushes_alone(search, whole, beyond)) is not None:
        return alone
    pulses = with_pulses(search, whole)
    if pulses is None or not search.practical(whole, pulses):
        return whole, beyond
    rmse = search.problem.errors.rmse
    loud = rmse(pulses) < (1.0 - POLICY.clear_fall) * rmse(whole)
    if not (loud or beyond.unknown):
        return whole, beyond
    settled = _placed_again(search, search.settled(sharpened(search, pulses)))
    if above_floor(search, settled):  # a law that was hidden behind the pushes blurs their edges
        settled = _placed_again(search, search.run(settled))
    then, law = discrepancy_of(search, settled), law_of_pushes(search, settled)
    better = search.lead(whole, settled) > POLICY.least_gain and search.practical(whole, settled)
    a_law = beyond.on and "time" not in beyond.on and beyond.heldout_rmse < rmse(settled)
    if better and not then.unknown and not a_law and not law:
        return settled, then  # a function of motion or u that explains more than pushes is a law
    told_better = law and rmse(settled) < beyond.heldout_rmse
    if beyond.unknown and not told_better:
        return whole, beyond
    least = min(beyond.heldout_rmse, rmse(settled if law else pulses))
    return whole, replace(beyond, unknown=True, on=(law or "time",), heldout_rmse=least)


def _placed_again(search: Search, settled: Fit) -> Fit:
    """Pushes beside the laws of a set, their places looked for anew: without what imitated them the edges are clear."""
    pulses = with_pulses(search, settled)
    if pulses is None:
        return settled
    again = search.settled(sharpened(search, pulses))
    return again if search.evidence(again) > search.evidence(settled) else settled


def _pushes_alone(search: Search, whole: Fit, beyond: Discrepancy) -> tuple[Fit, Discrepancy] | None:
    """A few pushes in place of all that was found, where they explain more and leave no more than the sensor does: two
    lines in time and a cogging make three pushes of a short log, and leave nothing of them to see. Where more than the
    sensor's noise is left, beside one law, too: it hides the pushes, and they it; and in what all functions of the
    motion leave of u: a push that lasts is most of that, and in the motion by u neither shows without the other.

    Pushes can also stand in for laws that no catalogue has (a brake, an end stop); these leave 5 to 50 times the floor.
    """
    tried = [with_pulses(search, search.refit)] if search.added(whole.terms) else []
    if beyond.unknown or above_floor(search, whole):
        motion, bank = search.fit(search.problem.beside, search.refit.tap), search.problem.errors.bank
        tried.append(with_pulses(search, motion, residual_of_u(motion, bank) * search.equations.kept))
        laws = [o.fit for o in search.options(search.refit) if get_effect(o.effect).role is not Role.STRUCTURE]
        tried += [with_pulses(search, fit) for fit in laws[:_LAWS]]
    likely = [p for p in tried if p is not None and not _hopeless(search, p, whole)]
    if not likely:
        return None
    found = max((search.settled(sharpened(search, p)) for p in likely), key=search.evidence)
    if len(search.added(found.terms)) > 1:
        found = _placed_again(search, found)
    if surely_left(search, found) > POLICY.floor_factor * search.problem.floor:
        return None
    if search.lead(whole, found) < POLICY.least_gain or law_of_pushes(search, found):
        return None
    then = discrepancy_of(search, found)
    return None if then.unknown and not beyond.unknown else (found, then)


def _hopeless(search: Search, pulses: Fit, whole: Fit) -> bool:
    """Whether pushes leave more than a set wherever their edges are: moved to their places, they take off no more than
    a row of each edge holds. Sharpening them costs a hundred fits, of a long log seconds."""
    levels = pulses.coefficients(next(t for t in pulses.terms if t.effect.listed))
    rmse, rows = search.problem.errors.rmse, int(search.equations.kept.sum())
    return rows * (rmse(pulses) ** 2 - rmse(whole) ** 2) > 2.0 * float(levels @ levels)


def pushes_leave_more(search: Search, whole: Fit) -> bool:
    """Whether pushes, found or in the model, leave more than the sensor does: they fit a part of any law."""
    least = POLICY.floor_factor * search.problem.floor
    return any(t.effect.listed for t in whole.terms) and surely_left(search, whole) > least


def law_of_pushes(search: Search, fit: Fit) -> str:
    """What the pushes of a fit are a function of, "position" or "time" (they follow each other without a pause); ""
    where they come as pushes do."""
    event = next((t for t in fit.terms if t.effect.listed), None)
    if event is None:
        return ""
    equations, edges = search.equations, event.shape["edges"]
    if any(len(levels) > _ON_TOP for levels in _runs(search, fit, event)):
        return "time"
    times = equations.of_rows([s.frame.times for s in equations.stretches])
    force = np.zeros(len(times))
    for (a, b), level in zip(edges, fit.coefficients(event), strict=True):
        force[(times >= a) & (times <= b)] += level
    place = equations.of_rows([s.mean.position for s in equations.stretches])
    return "position" if len(edges) > 1 and _of_place(force, place) else ""


def _runs(search: Search, fit: Fit, event: Term) -> list[list[float]]:
    """Levels of pushes that follow each other without a pause; slivers at an edge, of little impulse, do not count."""
    edges, levels = event.shape["edges"], fit.coefficients(event).tolist()
    impulses = [abs(level) * (b - a) for (a, b), level in zip(edges, levels, strict=True)]
    pause = POLICY.shortest_pulse * search.equations.band.step * search.equations.sample_time
    runs: list[list[float]] = []
    ended = -math.inf
    for (a, b), level, impulse in zip(edges, levels, impulses, strict=True):
        if impulse > POLICY.weakest_pulse * max(impulses):
            if a - ended > pause:
                runs.append([])
            runs[-1].append(level)
            ended = b
    return runs


def _of_place(force: Array, place: Array) -> bool:
    """Whether a force is explained by the position, and better than if it came at any other time."""
    if not np.ptp(force) > 0.0:
        return False
    shares = [_told_by(np.roll(force, round(k * len(force) / _DELAYS)), place) for k in range(_DELAYS)]
    as_well = sum(x >= shares[0] for x in shares[1:])
    return shares[0] > POLICY.of_place and as_well <= (1.0 - POLICY.surest) * (_DELAYS - 1)


def _told_by(force: Array, place: Array) -> float:
    """Share of a force's variance that its means over bins of the position hold."""
    bins = np.argsort(np.argsort(place)) * _BINS // len(place)
    count = np.maximum(np.bincount(bins, minlength=_BINS), 1)
    means = np.bincount(bins, force - force.mean(), minlength=_BINS) / count
    return float(count @ means**2 / (len(force) * np.var(force)))
