"""Units of velocity and position that contradict each other: a factor too much in the config, or one that it lacks?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from dsd_cli.identify.checks.channels import NEAR
from dsd_cli.identify.checks.disturbance import Observed
from dsd_cli.identify.checks.results import Finding
from dsd_cli.identify.checks.view import View
from dsd_cli.plant.model import ObserverSettings, PlantModel

#: Factors of the config that may be taken away, each in turn and then both.
_TAKEN = (("position",), ("velocity",), ("position", "velocity"))
#: An inertia that is nearer to one of two values than this (natural logarithm) tells which motion is right.
_TELLS = 0.7


def settled(
    found: Sequence[Finding], applied: Mapping[str, float], view: View, off: float | None
) -> tuple[list[Finding], bool]:
    """(the findings, of which those on a factor say as well what in the config makes it, whether there are any).

    Parameters
    ----------
    applied : factors of the config by channel. off : see `times_too_large`.
    """
    ratio = next((one.ratio for one in found if one.ratio), 0.0)
    if not ratio:
        return list(found), False
    taken = next((some for some in _TAKEN if _agree(ratio, some, applied)), ())
    source = view.band.source if view.band is not None else "position"
    blamed = _blamed(ratio, source, off)
    if not taken or (blamed and blamed not in taken):
        return list(found), True
    both = " and ".join(taken)
    what = f"velocity is {ratio:.4g} times the slope of position; without the factors in [signals] they agree"
    remedy = " and ".join(f"signals.{name}_unit ({name}_scale)" for name in taken)
    remedy = f"leave out {remedy}: the log has {both} in SI units already"
    others = [one for one in found if one.ratio]
    if not blamed and len(taken) == 1:
        remedy += ", or the other one has another unit as well: name it (signals.velocity_unit, position_unit)"
    one = replace(others[0], what=what, channel=taken[0], remedy=remedy, multiply=())
    return [one, *(f for f in found if not f.ratio)], True


def _agree(ratio: float, taken: Sequence[str], applied: Mapping[str, float]) -> bool:
    """Whether velocity is the slope of position without the factors of these channels."""
    if any(abs(applied.get(name, 1.0)) == 1.0 for name in taken):
        return False
    factors = {name: abs(applied[name]) for name in taken}
    return abs(ratio * factors.get("position", 1.0) / factors.get("velocity", 1.0) - 1.0) < NEAR


def _blamed(ratio: float, source: str, off: float | None) -> str:
    """The channel that an inertia from `source` contradicts; "" if it does not say."""
    if off is None:
        return ""
    wrong = ratio if source == "position" else 1.0 / ratio  # what the inertia is too large by if the source is off
    nearest = min((1.0, wrong), key=lambda one: abs(math.log(off / one)))
    if abs(math.log(off / nearest)) > _TELLS:
        return ""
    other = "velocity" if source == "position" else "position"
    return other if nearest == 1.0 else source


def times_too_large(
    view: View, model: PlantModel | None, d_hat: Observed | None, observer: ObserverSettings | None
) -> float | None:
    """What the inertia that the motion shows is, over the one that it should be; None where nothing shows it."""
    if observer is not None and d_hat is not None and d_hat.clear:
        return abs(d_hat.motion / d_hat.drive)
    if model is not None and view.forward is not None and view.forward.explained > 0.5:
        return view.forward.inertia / model.inertia
    return None
