"""What the log says of inertia and delay by itself, and whether that can be."""

from __future__ import annotations

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
