"""What the log says of inertia and delay by itself, and what its sensor can show of the acceleration."""

from __future__ import annotations

import math

from dsd_cli.identify.checks.channels import degrees, power_of_two
from dsd_cli.identify.checks.results import Finding
from dsd_cli.identify.checks.scan import Scanned
from dsd_cli.identify.checks.view import View
from dsd_cli.plant.model import PlantModel

#: Inertia and delay are believed where J a is at least this share of what friction and weight leave of u, whatever the
#: delay, and at least this share of the power of u: less is within the error of any friction, ...
NEEDED, WEIGHT = 0.5, 0.005
#: ... and from so many standard errors on.
CLEAR = 5.0
#: u is late if it is later than the motion by more than this, in samples.
LATE_SAMPLES = 1.0
#: An inertia of the model is another machine, or another unit of u, from this factor on.
ANOTHER = 3.0


def delay_of(fit: Scanned, view: View) -> float:
    """L in s: a u that is held acts on average half a sample after its stamp."""
    return fit.shift - (0.5 * view.log.sample_time if view.log.u_hold == "held" else 0.0)


def believable(view: View) -> Scanned | None:
    """The fit with J > 0, where it is clear."""
    fit = view.forward
    if fit is None or not fit.inside or fit.needed < NEEDED or fit.weight < WEIGHT or fit.clearness < CLEAR:
        return None
    return fit


def check_values(view: View, model: PlantModel | None) -> list[Finding]:
    """Findings about a u that is later than what it does, and an inertia that is far from the model's."""
    fit = believable(view)
    if fit is None:
        return []
    found, delay = [], delay_of(fit, view)
    if delay + CLEAR * fit.shift_error < -LATE_SAMPLES * view.log.sample_time:
        what = f"u is {-delay * 1e3:.3g} ms later than the motion it causes: another clock, or a filtered u?"
        found.append(Finding(what, "u", "warning", 0.9, late=-delay))
    if model is not None and not 1.0 / ANOTHER < fit.inertia / model.inertia < ANOTHER:
        what = f"u and the motion make an inertia of about {fit.inertia:.2g}, [model] has {model.inertia:.4g}"
        remedy = f"model.inertia = {fit.inertia:.2g}, or signals.u_scale if u is in another unit"
        found.append(Finding(what, "u", "warning", 0.9, remedy))
    return found


#: A band that ends below this holds little of what a servo does, Hz.
NARROW = 3.0


def check_sensor(view: View) -> list[Finding]:
    """Findings about a sensor that shows too little; its step as a note."""
    band = view.band
    if band is None:
        logged = [name for name in ("position", "velocity") if name in view.log]
        if not logged or not view.stretches:
            return []
        what = f"{' and '.join(logged)} show{'s' * (len(logged) == 1)} no acceleration above the noise of the sensor"
        return [Finding(what, logged[0], "error", 0.9, "harder moves, a finer encoder, or another column")]
    found = []
    if band.cutoff < NARROW:
        what = f"the sensor shows the acceleration up to {band.cutoff:.2g} Hz only"
        found.append(Finding(what, band.source, "warning", 0.9, "harder moves, or a finer encoder"))
    if (note := degrees(band)) is not None:
        found.append(note)
    elif band.step > 0.0:
        found.append(Finding(_step_text(band.source, band.step), band.source, "note", 0.95))
    return found


def _step_text(channel: str, step: float) -> str:
    counts = 2.0 * math.pi / step
    turn = f": {counts:.0f} per turn, if it is in rad" if channel == "position" and power_of_two(counts) else ""
    return f"{channel} has steps of {step:.4g}{turn}"


def floor_of(view: View, model: PlantModel | None) -> float | None:
    """rms of J a_noise within the band, in the unit of u; J is the model's, without one that of the log."""
    fit = believable(view)
    inertia = model.inertia if model is not None else None if fit is None else fit.inertia
    return None if view.band is None or inertia is None else inertia * view.band.acceleration_noise
