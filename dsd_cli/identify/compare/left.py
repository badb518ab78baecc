"""What a model leaves, sample by sample of d_hat or row by row of the balance of forces, beside what the axis does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.compare.balance import Balance
from dsd_cli.identify.compare.evaluation import Evaluation, rms
from dsd_cli.signals.log import Array, Log


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
class Part:
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

    parts: tuple[Part, ...]
    interval: float
    time_constant: float
    least: float = 0.0

    def pooled(self, of: Callable[[Part], Array]) -> Array:
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
    by_stretch = zip(
        equations.stretches,
        equations.owners,
        equations.centres,
        equations.row_times,
        equations.by_stretch(balance.residual),
        equations.by_stretch(equations.kept),
        strict=True,
    )
    for stretch, owner, centres, interval, residual, kept in by_stretch:
        recording = equations.recordings[owner]
        rest = max(balance.model.rest_speed, recording.rest_speed)
        parts.append(Part(recording.name, stretch.log, rest, centres[kept], residual[kept], residual, interval))
    return Left(tuple(parts), equations.band.step * equations.sample_time, time_constant, balance.least)


def left_of_d_hat(evaluation: Evaluation) -> Left:
    """Measured less predicted d_hat, of all samples that count."""
    parts = tuple(
        Part(
            s.name,
            s.log,
            s.model.rest_speed,
            np.arange(s.first, len(s.log)),
            s.errors,
            s.errors,
            evaluation.sample_time,
        )
        for s in evaluation.stretches
    )
    return Left(parts, evaluation.sample_time, evaluation.observer.time_constant)
