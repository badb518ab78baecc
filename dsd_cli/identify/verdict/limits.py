"""What a log itself must have before any verdict on it can be sure: a u that acts, and is not late; a direction."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.effects import Role, get_effect
from dsd_cli.identify.fit.asked import Settings
from dsd_cli.identify.fit.bank import SHARE
from dsd_cli.identify.fit.problem import pose
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.sets import Search
from dsd_cli.signals.log import with_channels

#: Samples over which the median of u is taken: single wrong ones, and runs of ten that a slower logger holds.
_MEDIANS = (3, 21)
#: Share of the squares that a u which is not late may leave: a missing force leans like lag, but leaves more.
_EXPLAINED = 0.25
#: What they take off u, rms, as a share of it: less is no spike.
_SPIKY = 0.05
#: And their largest, in units of that: noise has 5, and a u that switches has 2; its edges are no spikes.
_CREST = 8.0


@dataclass(frozen=True)
class Idle:
    """Spikes of u that did not act. samples : width of the median that takes them off; left, found : held-out rms
    with it, without any effect on the command, and of all that was found with u as it is logged, unit of u."""

    samples: int
    left: float
    found: float


@dataclass(frozen=True)
class Limits:
    """late : s by which u is later than the motion that it causes; 0 if it is not. idle : spikes of u that did not act.
    told : share of the samples in motion whose direction the sensor tells, 0 to 1."""

    late: float
    idle: Idle | None
    told: float

    @property
    def surest(self) -> float:
        """Upper bound on the probability of any verdict."""
        return POLICY.surest if self.told >= POLICY.least_told_direction else POLICY.surest_untold

    @property
    def blocked(self) -> str:
        """What must be mended before anything that is missing can be told; "" if nothing."""
        if self.idle is not None:
            return "spikes of u did not act on the axis"
        if self.late:
            return f"u is later than the motion that it causes, by about {self.late * 1e3:.2g} ms"
        return ""

    @property
    def said(self) -> tuple[str, ...]:
        """One sentence each."""
        found = []
        if self.idle is not None:
            found.append(
                f"{self.blocked}: with the median of u over {self.idle.samples} samples in its place forces alone leave"
                f" {self.idle.left:.3g}, less than any effects on u as it is logged ({self.idle.found:.3g}). Is u"
                " logged more slowly than the drive runs, or are cells wrong?"
            )
        elif self.late:
            found.append(
                f"{self.blocked} (dsd check measures it): another clock, or a filtered u? Take that off"
                " signals.u_shift and ask again"
            )
        if self.told < POLICY.least_told_direction:
            found.append(
                f"the sensor tells the direction of the motion in {100.0 * self.told:.0f} % of the samples in which the"
                " axis moves: friction cannot be told from other forces; a finer encoder or faster moves would help"
            )
        return tuple(found)


def limits_of(search: Search, whole: Fit, settings: Settings) -> Limits:
    """Of the recordings of a search, beside the set that was found."""
    stretches = search.equations.stretches
    sign, free = (np.concatenate(x) for x in zip(*((s.sign, s.free) for s in stretches), strict=True))
    moving = free > 0.0
    told = float(np.mean(np.abs(sign[moving]))) if moving.any() else 1.0
    return Limits(_late(search, whole), _idle(search, whole, settings), told)


def _idle(search: Search, whole: Fit, settings: Settings) -> Idle | None:
    """Where forces alone, with the spikes of u taken off, leave less than all that was found with them."""
    problem, rmse = search.problem, search.problem.errors.rmse
    before, found = rmse(search.refit), rmse(whole)
    if before < POLICY.floor_factor * problem.floor:
        return None
    effects = problem.scale.model(whole).effects
    forces = {name: values for name, values in effects.items() if get_effect(name).role is not Role.INPUT}
    model, best = replace(problem.model, effects=forces), None
    for samples in _MEDIANS:
        recordings = [_despiked(r, samples) for r in problem.recordings]
        if recordings[0] is problem.recordings[0]:
            continue
        without = pose(recordings, model, settings)
        left = without.errors.rmse(Search(without).refit)
        if left < (1.0 - POLICY.near_fall) * found and (best is None or left < best.left):
            best = Idle(samples, left, found)
    return best if best is not None and problem.falls(before, best.left, search.refit) else None


def _despiked(recording: Recording, samples: int) -> Recording:
    """With the median of u over so many samples in its place; the same one where that takes no spikes off."""
    from scipy.ndimage import median_filter

    smooth = [median_filter(p["u"], samples, mode="nearest") for p in recording.pieces]
    u, off = (
        np.concatenate(x)
        for x in zip(*((p["u"], p["u"] - m) for p, m in zip(recording.pieces, smooth, strict=True)), strict=True)
    )
    size = float(np.std(off))
    if size < _SPIKY * float(np.std(u)) or float(np.max(np.abs(off))) < _CREST * size:
        return recording
    pieces = tuple(with_channels(p, u=m) for p, m in zip(recording.pieces, smooth, strict=True))
    return replace(recording, pieces=pieces)


def _late(search: Search, fit: Fit) -> float:
    """s by which u is late where the delay of a fit stands at 0 and less would explain most of what is left."""
    at_zero = fit.tap == 0 and float(fit.total[SHARE]) == 0.0 and len(search.taps) > 1
    if not at_zero or search.problem.blocks.rows < POLICY.few_rows:
        return 0.0
    late, error, left, before = _freed(search, fit)
    certain = late > max(POLICY.value_deviations * error, search.equations.sample_time)
    return late if certain and left < _EXPLAINED * before else 0.0


def _freed(search: Search, fit: Fit) -> tuple[float, float, float, float]:
    """(s by which u is late if the delay may have any sign, its standard error; squares then, and as they are)."""
    bank = search.solver.bank
    rows = np.stack(bank.design(fit.terms, fit.tap).rows)
    kept = [i for i, theta in enumerate(fit.total) if theta != 0.0 or i == SHARE]
    x, at = rows[1:][kept], kept.index(SHARE)
    theta = np.linalg.lstsq(x.T, rows[0], rcond=None)[0]
    left, before = rows[0] - theta @ x, rows[0] - fit.total @ rows[1:]
    variance = float(np.linalg.pinv(x @ x.T)[at, at] * np.mean(left**2) * search.noise.inflation)
    late, error = -float(theta[at]) * bank.tap_time, math.sqrt(variance) * bank.tap_time
    return late, error, float(left @ left), float(before @ before)
