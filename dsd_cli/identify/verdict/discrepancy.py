"""Whether something is left that no effect explains, or effects stand in for a gain of u that varies."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.effects import get_effect
from dsd_cli.identify.fit.band import structured_share
from dsd_cli.identify.fit.bank import Terms
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.freeform import GAIN, Freeform, FreeformFits
from dsd_cli.identify.fit.row_weights import many_sure, surely_less
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.sets import Option, Search
from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class Discrepancy:
    """What a fit leaves: the best free-form function of it, `certain` if no noise is so; plain : its own rmse."""

    on: tuple[str, ...]
    heldout_rmse: float
    unknown: bool
    noise: float
    plain: float
    certain: bool = False

    @property
    def of_gain(self) -> bool:
        """Whether it is u times something."""
        return GAIN in self.on

    @property
    def least(self) -> float:
        """rms that is left by whatever explains what is unknown, or little but certain: no function leaves less."""
        return min(self.heldout_rmse, self.noise) if self.unknown else self.heldout_rmse if self.certain else self.plain

    def of_channels(self, name: str) -> bool:
        """Whether it depends on channels of an effect, which then may stand in for another law of them."""
        return self.unknown and not {*self.on}.isdisjoint(get_effect(name).needs or ("time",))


def discrepancy_of(search: Search, fit: Fit) -> Discrepancy:
    """Free-form functions beside a fit, and the spectrum of what it leaves.

    Where there is an excerpt, functions of motion and u are tried on it, functions of time on all rows.
    """
    if search.excerpt is None:
        return _beyond(search, fit, lambda _: True)
    part, over_time = search.excerpt, _beyond(search, fit, lambda group: group == ("time",))
    there = _beyond(part, part.fit(fit.terms, fit.tap), lambda group: group != ("time",))
    first = there if there.unknown or not over_time.unknown else over_time
    return replace(first, unknown=over_time.unknown or there.unknown)


def before_climb(search: Search, whole: Fit, beyond: Discrepancy, asked: Settings, name: str) -> Fit:
    """What the share that a set explains is of: the model with its own values fitted; for an effect of the set that
    answered the last rung, the model without what the climb took of that set: half of it is as sure as it was.

    Not where a function of its own channels explains what is left, for then it stands in for another law of them.
    """
    goes_on = asked.begun is not None and name in asked.begun.effects and not beyond.of_channels(name)
    return search.fit(search.problem.before, whole.tap) if goes_on else search.refit


def _structured(equations: Equations, residual: Array) -> float:
    """Of all recordings: each has its own band. See `structured_share`."""
    parts = zip(equations.by_recording(residual), equations.bands, strict=True)
    shares = [structured_share(left, band) for left, band in parts]
    powers = np.bincount(equations.logs_of_rows, residual**2, len(shares))
    return float(powers @ shares) / max(float(powers.sum()), 1e-300)


def _beyond(search: Search, fit: Fit, asked: Callable[[tuple[str, ...]], bool]) -> Discrepancy:
    errors, fits = search.problem.errors, search.freeform(fit)
    plain = errors.rmse(fit)
    share = _structured(search.equations, errors.residual(fit, held_out=False))
    noise = plain * math.sqrt(1.0 - share)
    groups = sorted((fits.fit_with(group) for group in fits.groups() if asked(group)), key=lambda f: -f.gain)
    # noise of u is in u, and a function of u explains some of it: more than what is left has of structure
    best = next((f for f in groups if {"u", GAIN}.isdisjoint(f.on) or fits.left_of(plain, f.on) >= noise), None)
    if best is None:
        return Discrepancy((), plain, False, noise, plain)
    reached = fits.left_of(plain, best.on)
    certain = best.gain / search.noise.nats > POLICY.unknown_nats and reached < (1.0 - POLICY.unknown_fall) * plain
    certain = certain and best.gain - _of_counts(search, fits, best.on) > POLICY.unknown_nats * search.noise.nats
    least, left = POLICY.least_unknown * errors.force, surely_left(search, fit)
    large = min(math.sqrt(max(plain**2 - reached**2, 0.0)), left) > least
    structured = share > POLICY.structured_share and math.sqrt(share) * left > least
    on = best.on if reached < plain else ()
    return Discrepancy(on, min(reached, plain), (certain and large) or structured, noise, plain, certain)


def _of_counts(search: Search, fits: FreeformFits, on: tuple[str, ...]) -> float:
    """Squares that a function takes off the errors of counts alone, at most: between the same places these repeat."""
    equations, inertia = search.equations, search.solver.inertia
    rows = (inertia * equations.plain(errors) for errors in equations.of_counts())
    return max((replace(fits, base=[row, *fits.base[1:]]).fit_with(on).gain for row in rows), default=0.0)


def above_floor(search: Search, fit: Fit) -> bool:
    """Whether more is left than the sensor alone leaves, and enough to matter: then something is missing.

    Rows in which the direction of the motion is not sure do not count, if the others are many.
    """
    return surely_left(search, fit) > search.problem.least_missing


def surely_left(search: Search, fit: Fit) -> float:
    """rms, unit of u, of all rows or of those where the direction is sure, if that is less: turns leave more. What is
    noise of u counts as the sensor's."""
    left = min(search.problem.errors.rmse(fit), left_elsewhere(search, fit))
    return min(left, search.problem.floor) if noise_of_u(search, fit) else left


def noise_of_u(search: Search, fit: Fit) -> bool:
    """Whether what is left is noise of u: white to the end, and more than the sensor's. A duty is, a current without
    filter, or that of a drive whose log folds it down. In the motion by u it bends all values, and passes for a lag."""
    more = search.problem.errors.rmse(fit) > POLICY.floor_factor * search.problem.floor
    return more and search.problem.errors.white(fit)


def beyond_noise(search: Search, fit: Fit, times: float = 1.0) -> float:
    """rms of what is surely left beyond so many times the sensor's noise, unit of u."""
    return math.sqrt(max(surely_left(search, fit) ** 2 - (times * search.problem.floor) ** 2, 0.0))


def force_beyond(search: Search, fit: Fit, beyond: Discrepancy, times: float = 1.0) -> float:
    """rms of the force that a fit leaves, unit of u: what is beyond so many times the sensor's noise, and no less than
    is explained, for of a coarse sensor more noise may have been expected than there is."""
    share = 1.0 - (beyond.least / max(beyond.plain, 1e-300)) ** 2
    explained = search.problem.errors.rmse(fit) * math.sqrt(max(share, 0.0))
    return max(beyond_noise(search, fit, times), min(explained, surely_left(search, fit)))


def only_at_stops(search: Search, fit: Fit) -> bool:
    """Whether more than the sensor alone leaves is left only at stops and in creeping. What friction does there is
    known in part, and the error of a coarse sensor is not white: it is no evidence for anything that is missing."""
    limit = POLICY.floor_factor * search.problem.floor
    return left_elsewhere(search, fit) <= limit < search.problem.errors.rmse(fit)


def borne_out(search: Search, whole: Fit, beyond: Discrepancy) -> tuple[Fit, Discrepancy]:
    """The set that was found and what is beyond it; no effect, where the model leaves more than the sensor only at
    stops and in creeping, and the set takes nothing certain off elsewhere: it explains what nobody knows."""
    sure = many_sure(search.equations, nearly=True)
    if sure is None or not search.added(whole.terms) or not only_at_stops(search, search.refit):
        return whole, beyond
    was, now = (search.problem.errors.residual(fit, held_out=False)[sure] for fit in (search.refit, whole))
    return (whole, beyond) if surely_less(was, now) else (search.refit, discrepancy_of(search, search.refit))


def said_of_left(search: Search, fit: Fit) -> tuple[str, ...]:
    """A warning where most of what is left is left at stops, or is noise of u."""
    left, elsewhere, errors = search.problem.errors.rmse(fit), left_elsewhere(search, fit), search.problem.errors
    if noise_of_u(search, fit):
        return (
            f"the error that the fit leaves, {left:.3g}, {100.0 * left / errors.force:.2g} % of u, is white, and u has"
            " as much above the band: it counts as noise of u. Is that a duty, a current without a filter, a loop"
            " faster than the log, or what the controller makes of a coarse sensor?",
        )
    if not only_at_stops(search, fit):
        return ()
    return (
        f"most of the error that the fit leaves, {left:.3g}, is from stops and creeping, where the direction is not"
        f" sure and nothing is identifiable; elsewhere it is {elsewhere:.3g}",
    )


def in_creeping(search: Search, options: Sequence[Option]) -> Option | None:
    """An effect that would take much off what is left, but only at stops and in creeping, where nothing is sure."""
    rmse = search.problem.errors.rmse
    if not options or not only_at_stops(search, search.refit):
        return None
    best = min(options, key=lambda o: rmse(o.fit))
    return best if rmse(best.fit) < (1.0 - POLICY.clear_fall) * rmse(search.refit) else None


def weightless(search: Search, fit: Fit) -> bool:
    """Whether effects explain u, which is not all friction, by itself (hardly any inertia is left) or J a so."""
    return not search.solver.inverse and (search.problem.scale.weightless(fit) or search.problem.errors.shaken(fit))


def left_elsewhere(search: Search, fit: Fit) -> float:
    """rms of what is left where the direction of the motion is sure, unit of u; inf where few rows are so, or all.

    Of the acceleration, over the gain with which u makes it: where friction is most of u hardly any of it is explained,
    and at a steady speed, where there is none, a model without friction leaves nothing of it, and all of u.
    """
    sure, gain = many_sure(search.equations, nearly=True), abs(float(fit.forward[0]))
    if sure is None or sure.all() or gain == 0.0:
        return math.inf
    return float(np.sqrt(np.mean(search.problem.errors.residual(fit, held_out=False)[sure] ** 2))) / gain


def without_imitations(search: Search, whole: Fit, beyond: Discrepancy) -> tuple[Fit, Discrepancy]:
    """A set that was found and what is beyond it, without the effects that nobody needs beside a varying gain.

    Together with that gain the others must leave less than the whole set did: an arm whose inertia follows its angle
    looks like a weight and a constant load, but not so well.
    """
    part, fit = search.searched(whole)
    if not part.added(fit.terms):
        return whole, beyond
    beside = part.freeform(fit)
    found = (_law(part, fit, beside.fit_with(group)) for group in beside.groups() if group[0] == GAIN)
    if not (laws := [law for law in found if law is not None]):
        return whole, beyond
    _, on, terms = min(laws)
    rest, alone = search.fit(terms, whole.tap), part.solver.fit(terms, fit.tap)
    plain = part.problem.errors.rmse(alone)
    left = part.freeform(alone).left_of(plain, on)
    if left > (1.0 - POLICY.unknown_fall) * search.problem.errors.rmse(whole):
        return whole, beyond
    return rest, Discrepancy(on, min(left, search.problem.errors.rmse(rest)), True, beyond.noise, plain)


def _law(search: Search, whole: Fit, beside: Freeform) -> tuple[float, tuple[str, ...], Terms] | None:
    """u g(x): the loss where it is held out, what x is, the effects that are still needed beside it. None where it
    explains nothing beside the whole set, `beside`, or needs all of it."""
    on, nats = beside.on, search.noise.nats
    if beside.gain < POLICY.unknown_nats * nats:
        return None
    terms, loss = whole.terms, beside.loss
    for term in reversed(search.added(whole.terms)):
        rest = tuple(t for t in terms if t != term)
        without = search.freeform(search.solver.fit(rest, whole.tap)).fit_with(on).loss
        if without - loss < (search.price((term,)) + POLICY.least_gain) * nats:
            terms, loss = rest, without
    better = loss < float(beside.without.sum()) - POLICY.unknown_nats * nats
    return (loss, on, terms) if better and terms != whole.terms else None


def in_common(search: Search, whole: Fit) -> float:
    """Share of u that the motion explains in parts of the log that were not fitted: less than of any axis, if u is of
    another one, or of another time.

    Asked of u by the motion: with its acceleration, the effects that were found and any functions of speed and
    position. Effects can be found for any u; they do not explain it elsewhere.
    """
    part, fit = search.searched(whole)
    fits = part.freeform(fit)
    groups = [group for group in (("velocity",), ("position",)) if group in fits.groups()]
    shares = (fits.share_of_u(groups[:count]) for count in range(len(groups), -1, -1))  # a run up is at each place once
    told = max(shares)
    if search.solver.inverse:  # the held-out error of the set is that of u by the motion, of all rows
        errors = search.problem.errors
        u = errors.bank.command((), whole.tap)[search.equations.kept]
        told = max(told, 1.0 - (errors.rmse(whole) / max(float(np.std(u)), 1e-300)) ** 2)
    return told
