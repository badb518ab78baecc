"""Can this log answer? Signs, scales, clock, excitation, sensor, and what of a model it identifies.

result = check_log(log, model, observer)
findings = to_mend_first(result)      # what must be said before anything else
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import partial

import numpy as np

from dsd_cli.identify.checks import clock, values
from dsd_cli.identify.checks.channels import check_channels, check_jumps, in_one, settled, times_too_large, without_late
from dsd_cli.identify.checks.disturbance import check_alone, check_disturbance, check_maker, observed
from dsd_cli.identify.checks.excitation import check_excitation, excitation
from dsd_cli.identify.checks.fitted import Sides, sides_in, sides_of
from dsd_cli.identify.checks.hold import check_hold
from dsd_cli.identify.checks.parameters import parameters_of, unknown_parameters
from dsd_cli.identify.checks.results import CheckResult, Excitation, Finding, Parameter, Severity
from dsd_cli.identify.checks.scan import View, look
from dsd_cli.identify.checks.stretches import SHORTEST
from dsd_cli.identify.fit.bank import INERTIA as AT_INERTIA
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.maker import Maker
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Log
from dsd_cli.signals.units import KeysOf, scales

__all__ = [
    "CheckResult",
    "Excitation",
    "Finding",
    "Parameter",
    "Severity",
    "biased_by_noise",
    "check_log",
    "to_mend_first",
    "without_late",
]

_ORDER = {"error": 0, "warning": 1, "note": 2}


@np.errstate(over="ignore", invalid="ignore")  # of a corrupt cell (1e300) a square is no number, and nothing is seen
def check_log(
    log: Log,
    model: PlantModel | None = None,
    observer: ObserverSettings | None = None,
    restarts: Sequence[int] = (),
    *,
    dropped: Mapping[str, int] | None = None,
    factors: Mapping[str, float] | None = None,
    keys_of: KeysOf | None = None,
    u_shift: float = 0.0,
    maker: Maker | None = None,
    with_values: bool = True,
) -> CheckResult:
    """Everything that one log shows about itself; never raises for what is in a log.

    model : what the plant is believed to be; without it only inertia and delay are looked at.
    observer : of a logged d_hat; without it d_hat is not judged.
    restarts : samples that do not continue the one before.
    dropped : rows that were not taken as they are, as `Cleaner.dropped` has them.
    factors, u_shift : of [signals], that are in the log already, and `keys_of` what its keys must be to multiply more.
    maker : of [observer] filter and u, whose d_hat has been turned into that of this package; None is as here.
    with_values : whether those of the model are looked at, too; `biased_by_noise` does it later.
    """
    even = clock.evened(log, restarts)
    view = look(even, restarts)
    did = excitation(view.stretches, view.band, view.cutoff)
    found = [*clock.check_clock(log, restarts, even is not log), *clock.check_rows(dropped or {}, len(log))]
    found += [*check_jumps(log, restarts), *_unusable(view)]
    found += check_excitation(did, view.stretches, 0 if model is None else len(model.effects))
    found += [] if _fails(found) else values.check_magnitude(view, did)
    if not _fails(found):
        found += _judged(view, model, observer, factors or {}, maker or Maker())
    asked = not _fails(found) and (with_values or values.looks_late(view))
    sides = _fitted(view, model, observer, found) if asked else None
    found += [] if sides is None else [*values.check_late(sides), *values.check_inertia(sides, model)]
    parameters = unknown_parameters(model)
    if sides is not None and with_values:
        parameters = parameters_of(sides, model)
        found += _leaning(parameters)
        if model is not None:
            found += _below_zero(view, sides) or [*_bent(parameters), *_not_told(parameters)]
    worded = [one.worded(keys_of or partial(scales, factors or {}), u_shift) for one in found]
    return CheckResult(
        log.source,
        tuple(sorted(worded, key=lambda one: (_ORDER[one.severity], -one.sure))),
        parameters,
        values.band_of(view, sides),
        values.floor_of(view, sides),
        did,
        clock.seconds_of(log, restarts),
        len(log),
    )


def _fitted(
    view: View, model: PlantModel | None, observer: ObserverSettings | None, found: Sequence[Finding]
) -> Sides | None:
    """Without a model that of the scan is fitted beside friction, weight and springs, where it is to be believed."""
    scanned = values.believable(view)
    if model is None and scanned is not None:
        model = PlantModel(scanned.inertia, max(values.delay_of(scanned, view), 0.0))
    if model is None:
        return None
    late = next((one for one in found if one.late_channel), None)
    return sides_of(view.log if late is None else without_late(view.log, late), view.restarts, model, observer)


def _fails(found: Sequence[Finding]) -> bool:
    return any(one.severity == "error" for one in found)


def _unusable(view: View) -> list[Finding]:
    found = []
    if not view.stretches:
        what = f"{len(view.log)} samples without a stretch of {SHORTEST}"
        found.append(Finding(what, "log", "error", 1.0, "a longer log is needed"))
    if not {"d_hat", "velocity", "position"} & view.log.channels.keys():
        what = "neither d_hat nor velocity nor position"
        found.append(Finding(what, "log", "error", 1.0, "name one of their columns in [signals]"))
    return found


def _leaning(parameters: Sequence[Parameter]) -> list[Finding]:
    """Where noise of the sensor comes back through the controller, and a fit takes that for the axis; a force that is
    missing bends both as well."""
    leaning = [p for p in parameters if p.leaning is not None and not p.lacks_force]
    texts = [f"{p.name} is {p.leaning:.3g} by least squares and {p.value:.3g} by the reference" for p in leaning]
    what = f"{', '.join(texts)}: the controller answers noise of the sensor, or play, a coupling or a lag is missing"
    priors = [f"--prior {p.name}={max(p.value, 0.0):.4g}+-{p.std_error:.2g}" for p in leaning if p.identified != "not"]
    after = "give what the reference says, with its error, if dsd diagnose finds none of these missing:"
    remedy = f"{after} {' '.join(priors)}" if priors else "a finer encoder"
    return [Finding(what, "log", "warning", 0.9, remedy)] if leaning else []


#: What nearly any axis has, beside which a value must stay what it is.
_AS_WELL = "with friction, weight and stiffness fitted as well"


def _below_zero(view: View, sides: Sides) -> list[Finding]:
    """Where a log is too short for the vote on signs, and no inertia above 0 lets the model follow it."""
    if sides.own.fit.total[AT_INERTIA] > 0.0 or (view.rows is not None and view.rows.speed.size >= values.FEW):
        return []
    what = "the fit of [model] as it is gives no inertia above 0: no axis has that"
    remedy = "or this log is too short, and a force that holds the axis or a delay is missing in [model]"
    return [Finding(what, "u", "warning", 0.8, remedy, (("u", -1.0),), first=True)]


def _bent(parameters: Sequence[Parameter]) -> list[Finding]:
    """What the model's values would be if it had the forces that it lacks; without instruments it need not lack any."""
    found = []
    for lacks_force in (True, False):
        if not (bent := [one for one in parameters if one.beside is not None and one.lacks_force == lacks_force]):
            continue
        cause, remedy = "a force is missing in [model]", "dsd diagnose says which"
        if lacks_force:
            for does, biased in (("biases", True), ("widens the +- of", False)):
                names = " and ".join(one.name for one in bent if one.biased is biased)
                cause += f" and {does} {names}" if names else ""
        else:
            cause += ", or the controller answers noise of the sensor"
            remedy = "a signals.reference that the axis follows closely decides"
        first = ", ".join(f"{one.name} {one.value:.3g}" for one in bent)
        then = ", ".join(f"{one.beside:.3g}" for one in bent)
        what = f"the fit of [model] as it is gives {first}, and {_AS_WELL} {then}: {cause}"
        found.append(Finding(what, "log", "note", 0.9, remedy))
    return found


def _not_told(parameters: Sequence[Parameter]) -> list[Finding]:
    names = [one.name for one in parameters if one.identified == "not" and one.beside is None]
    remedy = "dsd diagnose says whether a missing force hides it; if none does, record faster changes of u and speed"
    what = f"{' and '.join(names)} {'is' if len(names) == 1 else 'are'} not identifiable from this log"
    return [Finding(what, "log", "warning", 0.8, remedy)] if names else []


def _judged(
    view: View, model: PlantModel | None, observer: ObserverSettings | None, applied: Mapping[str, float], maker: Maker
) -> list[Finding]:
    """What can be said of a log in which something moves."""
    found, opposite = check_channels(view.stretches, view.cutoff)
    d_hat = None if observer is None else observed(view, observer)
    found, contradict = settled(found, applied, view, times_too_large(view, model, d_hat, observer))
    signs = values.check_signs(view, opposite, d_hat, 1 if observer is None else observer.sign)
    found = [*in_one(found, signs), *values.check_sensor(view)]
    if contradict and applied:
        return found  # which of two motions the inertia and d_hat belong to is not known
    if observer is not None and d_hat is not None and not signs:
        wrong = check_disturbance(d_hat, observer)
        found += wrong or check_maker(view.stretches, observer, maker)
    elif observer is not None and view.band is None and not signs:
        found += check_alone(view.stretches, observer)
    if not signs:
        found += _hold(view)
    return found


def _hold(view: View) -> list[Finding]:
    fit = values.believable(view)
    if fit is None or view.band is None:
        return []
    return check_hold(view.stretches, view.band, values.delay_of(fit, view), view.log.u_hold)


def to_mend_first(result: CheckResult) -> tuple[Finding, ...]:
    """What must be said before anything that this log answers: the surest error, without one when u acts."""
    return result.errors[:1] or tuple(one for one in result.findings if one.first)


@np.errstate(over="ignore", invalid="ignore")
def biased_by_noise(recording: Recording, model: PlantModel, known: Collection[str] = ()) -> list[Finding]:
    """Values of the model that noise in the loop biases in any fit, but for those that are `known` from elsewhere."""
    sides = sides_in(recording, model)
    return [] if sides is None else _leaning([one for one in parameters_of(sides, model) if one.name not in known])
