"""The d_hat that one model predicts beside the measured one, and how large the difference is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsd_cli.errors import TooShort
from dsd_cli.identify.recordings.recording import Recording, check_one_rate
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import Frame, predict_d_hat
from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.rounding import ROUNDING
from dsd_cli.signals.spread import rms

#: Rows at the start of a piece that a d_hat computed from position cannot fill.
UNFILLED = 2
#: Time constants after which Q has forgotten what was before the log.
SETTLED = 5.0
#: Fewest samples that are judged.
FEWEST = 50


@dataclass(frozen=True)
class Stretch:
    """One piece of a recording under the model; arrays of shape (n,), unit of u, over the whole piece.

    log : the piece, with t, u, d_hat and the motion that could be had.
    model : with the rest speed of the recording.
    first : the rows before it depend on unlogged u; excluded.
    predicted : d_hat of the model; residual is the measured one less that.
    net : Q { Jn a } as measured, Q{u} + d_hat.
    drive : Q of the delayed u after input effects.
    """

    name: str
    log: Log
    model: PlantModel
    first: int
    predicted: Array
    residual: Array
    net: Array
    drive: Array

    def judged(self, x: Array) -> Array:
        """The rows of x that count."""
        return x[self.first :]

    @property
    def errors(self) -> Array:
        """The residual of the rows that count."""
        return self.residual[self.first :]


@dataclass(frozen=True)
class Evaluation:
    """All stretches of one or more recordings under one model.

    `lead` : s at the start of each stretch that do not count: until L the plant gets a u from before the log, which Q
    then forgets; `skipped` : rows that this leaves out.
    """

    model: PlantModel
    observer: ObserverSettings
    stretches: tuple[Stretch, ...]
    lead: float
    skipped: int
    sample_time: float

    def pooled(self, of: Callable[[Stretch], Array]) -> Array:
        """`of` each stretch, rows that count, one after the other."""
        return np.concatenate([of(s)[s.first :] for s in self.stretches])

    @property
    def errors(self) -> Array:
        """The residual of all rows that count."""
        return self.pooled(lambda s: s.residual)

    def of(self, name: str) -> Evaluation:
        """That recording alone."""
        return replace(self, stretches=tuple(s for s in self.stretches if s.name == name))


@dataclass(frozen=True)
class Accuracy:
    """How far off, over the samples that count.

    rmse, bias, max_error : of e = d_hat - predicted d_hat, unit of u; bias is the mean of e.
    fit_percent : 100 (1 - |e| / |y - mean y|) for y = d_hat; negative is worse than a constant; None if y is one.
    vaf_percent : 100 (1 - var e / var y).
    relative_error_percent : 100 rms(e) / rms(Q{u} + d_hat): of the acceleration that was observed.
    relative_force_error_percent : 100 rms(J/Jn e) / rms(Q{u}): what is missing in u = J a - forces, of u; the "relative
        force error" of robot identification.
    """

    samples: int
    rmse: float
    fit_percent: float | None
    vaf_percent: float | None
    bias: float
    max_error: float
    relative_error_percent: float | None
    relative_force_error_percent: float | None


def evaluate(recordings: Sequence[Recording], model: PlantModel, observer: ObserverSettings) -> Evaluation:
    """The model's prediction for every piece; the recordings' d_hat has the sign of eq. 13.

    Raises DataError : sample times that differ, an effect without its channel, or too few samples.
    """
    positive = replace(observer, sign=1)
    lead = model.delay + SETTLED * observer.time_constant
    check_one_rate(recordings)
    stretches, skipped = [], 0
    for recording in recordings:
        own = replace(model, rest_speed=max(model.rest_speed, recording.rest_speed))
        for piece in recording.pieces:
            stretch = _stretch(recording.name, piece, own, positive, lead)
            skipped += min(stretch.first, len(piece))
            if stretch.first < len(piece):
                stretches.append(stretch)
    evaluation = Evaluation(model, positive, tuple(stretches), lead, skipped, recordings[0].sample_time)
    if sum(len(s.log) - s.first for s in stretches) < FEWEST:
        raise TooShort(
            f"{recordings[0].name}: too short: fewer than {FEWEST} samples are left after the first {lead:g} s",
            "these rest on u before the log (delay and 5 observer time constants)",
        )
    return evaluation


def _stretch(name: str, piece: Log, model: PlantModel, observer: ObserverSettings, lead: float) -> Stretch:
    predicted = predict_d_hat(model, piece, observer)
    frame, t = Frame(piece), piece["t"]
    w = frame.seen(frame.mean_u(piece["u"], 0.0), observer)
    drive = frame.seen(frame.mean_u(frame.command(model.effects), model.delay), observer)
    settled = int(np.searchsorted(t - t[0], lead * (1.0 - ROUNDING)))
    return Stretch(
        name=name,
        log=piece,
        model=model,
        first=max(settled, UNFILLED),
        predicted=predicted,
        residual=np.asarray(piece["d_hat"] - predicted),
        net=np.asarray(w + piece["d_hat"]),
        drive=drive,
    )


def accuracy(evaluation: Evaluation) -> Accuracy:
    """The error numbers over all stretches."""
    errors = evaluation.errors
    measured = evaluation.pooled(lambda s: s.log["d_hat"])
    scale = evaluation.model.motor_inertia / evaluation.observer.nominal_inertia
    size = rms(errors)
    spread = rms(measured - measured.mean())
    return Accuracy(
        samples=errors.size,
        rmse=size,
        fit_percent=percent_left(size, spread),
        vaf_percent=percent_left(float(np.var(errors)), float(np.var(measured))),
        bias=float(errors.mean()),
        max_error=float(np.abs(errors).max()),
        relative_error_percent=_percent(size, rms(evaluation.pooled(lambda s: s.net))),
        relative_force_error_percent=_percent(scale * size, rms(evaluation.pooled(lambda s: s.drive))),
    )


def _percent(part: float, whole: float) -> float | None:
    return 100.0 * part / whole if whole > 0.0 else None


def percent_left(part: float, whole: float) -> float | None:
    """100 (1 - part / whole); None of nothing."""
    share = _percent(part, whole)
    return None if share is None else 100.0 - share
