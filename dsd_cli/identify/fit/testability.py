"""What recordings contain, whether they can be fitted at all, and which effects can be tested on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dsd_cli.effects import Ranges, catalogue, get_effect, kind_of
from dsd_cli.errors import DataError, TooShort
from dsd_cli.identify.fit.equations import Equations
from dsd_cli.identify.fit.priors import PriorKnowledge
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.levels import Deviations
from dsd_cli.identify.recordings.recording import Recording, check_one_rate
from dsd_cli.plant.model import PlantModel


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
        speed=float(np.sqrt(np.mean(moving**2))) if moving.size else 0.0,
        top_speed=float(np.abs(moving).max(initial=0.0)),
        travel=travel,
        drive=float(np.sqrt(np.mean(u**2))),
        top_drive=float(np.quantile(np.abs(u), POLICY.exercised)) if u.size else 0.0,
        sample_time=equations.sample_time,
        duration=sum(len(log) for log in logs) * equations.sample_time,
        resolution=POLICY.resolved_deviations * max(r.position_noise for r in equations.recordings),
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
    inverse : whether u by the motion is evidence, however large J a is; else that decides (`fit.direction`).
    """

    effects: tuple[str, ...] | None = None
    known: PriorKnowledge = field(default_factory=PriorKnowledge)
    band: float = 1.0
    taken: tuple[str, ...] = ()
    against: tuple[str, ...] | None = None
    levels: tuple[Deviations, ...] | None = None
    begun: PlantModel | None = None
    begun_with: tuple[str, ...] = ()
    inverse: bool = False

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
        if get_effect(name).listed and len(recordings) > 1:
            reason = "a push belongs to one log; diagnose the logs one by one"
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
