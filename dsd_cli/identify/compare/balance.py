"""What one model leaves of the balance of forces, u_eff(t - L) = J a - sum f + r, as `dsd diagnose` looks at it, or of
d_hat, beside what the axis does."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dsd_cli.effects import Role, get_effect
from dsd_cli.errors import DataError
from dsd_cli.identify.compare.evaluation import Evaluation
from dsd_cli.identify.fit.errors import Errors
from dsd_cli.identify.fit.problem import Problem, pose
from dsd_cli.identify.fit.testability import Settings
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.excerpts import excerpts
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.spread import rms


@dataclass(frozen=True)
class Force:
    """How far the balance of forces u_eff(t - L) = J a - sum f + r is off, within the band that the sensor allows.

    rmse : rms of r, unit of u.
    fit_percent : 100 (1 - |r| / |u - mean u|), of u within the band; None if u is constant.
    relative_error_percent : 100 rms(r) / rms(u).
    band_hz : end of the band, Hz.
    floor : rms of r that the noise of the sensor alone leaves, unit of u.
    """

    rmse: float
    fit_percent: float | None
    relative_error_percent: float | None
    band_hz: float
    floor: float


@dataclass(frozen=True)
class ForceView:
    """`log` : of all logs together; `holdout` : of the one set aside, in the same band. `missing` : why one is None.

    by_log : rms of r in each log, unit of u.
    """

    log: Force | None
    holdout: Force | None = None
    missing: str = ""
    by_log: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Balance:
    """The rows of some recordings and one model; no value is fitted to be judged."""

    problem: Problem
    model: PlantModel

    @property
    def errors(self) -> Errors:
        """Of all rows."""
        return self.problem.errors

    @cached_property
    def residual(self) -> Array:
        """r of every row, shape (N,), unit of u; 0 in rows that do not count (`equations.kept`)."""
        return all_rows(self.errors, self.model)

    @cached_property
    def excerpt(self) -> Errors:
        """The richest parts of long recordings, in the same band; of short ones all."""
        recordings = self.problem.recordings
        parts = excerpts(recordings)
        whole = all(part is one for part, one in zip(parts, recordings, strict=True))
        return self.errors if whole else self.problem.errors_for(self.model, parts)

    @property
    def least(self) -> float:
        """rms of a force that matters, unit of u: what explains less of u is no law that is worth a model."""
        return POLICY.least_unknown * self.errors.force

    @cached_property
    def forces(self) -> Forces:
        """The forces beside u, row by row."""
        acts = {n: v for n, v in self.model.effects.items() if get_effect(n).role in (Role.INPUT, Role.STRUCTURE)}
        without = PlantModel(self.model.inertia, self.model.delay, acts, self.model.rest_speed)
        measured, kept = -all_rows(self.errors, without), self.errors.equations.kept
        return Forces(measured[kept], (measured + self.residual)[kept])

    def at_rows(self, channel: str) -> Array:
        """A channel at the rows that count."""
        equations = self.errors.equations
        return np.asarray(equations.of_rows([s.log[channel] for s in equations.stretches])[equations.kept])

    def view(self, holdout: Recording | None = None) -> ForceView:
        """How large r is."""
        whole, each = force_of(self.problem, self.model), self._of_each_log()
        if holdout is None:
            return ForceView(whole, by_log=each)
        try:
            aside = replace(self.problem, recordings=(holdout,), errors=self.problem.errors_for(self.model, [holdout]))
            return ForceView(whole, force_of(aside, self.model), by_log=each)
        except DataError as failure:
            return ForceView(whole, None, str(failure), each)

    def _of_each_log(self) -> dict[str, float]:
        equations = self.errors.equations
        left, owners = self.residual[equations.kept], equations.logs_of_rows[equations.kept]
        names = [r.name for r in self.problem.recordings]
        return {names[i]: rms(left[owners == i]) for i in dict.fromkeys(owners.tolist())}


@dataclass(frozen=True)
class Forces:
    """What acts on the axis beside u, of the rows that count, shape (n,), unit of u, in the band.

    `measured` : J a - u(t - L); `modelled` : the sum of the model's forces. Their difference is what is missing, -r.
    """

    measured: Array
    modelled: Array


def balance_of(recordings: Sequence[Recording], model: PlantModel) -> Balance | str:
    """The balance under this model, or why there is none."""
    try:
        return Balance(pose(recordings, model, Settings(effects=())), model)
    except DataError as failure:
        return str(failure)


def force_view(recordings: Sequence[Recording], model: PlantModel) -> ForceView:
    """How far the balance is off."""
    found = balance_of(recordings, model)
    return ForceView(None, None, found) if isinstance(found, str) else found.view()


def all_rows(errors: Errors, model: PlantModel) -> Array:
    """r of every row, shape (N,), unit of u; 0 in those that do not count."""
    kept = errors.equations.kept
    found = np.zeros(len(kept))
    found[kept] = errors.rows_of_model(model)
    return found


def force_of(problem: Problem, model: PlantModel) -> Force:
    """How far the balance is off in the rows of a problem."""
    score = problem.errors.of_model(model)
    fit, share = (x if math.isfinite(x) else None for x in (score.fit_percent, score.relative_error_percent))
    return Force(score.rmse, fit, share, problem.equations.band.hz, problem.floor)


def acceleration(log: Log, time_constant: float) -> Array:
    """Slope of the speed over a time constant to either side of each sample (two samples at least), shape (n,).

    Wide, so that the noise of single differences, which is the noise of d_hat, is not in it.
    """
    v, t = log["velocity"], log["t"]
    half = max(2, round(time_constant / log.sample_time))
    index = np.arange(len(v))
    before, after = np.maximum(index - half, 0), np.minimum(index + half, len(v) - 1)
    return np.asarray((v[after] - v[before]) / (t[after] - t[before]))


@dataclass(frozen=True)
class PieceResidual:
    """One piece of a recording.

    rows : samples of `log` that count, shape (n,). errors : what is left there, unit of u.
    series : the same every `interval` s, 0 where it does not count, shape (m,).
    rest_speed : speed within which the axis rests.
    """

    name: str
    log: Log
    rest_speed: float
    rows: NDArray[np.int_]
    errors: Array
    series: Array
    interval: float


@dataclass(frozen=True)
class Left:
    """All pieces.

    interval : s from row to row, of the pieces with most. time_constant : over which accelerations are seen, s.
    least : rms that matters, unit of u.
    """

    parts: tuple[PieceResidual, ...]
    interval: float
    time_constant: float
    least: float = 0.0

    def pooled(self, of: Callable[[PieceResidual], Array]) -> Array:
        """`of` each piece, at the rows that count, one after the other."""
        return np.concatenate([of(part)[part.rows] for part in self.parts])

    @property
    def errors(self) -> Array:
        """What is left in all rows that count."""
        return np.concatenate([part.errors for part in self.parts])

    @property
    def bias_share(self) -> float:
        """Share of the squares that is a constant; of the least that matters where less is left."""
        size = max(rms(self.errors), self.least)
        return (float(self.errors.mean()) / size) ** 2 if size > 0.0 else 0.0

    def of(self, name: str) -> Left:
        """Of that recording alone."""
        return replace(self, parts=tuple(part for part in self.parts if part.name == name))


def left_of_forces(balance: Balance, time_constant: float) -> Left:
    """r of the balance, in the band; rows in which friction may hold do not count."""
    equations, parts = balance.errors.equations, []
    of_stretches = equations.stretches, equations.owners, equations.centres, equations.row_times
    left, counting = equations.by_stretch(balance.residual), equations.by_stretch(equations.kept)
    for stretch, owner, centres, interval, residual, kept in zip(*of_stretches, left, counting, strict=True):
        recording = equations.recordings[owner]
        rest = max(balance.model.rest_speed, recording.rest_speed)
        parts.append(
            PieceResidual(recording.name, stretch.log, rest, centres[kept], residual[kept], residual, interval)
        )
    return Left(tuple(parts), equations.band.step * equations.sample_time, time_constant, balance.least)


def left_of_d_hat(evaluation: Evaluation) -> Left:
    """Measured less predicted d_hat, of all samples that count."""
    step = evaluation.sample_time
    parts = tuple(
        PieceResidual(s.name, s.log, s.model.rest_speed, np.arange(s.first, len(s.log)), s.errors, s.errors, step)
        for s in evaluation.stretches
    )
    return Left(parts, step, evaluation.observer.time_constant)
