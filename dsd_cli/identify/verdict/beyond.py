"""Whether something is left that no effect explains: free-form functions, the residual's spectrum, pushes in time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.search.pulses import with_pulses
from dsd_cli.identify.verdict.examination import Examination
from dsd_cli.identify.verdict.freeform import loss_of

#: Something unknown is there if a free-form function takes this share off the held-out error, for certain.
UNKNOWN_FALL, UNKNOWN_NATS = 0.04, 12.0
#: ... or if so much of the residual's power does not look like measurement noise.
STRUCTURED_SHARE = 0.35
#: Pulses in time that take this share off the held-out error mean that something is there, whatever it is.
LOUD_FALL = 0.1


@dataclass(frozen=True)
class Beyond:
    """What lies beyond a fit: the best free-form function, and whether there is something unknown."""

    on: tuple[str, ...]
    heldout_rmse: float
    unknown: bool
    noise: float


def beyond_of(exam: Examination, fit: Fit) -> Beyond:
    """Free-form functions beside a fit, and the spectrum of what it leaves."""
    fits = exam.freeform(fit)
    nats = 2.0 * exam.noise.variance * exam.noise.inflation
    plain = exam.plain.rmse(fit)
    share = exam.structured(fit)
    noise = plain * math.sqrt(1.0 - share)
    groups = [fits.fit_with(group) for group in fits.groups()]
    if not groups:
        return Beyond((), plain, False, noise)
    best = loss_of(groups)
    gain = (fit.loss - best.loss) / nats
    unwhitened = exam.freeform(fit, whitened=False)
    reached = math.sqrt(unwhitened.fit_with(best.on).loss / max(int(exam.equations.kept.sum()), 1))
    certain = gain > UNKNOWN_NATS and reached < (1.0 - UNKNOWN_FALL) * plain
    large = math.sqrt(max(plain**2 - reached**2, 0.0)) > 0.003 * exam.plain.force
    structured = share > STRUCTURED_SHARE and math.sqrt(share) * plain > 0.005 * exam.plain.force
    on = best.on if reached < plain else ()
    return Beyond(on, min(reached, plain), (certain and large) or structured, noise)


def pushed(exam: Examination, whole: Fit, beyond: Beyond) -> tuple[Fit, Beyond]:
    """With pulses in time, if they explain everything that no law explains; else as it was; if loud, unknown.

    One push in a long log hardly shows in a spectrum or in a function of time, so they are looked for in any case.
    """
    pulses = with_pulses(exam, whole)
    if pulses is None or not exam.practical(whole, pulses):
        return whole, beyond
    loud = exam.plain.rmse(pulses) < (1.0 - LOUD_FALL) * exam.plain.rmse(whole)
    if not (loud or beyond.unknown):
        return whole, beyond
    settled = exam.search.settled(pulses)
    again = with_pulses(exam, settled)  # without the laws that stood in for pulses the edges are clear
    if again is not None and exam.search.evidence(again) > exam.search.evidence(settled):
        settled = exam.search.settled(again)
    then = beyond_of(exam, settled)
    better = exam.search.evidence(settled) > exam.search.evidence(whole) and exam.practical(whole, settled)
    if better and not then.unknown:
        return settled, then
    return whole, beyond if beyond.unknown else replace(beyond, unknown=True, on=("time",))
