"""What recordings contain, whether they can be fitted at all, and which effects can be tested on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dsd_cli.effects import Ranges, Role, catalogue, get_effect, kind_of
from dsd_cli.errors import DataError, TooShort
from dsd_cli.identify.fit.bank import INERTIA as OF_INERTIA
from dsd_cli.identify.fit.bank import Bank, Terms
from dsd_cli.identify.fit.blocks import condensed
from dsd_cli.identify.fit.direction import as_rests_allow
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.fit.values import Fitted
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import SMOOTHED, Deviations
from dsd_cli.identify.recordings.recording import Recording, check_one_rate
from dsd_cli.identify.results import INERTIA
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array
from dsd_cli.signals.spread import rms


def constant_u(recordings: Sequence[Recording]) -> bool:
    """Whether u is one number in all of them."""
    return len({end for r in recordings for p in r.pieces for end in (float(p["u"].min()), float(p["u"].max()))}) < 2


def ranges(equations: Equations) -> Ranges:
    """What the recordings contain, for starting shapes."""
    logs = [s.log for s in equations.stretches]
    speeds = [s.mean.velocity[s.free > 0.0] for s in equations.stretches]
    speed = np.concatenate(speeds) if speeds else np.zeros(1)
    u = np.concatenate([log["u"] for log in logs])
    travel = max((float(np.ptp(log["position"])) for log in logs if "position" in log), default=0.0)
    way = max((float(np.sum(np.abs(np.diff(log["position"])))) for log in logs if "position" in log), default=0.0)
    moving = speed[np.isfinite(speed)]
    return Ranges(
        speed=rms(moving),
        top_speed=float(np.abs(moving).max(initial=0.0)),
        travel=travel,
        drive=rms(u),
        top_drive=float(np.quantile(np.abs(u), POLICY.exercised)) if u.size else 0.0,
        sample_time=equations.sample_time,
        duration=sum(len(log) for log in logs) * equations.sample_time,
        resolution=POLICY.resolved_deviations
        * max(math.hypot(r.position_noise, r.lost.way) for r in equations.recordings),
        band_hz=equations.band.hz,
        passes=way / travel if travel > 0.0 else 0.0,
        spike_drive=float(np.abs(u).max(initial=0.0)),
    )


#: What is below this share of the largest position, speed or u is rounding.
ROUNDING = 1e-7


@dataclass(frozen=True)
class Settings:
    """effects : candidates; None is all of the catalogue that the model does not have, and those that repeat.

    known : of values, by the user.
    band : factor on the end of the band that the sensor suggests.
    taken : effects of the model that this climb took: they may stand in for a value that is given wrongly.
    against : what the log says against what is known, once that was looked at (`verdict.diagnose.prior_check`).
    levels : of single logs, found with nothing given; None to look for them.
    begun : a model with the set that the last rung found: one of those that the search weighs; `begun_with` : effects
        of that set that the climb took since it was found.
    inverse : whether u by the motion is evidence, however large J a is; None: that decides (`fit.direction`).
    linear : whether the position is known to be a length.
    """

    effects: tuple[str, ...] | None = None
    known: PriorKnowledge = field(default_factory=PriorKnowledge)
    band: float = 1.0
    taken: tuple[str, ...] = ()
    against: tuple[str, ...] | None = None
    levels: tuple[Deviations, ...] | None = None
    begun: PlantModel | None = None
    begun_with: tuple[str, ...] = ()
    inverse: bool | None = None
    linear: bool = False

    def without(self, refused: Sequence[str]) -> Settings:
        """The same without effects that raise the held-out error, and others of their kind."""
        kinds = {kind_of(name) for name in refused}
        wanted = self.effects if self.effects is not None else tuple(catalogue())
        return replace(self, effects=tuple(name for name in wanted if kind_of(name) not in kinds))


def candidates_of(
    recordings: Sequence[Recording], holdout: Sequence[Recording], model: PlantModel, settings: Settings
) -> tuple[tuple[str, ...], dict[str, str]]:
    """(effects that can be tried, effect -> why it cannot)."""
    wanted = settings.effects if settings.effects is not None else tuple(catalogue())
    missing = {channel: why for r in (*recordings, *holdout) for channel, why in r.missing.items()}
    testable, untestable = [], {}
    for name in wanted:
        reason = next((missing[c] for c in get_effect(name).needs if c in missing), "")
        if settings.linear and get_effect(name).of_angle:
            reason = "the position is a length, no angle"
        if get_effect(name).listed and len(recordings) > 1:
            reason = "a push belongs to one log; diagnose the logs one by one"
        if get_effect(name).lateness is not None and any(SMOOTHED in r.taken_off for r in recordings):
            reason = "it looks just like the filter of u that was undone"
        if reason:
            untestable[name] = reason
        elif name not in model.effects or get_effect(name).repeats is not None:
            testable.append(name)
    return tuple(testable), untestable


def check_recordings(recordings: Sequence[Recording], model: PlantModel) -> None:
    check_one_rate(recordings)
    for recording in recordings:
        for channel, effect in model.needs().items():
            if channel in recording.missing:
                raise DataError(f"{recording.name}: effect {effect} needs {channel}", recording.missing[channel])


def check_used(recordings: Sequence[Recording], equations: Equations) -> None:
    name = recordings[0].name
    used = {id(s.log) for s in equations.stretches}
    short = [r.name for r in recordings if not any(id(p) in used for p in r.pieces)]
    if short:
        needed = (equations.startup + max(len(b.taps) for b in equations.bands)) * equations.sample_time
        raise TooShort(
            f"{short[0]}: too short: no stretch is longer than {needed:.2g} s", "leave it out, or log longer"
        )
    if float(np.mean(equations.kept)) < POLICY.least_moving or not _moves(equations):
        raise DataError(f"{name}: the axis does not move", "a log with moves in both directions is needed")
    if not ranges(equations).drive > 0.0:
        raise DataError(f"{name}: u is 0 throughout", "set signals.u to the column with the control input")


def _moves(equations: Equations) -> bool:
    """Whether position and speed change by more than rounding."""
    for piece in (s.log for s in equations.stretches):
        if "velocity" in piece and float(np.abs(piece["velocity"]).max()) > 0.0:
            place = piece["position"] if "position" in piece else np.cumsum(piece["velocity"])
            if float(np.ptp(place)) > ROUNDING * max(float(np.abs(place).max()), 1e-300):
                return True
    return False


def told_by(
    bank: Bank, fitted: Fitted, beside: Terms, known: PriorKnowledge, *, zero: bool, rests: bool = True
) -> Fitted:
    """Values without the error of those that the rows do not identify, whatever they scatter by.

    bank : of rows in the unit of u. beside : effects that the log may hold as well. zero : whether that of the position
    is known. rests : whether errors have what they leave open.
    """
    fitted = fitted if zero else _without_zero(fitted, fitted.fit.terms, known)
    open_ = _not_identified(bank, fitted, beside) if INERTIA not in known.names else []
    of_open = {n: e for n, e in fitted.estimates.items() if n.partition(".")[0] in open_}
    unknown = {n: replace(e, std_error=math.nan, grade="not") for n, e in of_open.items()}
    told = replace(fitted, estimates={**fitted.estimates, **unknown})
    return as_rests_allow(bank, told, beside) if rests else told


def _not_identified(bank: Bank, fitted: Fitted, beside: Terms) -> list[str]:
    """Inertia and effects whose force has, beside a delay and all others, no part of its own that counts as a force.

    In ramps of u, as of a quasi-static test, J a, dry friction and a delay are each one constant a direction: an
    inertia is then what small forces make of it, however well rows agree on it. Where J a is identified so is the rest.
    """
    fit, kept = fitted.fit, bank.equations.kept
    every = (*fit.terms, *(t for t in beside if t.id not in {own.id for own in fit.terms}))
    design = bank.design(every, fit.tap)
    rows = condensed([x[kept] for x in design.rows])
    least = (POLICY.least_unknown * float(np.linalg.norm(rows[0]))) ** 2
    a, noise = 1 + OF_INERTIA, float(design.noise[OF_INERTIA, OF_INERTIA]) * np.count_nonzero(kept)
    if fitted.model.inertia**2 * (_own(rows, slice(a, a + 1), np.ones(1)) - noise) > least:
        return []
    places = {t.id: fit.columns_of(t) for t in fit.terms}
    at = {name: slice(1 + x.start, 1 + x.stop) for name, x in places.items() if x.stop > x.start}
    return [INERTIA, *(n for n, x in at.items() if _own(rows, x, fit.total[places[n]]) < least)]


def _own(rows: Array, at: slice, weights: Array) -> float:
    """Squares of what some of the rows, shape (1 + p, N), add up to beside all others (but the first)."""
    others = np.delete(rows, at, axis=0)[1:]
    size = np.maximum(np.linalg.norm(others, axis=1, keepdims=True), 1e-300)
    _, strengths, basis = np.linalg.svd(others / size, full_matrices=False)
    basis = basis[strengths > strengths.max(initial=0.0) * rows.shape[1] * np.finfo(float).eps]  # others may be alike
    force = weights @ rows[at]
    return float(np.sum((force - (basis @ force) @ basis) ** 2))


def _without_zero(fitted: Fitted, terms: Terms, known: PriorKnowledge) -> Fitted:
    """Where nobody knows the zero of the position (it was put together from u and d_hat): a phase over the position,
    and a constant force beside a spring, are those of an arbitrary zero and have no error; sizes have theirs."""
    applied = [t for t in terms if t.effect.role is Role.APPLIED]
    by_place = [t for t in applied if tuple(t.effect.needs) == ("position",)]
    lost = {f"{t.id}.{p.name}" for t in by_place for p in t.effect.parameters if p.whole_turn}
    if any(not any(p.whole_turn for p in t.effect.parameters) for t in by_place):
        constant = (t for t in applied if not (t.effect.needs or t.effect.repeats))
        lost |= {f"{t.id}.{p.name}" for t in constant for p in t.effect.parameters if not p.listed}
    lost &= fitted.estimates.keys() - known.fixed.keys()
    told = {n: replace(fitted.estimates[n], std_error=math.nan, grade="not") for n in lost}
    return replace(fitted, estimates=fitted.estimates | told)
