"""Whether something is left that no effect explains: free-form functions, the residual's spectrum, pushes in time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.identify.fit.freeform import GAIN, freeform_fits, loss_of
from dsd_cli.identify.fit.noise import structured_share
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.fit.sure import many_sure, surely_less
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.search.pulses import sharpened, with_pulses
from dsd_cli.identify.search.sets import Search


@dataclass(frozen=True)
class Beyond:
    """What a fit leaves: the best free-form function of it, and whether something unknown is among it."""

    on: tuple[str, ...]
    heldout_rmse: float
    unknown: bool
    noise: float

    @property
    def of_gain(self) -> bool:
        """Whether it is u times something."""
        return GAIN in self.on


def beyond_of(search: Search, fit: Fit) -> Beyond:
    """Free-form functions beside a fit, and the spectrum of what it leaves.

    Where there is an excerpt, functions of motion and u are tried on it, functions of time on all rows.
    """
    if search.excerpt is None:
        return _beyond(search, fit, lambda _: True)
    part, over_time = search.excerpt, _beyond(search, fit, lambda group: group == ("time",))
    there = _beyond(part, part.fit(fit.terms, fit.tap), lambda group: group != ("time",))
    first = there if there.unknown or not over_time.unknown else over_time
    return replace(first, unknown=over_time.unknown or there.unknown)


def _beyond(search: Search, fit: Fit, asked: Callable[[tuple[str, ...]], bool]) -> Beyond:
    errors, equations = search.problem.errors, search.equations
    fits = freeform_fits(errors.bank, equations, search.problem.blocks, fit, search.solver.inertia)
    plain = errors.rmse(fit)
    share = structured_share(equations.by_stretch(errors.residual(fit, held_out=False)), equations.band)
    noise = plain * math.sqrt(1.0 - share)
    groups = [fits.fit_with(group) for group in fits.groups() if asked(group)]
    if not groups:
        return Beyond((), plain, False, noise)
    best = loss_of(groups)
    fall = fits.fit_with(best.on, whitened=False).gain / max(int(equations.kept.sum()), 1)
    reached = math.sqrt(max(plain**2 - fall, 0.0))
    certain = best.gain / search.noise.nats > POLICY.unknown_nats and reached < (1.0 - POLICY.unknown_fall) * plain
    large = math.sqrt(max(plain**2 - reached**2, 0.0)) > POLICY.least_unknown * errors.force
    structured = share > POLICY.structured_share and math.sqrt(share) * plain > POLICY.least_unknown * errors.force
    on = best.on if reached < plain else ()
    unknown = ((certain and large) or structured) and not only_at_stops(search, fit)
    return Beyond(on, min(reached, plain), unknown, noise)


def above_floor(search: Search, fit: Fit) -> bool:
    """Whether more is left than the sensor alone leaves, and enough to matter: then something is missing.

    Rows in which the direction of the motion is not sure do not count, if the others are many.
    """
    return min(search.problem.errors.rmse(fit), _left_elsewhere(search, fit)) > _least(search)


def beside_stops(search: Search, fit: Fit) -> bool:
    """Whether a fit that leaves no more than noise was judged without stops and creeping, where it leaves more."""
    return search.problem.errors.rmse(fit) > _least(search) or only_at_stops(search, fit)


def _least(search: Search) -> float:
    """rms of r from which on something is missing, if unknown; unit of u."""
    problem = search.problem
    return math.hypot(POLICY.floor_factor * problem.floor, POLICY.floor_excess * problem.errors.force)


def only_at_stops(search: Search, fit: Fit) -> bool:
    """Whether more than the sensor alone leaves is left only at stops and in creeping. What friction does there is
    known in part, and the error of a coarse sensor is not white: it is no evidence for anything that is missing."""
    elsewhere = _left_elsewhere(search, fit)
    limit = POLICY.floor_factor * search.problem.floor
    return elsewhere <= limit < search.problem.errors.rmse(fit)


def borne_out(search: Search, whole: Fit, beyond: Beyond) -> tuple[Fit, Beyond]:
    """The set that was found and what is beyond it; no effect, where the model leaves more than the sensor only at
    stops and in creeping, and the set takes nothing certain off elsewhere: it explains what nobody knows.

    Of an outside rig's true effects beside friction that is known, of which the model leaves no more elsewhere, sets
    take off 55 to 890 times the variance there (four logs); of a coarse encoder's turns a lag, or a line, took off
    -17 to 3.5 (four logs).
    """
    sure = many_sure(search.equations)
    if sure is None or not search.added(whole.terms) or not only_at_stops(search, search.refit):
        return whole, beyond
    was, now = (search.problem.errors.residual(fit, held_out=False)[sure] for fit in (search.refit, whole))
    return (whole, beyond) if surely_less(was, now) else (search.refit, beyond_of(search, search.refit))


def said_of_stops(search: Search, fit: Fit) -> tuple[str, ...]:
    """A warning that what is left is not judged, if it is left there."""
    if not only_at_stops(search, fit):
        return ()
    left, elsewhere = search.problem.errors.rmse(fit), _left_elsewhere(search, fit)
    return (
        f"most of the error that the fit leaves, {left:.3g}, is from stops and creeping, where the direction is not"
        f" sure and nothing can be told; elsewhere it is {elsewhere:.3g}",
    )


def _left_elsewhere(search: Search, fit: Fit) -> float:
    """rms of what is left where the direction of the motion is sure, unit of u; inf where few rows are so, or all."""
    sure = many_sure(search.equations)
    if sure is None or sure.all():
        return math.inf
    return float(np.sqrt(np.mean(search.problem.errors.residual(fit, held_out=False)[sure] ** 2)))


def pushed(search: Search, whole: Fit, beyond: Beyond) -> tuple[Fit, Beyond]:
    """With pulses in time if nothing unknown remains beside them; otherwise unchanged; strong pulses mean unknown.

    One push in a long log hardly shows in a spectrum or in a function of time, so they are looked for in any case.
    """
    if (alone := _pushes_alone(search, whole)) is not None:
        return alone
    pulses = with_pulses(search, whole)
    if pulses is None or not search.practical(whole, pulses):
        return whole, beyond
    loud = search.problem.errors.rmse(pulses) < (1.0 - POLICY.pulses_fall) * search.problem.errors.rmse(whole)
    if not (loud or beyond.unknown):
        return whole, beyond
    settled = search.settled(sharpened(search, pulses))
    again = with_pulses(search, settled)  # without the laws that imitated pulses the edges are clear
    if again is not None:
        again = sharpened(search, again)
        settled = search.settled(again) if search.evidence(again) > search.evidence(settled) else settled
    then = beyond_of(search, settled)
    better = search.evidence(settled) > search.evidence(whole) and search.practical(whole, settled)
    a_law = beyond.on and "time" not in beyond.on and beyond.heldout_rmse < search.problem.errors.rmse(settled)
    if better and not then.unknown and not a_law:  # a function of motion or u that explains more than pushes is a law
        return settled, then
    return whole, beyond if beyond.unknown else replace(beyond, unknown=True, on=("time",))


def _pushes_alone(search: Search, whole: Fit) -> tuple[Fit, Beyond] | None:
    """A few pushes in place of all that was found, where they explain more and leave no more than the sensor does: two
    lines in time and a cogging make three pushes of a short log, and leave nothing of them to see.

    Pushes can also stand in for laws that no catalogue has (a brake, an end stop); these leave 5 to 50 times the floor.
    """
    if not search.added(whole.terms):
        return None
    pulses = with_pulses(search, search.refit)
    if pulses is None or _hopeless(search, pulses, whole):
        return None
    rmse, floor = search.problem.errors.rmse, search.problem.floor
    found = search.settled(sharpened(search, pulses))
    rest = rmse(found) > POLICY.floor_factor * floor
    if rest or search.evidence(found) < search.evidence(whole) + POLICY.least_gain:
        return None
    then = beyond_of(search, found)
    return None if then.unknown else (found, then)


def _hopeless(search: Search, pulses: Fit, whole: Fit) -> bool:
    """Whether pushes leave more than a set wherever their edges are: moved to their places, they take off no more than
    a row of each edge holds. Sharpening them costs a hundred fits, of a long log seconds."""
    levels = pulses.coefficients(next(t for t in pulses.terms if t.effect.listed))
    rmse, rows = search.problem.errors.rmse, int(search.equations.kept.sum())
    return rows * (rmse(pulses) ** 2 - rmse(whole) ** 2) > 2.0 * float(levels @ levels)
