"""What the sensor of the motion can show: its step, its noise, the band in which it shows an acceleration."""

from __future__ import annotations

import math

from dsd_cli.identify.checks.channels import degrees, power_of_two
from dsd_cli.identify.checks.results import Finding
from dsd_cli.identify.checks.values import believable
from dsd_cli.identify.checks.view import View
from dsd_cli.plant.model import PlantModel

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
