"""What the log says by itself of inertia and delay, of the signs of its channels, and of its sensor."""

from __future__ import annotations

import math

import numpy as np

from dsd_cli.identify.checks.balance import orthonormal, without
from dsd_cli.identify.checks.channels import degrees, power_of_two
from dsd_cli.identify.checks.disturbance import Observed, culprit
from dsd_cli.identify.checks.fitted import Sides
from dsd_cli.identify.checks.results import Excitation, Finding
from dsd_cli.identify.checks.scan import FEW, Scanned, View, block_starts, jackknife
from dsd_cli.identify.results import INERTIA
from dsd_cli.plant.model import PlantModel

#: Inertia and delay are believed where J a is at least this share of what friction and weight leave of u, whatever the
#: delay, and at least this share of the power of u: less is within the error of any friction, ...
NEEDED, WEIGHT = 0.5, 0.005
#: ... and from so many standard errors on.
CLEAR = 5.0
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


def looks_late(view: View) -> bool:
    """Whether u may be later than what it does, so that a fit must decide."""
    fit = believable(view)
    return fit is not None and delay_of(fit, view) < 0.0


def check_late(sides: Sides) -> list[Finding]:
    """A finding about a u that is later than what it does."""
    if sides.late is None:
        return []
    why = "another clock, a filtered u, or a load behind something soft?"  # a motor's speed leads u with that
    what = f"u is {sides.late[0] * 1e3:.3g} ms later than the motion it causes: {why}"
    return [Finding(what, "u", "warning", 0.9, late=sides.late[0], first=True)]


def check_inertia(sides: Sides, model: PlantModel | None) -> list[Finding]:
    """A finding about an inertia that is far from the model's."""
    found = sides.beside.values.estimates[INERTIA]
    if model is None or found.grade != "identified" or 1.0 / ANOTHER < found.value / model.inertia < ANOTHER:
        return []
    what = f"u and the motion make an inertia of about {found.value:.2g}, [model] has {model.inertia:.4g}"
    remedy = f"model.inertia = {found.value:.2g}, or signals.u_scale if u is in another unit"
    return [Finding(what, "u", "warning", 0.9, remedy)]


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


def band_of(view: View, sides: Sides | None) -> float | None:
    """End of the band of the fit, Hz, else of what the sensor shows; None where it shows no acceleration."""
    seen = None if view.band is None else view.band.cutoff
    return seen if sides is None else sides.own.search.equations.band.hz


def floor_of(view: View, sides: Sides | None) -> float | None:
    """rms of J a_noise within the band, unit of u; None: unknown, or finer than 24 bits of u, which no sensor has."""
    floor = math.nan if sides is None else sides.own.search.problem.floor
    return floor if floor > np.finfo(np.float32).eps * np.nanmax(np.abs(view.log["u"]), initial=0.0) else None


#: An inertia below 0 is believed from `CLEAR` standard errors on, where it explains this share of what friction and
#: weight leave, and `WEIGHT` of all of u, ...
EXPLAINED = 0.3
#: ... and where that is so sure, of the two signs each with its likeliest delay, one of so many u being turned.
SURE, TURNED = 0.9, 20.0
#: In a log of fewer than `FEW` rows (each is half a period of the highest frequency) friction that turns explains as
#: much as an inertia below 0 does, with a u that is taken for late: it must explain this share of u.
WEIGHT_OF_FEW = 0.02
#: Share of what friction and weight leave of u that an inertia explains which is not hidden by them.
PLAIN = 0.8
#: Work done by the motion on u is believed from so many standard errors, and this share of the power of u, on.
WORK_CLEAR, WORK_SHARE = 4.5, 0.03


def sign_of_u(view: View) -> float:
    """How sure it is that u has the other sign than the motion; below `SURE` it may be earlier instead.

    Two signs: an inertia below 0; and, where friction hides the inertia, a u that brakes at every delay that can be.
    """
    by_inertia = _by_inertia(view)
    done = view.work
    if done is None:
        return by_inertia
    if done.clearness > WORK_CLEAR and done.share > WORK_SHARE:
        return 0.0  # u drives the motion, whatever the inertia looks like
    if done.clearness < -WORK_CLEAR and done.share > WORK_SHARE and not _rightly_driven(view):
        return max(by_inertia, 0.95)
    return by_inertia


def _rightly_driven(view: View) -> bool:
    """Whether an inertia above 0 is plain to see: friction that falls with the speed can look like a u that brakes."""
    right, turned = view.forward, view.backward
    if right is None or right.clearness < CLEAR or right.explained < PLAIN or right.weight < WEIGHT_OF_FEW:
        return False
    return _surer(right, turned) > SURE


def _surer(one: Scanned, other: Scanned | None) -> float:
    """How sure a sign is that must be shown, over the other one at its likeliest delay."""
    if other is None:
        return 0.99
    return min(1.0 / (1.0 + TURNED * math.exp(min(other.belief - one.belief, 99.0))), 0.99)


def _few(view: View) -> float:
    """What standard errors of few rows are to be multiplied by."""
    return 1.0 if view.rows is None else max(math.sqrt(FEW / view.rows.acceleration.size), 1.0)


def _by_inertia(view: View) -> float:
    right, turned = view.forward, view.backward
    if turned is None or not turned.inside:
        return 0.0
    few = _few(view)
    weight = WEIGHT_OF_FEW if few > 1.0 else WEIGHT
    if turned.clearness < CLEAR * few or turned.explained < EXPLAINED or turned.weight < weight:
        return 0.0
    return _surer(turned, right)


#: Sizes explain a u that is a magnitude so much better, by so many standard errors; delays and rounds that are tried.
FOLDED, CLEARLY_FOLDED, _DELAYS, _ROUNDS = 1.5, 2.5, 150, 10


def check_magnitude(view: View, did: Excitation) -> list[Finding]:
    """A finding about a u that goes with the size of what the motion asks for; a load that hangs holds u on one side as
    well, but that goes with the motion as it is. Each is taken at its best delay."""
    rows, u = view.rows, view.log.channels.get("u", np.zeros(1))
    if rows is None or not (did.forward and did.backward) or np.nanmin(u) < 0.0 < np.nanmax(u):
        return []
    before, after = ((n - 1) * rows.T for n in rows.reach)
    sizes = np.abs(np.column_stack([rows.u_at(shift) for shift in np.linspace(-after, before, _DELAYS)]))
    basis = orthonormal(np.column_stack([rows.motion, rows.acceleration, np.sign(rows.speed)]))
    left = [without(basis, sizes)]
    for asked in (rows.speed[:, None], rows.acceleration[:, None]):
        for _ in range(_ROUNDS):  # each leaves less than the one before
            asked = basis @ (basis.T @ np.where(asked < 0.0, -sizes, sizes))
        left.append(sizes - np.abs(asked))
    squares = [np.add.reduceat(x**2, block_starts(len(x))) + 1e-300 for x in left]
    signed, *folded = (x[:, x.sum(axis=0).argmin()] for x in squares)
    size = min(folded, key=np.sum)
    errors = _few(view) * float(jackknife(np.log((signed.sum() - signed) / (size.sum() - size))))
    if np.log(signed.sum() / size.sum()) < max(np.log(FOLDED), CLEARLY_FOLDED * errors):
        return []
    what = "u never changes its sign while the axis moves both ways, and goes with the size of what moves it"
    remedy = "name the column that has the sign in signals.u, or write it into u"
    return [Finding(f"{what}: is it a magnitude? where is its direction?", "u", "error", 0.9, remedy)]


def check_signs(view: View, opposite: bool, d_hat: Observed | None, observer_sign: int) -> list[Finding]:
    """At most one finding about u or the motion.

    opposite : velocity and position have opposite signs.
    d_hat : how d_hat is made of the motion (as `view.band` takes it) and u, where it is logged.
    """
    turned = sign_of_u(view)
    blamed = "" if d_hat is None else culprit(d_hat, observer_sign)
    source = view.band.source if view.band is not None else "position"
    if opposite:
        other = "velocity" if source == "position" else "position"
        against_u = turned > SURE or blamed == "motion"
        return [_opposite(source if against_u else other, sure=against_u or _sees(view))]
    if blamed == "motion":
        both = [name for name in ("velocity", "position") if name in view.log]
        what = f"{' and '.join(both)}: the other sign than u and d_hat"
        return [Finding(what, source, "error", 0.95, multiply=tuple((name, -1.0) for name in both))]
    if turned > SURE or blamed == "u":
        what = "u has the other sign than the motion it causes"
        return [Finding(what, "u", "error", turned if turned > SURE else 0.95, multiply=(("u", -1.0),))]
    if turned > 1.0 - SURE and not (d_hat is not None and d_hat.clear) and _half_a_cycle_apart(view):
        late = 0.0 if view.forward is None else view.forward.shift * 1e3
        other = f"the motion comes {abs(late):.3g} ms {'early' if late < 0.0 else 'late'}"
        what = f"u has the other sign than the motion it causes ({100.0 * turned:.0f} %), or {other}"
        what = f"{what}: like any sine, this motion cannot say which"
        remedy = "record a few different moves from rest as well; signals.u_sign turns u"
        return [Finding(what, "u", "warning", SURE, remedy, first=True)]
    return []


def _half_a_cycle_apart(view: View) -> bool:
    """Whether both signs explain u at delays that differ by half of what the motion comes again after."""
    if view.forward is None or view.backward is None:
        return False
    halves = 2.0 * abs(view.forward.shift - view.backward.shift) / view.cycle
    return abs((halves + 1.0) % 2.0 - 1.0) > 0.5


def _sees(view: View) -> bool:
    """Whether a u of the wrong sign would have been seen."""
    fit, done = view.forward, view.work
    return (fit is not None and fit.explained > 0.5) or (done is not None and done.clearness > 5.0)


def _opposite(channel: str, sure: bool) -> Finding:
    other = "position" if channel == "velocity" else "velocity"
    what = "velocity has the other sign than the slope of position"
    remedy = "" if sure else f"this log cannot say whether it is not {other} that must be turned"
    return Finding(what, channel, "error", 0.98, remedy, ((channel, -1.0),))
