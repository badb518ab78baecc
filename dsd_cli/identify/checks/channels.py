"""Velocity against the slope of the position: wraps, units, and a factor of the config that is one too many."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from dsd_cli.identify.checks.balance import Band
from dsd_cli.identify.checks.disturbance import Observed
from dsd_cli.identify.checks.results import Finding
from dsd_cli.identify.checks.scan import View
from dsd_cli.identify.checks.slope import Slope, compare_slope
from dsd_cli.identify.checks.stretches import Stretch
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.continuous import continuous
from dsd_cli.signals.log import Log

#: A factor this near a known one (relative) is that one.
NEAR = 0.015
#: A factor from the slope is believed if it explains this share of the velocity, a sign from less.
AGREES, AGREES_IN_SIGN = 0.9, 0.3
#: A factor that is not known is worth a word from this far from 1 on: filters take some percent.
FAR = 0.1
#: A velocity is late from so many samples and standard errors on: a backward difference is late by half a sample.
LATE_SAMPLES, LATE_ERRORS = 1.5, 5.0

_RAD, _TURN = math.pi / 180.0, 2.0 * math.pi
#: velocity over slope of position -> (key that mends it, its value, what it then is).
UNITS: dict[float, tuple[tuple[str, float, str], ...]] = {
    1.0 / _RAD: (("velocity", _RAD, "in degrees per second"),),
    _RAD: (("position", _RAD, "in degrees"),),
    60.0 / _TURN: (("velocity", _TURN / 60.0, "in turns per minute"),),
    1.0 / 6.0: (("velocity", _TURN / 60.0, "in turns per minute"), ("position", _RAD, "in degrees")),
    1.0 / _TURN: (("velocity", _TURN, "in turns per second"),),
    _TURN: (("position", _TURN, "in turns"),),
    60.0: (("velocity", _TURN / 60.0, "in turns per minute"), ("position", _TURN, "in turns")),
    360.0: (("velocity", _RAD, "in degrees per second"), ("position", _TURN, "in turns")),
    1.0 / 360.0: (("velocity", _TURN, "in turns per second"), ("position", _RAD, "in degrees")),
    1000.0: (("velocity", 0.001, "in mm/s"),),
    0.001: (("position", 0.001, "in mm"),),
    60000.0: (("velocity", 0.001 / 60.0, "in mm/min"),),
}


def check_channels(stretches: Sequence[Stretch], cutoff: float) -> tuple[list[Finding], bool]:
    """(findings, whether velocity and position have opposite signs)."""
    found = [*_wraps(stretches), *_counts(stretches)]
    slope = compare_slope(stretches, cutoff)
    if slope is None:
        return found, False
    opposite = slope.factor < 0.0 and slope.agreement > AGREES_IN_SIGN
    if slope.agreement > AGREES:
        found += _scale(slope, stretches)
    elif not opposite:
        found.append(_unrelated(slope))
    found += _late(slope, stretches[0].T)
    return found, opposite


def _unrelated(slope: Slope) -> Finding:
    return Finding(
        f"velocity is not the slope of position: that explains {100.0 * slope.agreement:.0f} % of it",
        "velocity",
        "error" if slope.agreement < AGREES_IN_SIGN else "warning",
        0.9,
        'is that its column? else signals.velocity = ""',
    )


def _scale(slope: Slope, stretches: Sequence[Stretch]) -> list[Finding]:
    size = abs(slope.factor)
    if abs(size - 1.0) < max(NEAR, LATE_ERRORS * slope.factor_error):
        return []
    known = min(UNITS, key=lambda factor: abs(math.log(size / factor)))
    if abs(size / known - 1.0) < NEAR:
        return [
            Finding(
                f"velocity is {size:.4g} times the slope of position: {channel} is {what}",
                channel,
                "error",
                0.95,
                multiply=((channel, scale),),
                ratio=size,
            )
            for channel, scale, what in UNITS[known]
        ]
    if _whole_numbers(stretches):
        return []  # counts: said by themselves
    if abs(size - 1.0) < FAR:
        return []
    return [
        Finding(
            f"velocity is {size:.4g} times the slope of position",
            "velocity",
            "error" if not 0.5 < size < 2.0 else "warning",
            0.9,
            "or the position is wrong by as much",
            (("velocity", float(f"{1.0 / size:.4g}")),),
            ratio=size,
        )
    ]


def _late(slope: Slope, T: float) -> list[Finding]:
    clear = abs(slope.late) > max(LATE_SAMPLES * T, LATE_ERRORS * slope.late_error)
    if not clear or slope.agreement < AGREES_IN_SIGN:
        return []
    late, used = ("velocity", "position") if slope.late > 0.0 else ("position", "velocity")
    than = "slope of position: it is filtered, or late" if slope.late > 0.0 else "velocity"
    what = f"{late} is {abs(slope.late) * 1e3:.3g} ms later than the {than}"
    remedy = f'signals.{late} = "" (the {used} alone is used)'
    return [Finding(what, late, "warning", 0.95, remedy, late_channel=late, late_by=abs(slope.late))]


def without_late(log: Log, late: Finding) -> Log:
    """The log without a velocity that is later than the position, or with a position that is put where the velocity has
    it by now: as they are, both would be a lag of the axis."""
    channels = dict(log.channels)
    if late.late_channel == "velocity":
        del channels["velocity"]
    else:
        channels["position"] = channels["position"] + late.late_by * channels["velocity"]
    return replace(log, channels=channels)


def check_jumps(log: Log, restarts: Sequence[int]) -> list[Finding]:
    """Findings about a position that jumps as no axis can, but where another recording begins."""
    if "position" not in log:
        return []
    found, said = continuous(log["position"]), []
    if found.wrong:
        what = f"{len(found.wrong)} position(s) are off by themselves, first in sample {found.wrong[0]}"
        said.append(Finding(what, "position", "warning", 0.95, "they are taken as between their neighbours"))
    if jumps := [at for at in found.jumps if at not in restarts]:
        what = f"position jumps {len(jumps)} time(s) as no axis can, first in sample {jumps[0]}"
        remedy = "a new zero? The log is taken in pieces there"
        said.append(Finding(what, "position", "warning", 0.95, remedy))
    return said


def _wraps(stretches: Sequence[Stretch]) -> list[Finding]:
    wraps = sum(s.wraps for s in stretches)
    if not wraps:
        return []
    turn = next(s.turn for s in stretches if s.wraps)
    what = f"position wraps: it jumps by {turn:.6g} {'once' if wraps == 1 else f'{wraps} times'}"
    return [Finding(f"{what}, and every command undoes it", "position", "note", 0.99)]


def _counts(stretches: Sequence[Stretch]) -> list[Finding]:
    if not _whole_numbers(stretches):
        return []
    turn = next((s.turn for s in stretches if s.wraps), 0.0)
    what = "position holds whole numbers only: counts of an encoder?"
    if turn:
        return [Finding(what, "position", "warning", 0.9, multiply=(("position", _TURN / turn),))]
    return [Finding(what, "position", "warning", 0.9, "signals.position_scale = 6.28319 / counts per turn")]


def _whole_numbers(stretches: Sequence[Stretch]) -> bool:
    """Whether every position is a whole number, and there are more than a few of them."""
    channels = [s.position for s in stretches if s.position is not None]
    if not channels:
        return False
    q = np.concatenate(channels)
    return bool(np.all(q == np.rint(q)) and np.unique(q[: 1 << 16]).size > 10)


def degrees(band: Band) -> Finding | None:
    """A step of the encoder that is a round share of 360, and none of a turn in rad."""
    per_turn = 360.0 / band.step if band.step > 0.0 and band.source == "position" else 0.0
    if not power_of_two(per_turn):
        return None
    what = f"position has steps of 360/{per_turn:.0f}: is it in degrees?"
    return Finding(what, "position", "warning", 0.8, multiply=(("position", _RAD),))


def power_of_two(counts: float) -> bool:
    """From 256 on, as counts per turn are."""
    near = round(counts)
    return near >= 256 and abs(counts - near) < 1e-4 * near and math.log2(near).is_integer()


#: Factors of the config that may be taken away, each in turn and then both.
_TAKEN = (("position",), ("velocity",), ("position", "velocity"))
#: An inertia that is nearer to one of two values than this (natural logarithm) tells which motion is right.
_TELLS = 0.7


def settled(
    found: Sequence[Finding], applied: Mapping[str, float], view: View, off: float | None
) -> tuple[list[Finding], bool]:
    """(the findings, of which those on a factor say as well what in the config makes it, whether there are any).

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


def in_one(found: Sequence[Finding], signs: Sequence[Finding]) -> list[Finding]:
    """All findings; where the velocity has another size and the other sign than the slope, neither mends it alone."""
    sized = [one for one in found if one.ratio and one.multiply]
    if not sized or not signs or not signs[0].multiply or signs[0].multiply[0][0] == "u":
        return [*found, *signs]
    both = [replace(f, what=f"{f.what}; {signs[0].what}", multiply=f.multiply + signs[0].multiply) for f in sized]
    return [*both, *(one for one in found if one not in sized), *signs[1:]]


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
