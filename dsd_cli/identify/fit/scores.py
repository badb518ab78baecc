"""Errors of models by the one prediction of d_hat, on all rows and on rows that no fit saw."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.identify.fit.blocks import Blocks
from dsd_cli.identify.fit.rows import Equations
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.results import Score
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.prediction import Frame, predict_d_hat
from dsd_cli.signals.log import Array


class Judge:
    """Scores models on the recordings of some equations, or on others that were held out altogether."""

    def __init__(self, equations: Equations, blocks: Blocks, holdout: Sequence[Recording] = ()) -> None:
        self.equations, self.blocks = equations, blocks
        self.holdout = tuple(holdout)
        self.observer = replace(equations.observer, sign=1)
        self._rest = max(r.rest_speed for r in equations.recordings)
        self._fold = blocks.fold[equations.block_of_plain_rows(blocks)]
        self._pieces = [(s.log, equations.startup) for s in equations.stretches]
        self._force = _net_force(self._pieces, self.observer)
        self._holdout = [(p, equations.startup) for r in self.holdout for p in r.pieces if len(p) > equations.startup]
        if self.holdout and not self._holdout:
            raise DataError(
                f"{self.holdout[0].name}: not longer than the {equations.startup} samples that a prediction settles in",
                "hold out a longer log",
            )

    def fixed(self, model: PlantModel) -> Score:
        """Of a model whose values no fit of these recordings chose."""
        return self._score(model, lambda _: model)

    def fitted(self, models: Sequence[PlantModel], total: PlantModel) -> Score:
        """Of `total`, fitted to everything, with the held-out error of the models that held a fold out each."""
        return self._score(total, lambda fold: models[fold])

    def _score(self, total: PlantModel, of_fold: Callable[[int], PlantModel]) -> Score:
        errors, measured = self._errors(self._pieces, total)
        rmse = _rms(errors)
        if self.holdout:
            held = _rms(self._errors(self._holdout, total)[0])
        elif of_fold(0) is total:
            held = rmse
        else:
            held = self._held_out(of_fold)
        spread = _rms(measured - measured.mean())
        relative = rmse / max(self._force, 1e-300)
        fit = 100.0 * (1.0 - rmse / spread) if spread > 0.0 else math.nan
        return Score(rmse, held, fit, 100.0 * relative)

    def _held_out(self, of_fold: Callable[[int], PlantModel]) -> float:
        total = 0.0
        for fold in range(self.blocks.folds):
            errors, _ = self._errors(self._pieces, of_fold(fold))
            total += float(np.sum(errors[self._fold == fold] ** 2))
        return math.sqrt(total / len(self._fold))

    def _errors(self, pieces: Sequence[tuple], model: PlantModel) -> tuple[Array, Array]:
        """(measured less predicted d_hat, measured), joined, without the start of each piece."""
        used = replace(model, rest_speed=max(model.rest_speed, self._rest))
        predicted = [predict_d_hat(used, log, self.observer)[first:] for log, first in pieces]
        measured = [log["d_hat"][first:] for log, first in pieces]
        d_hat = np.concatenate(measured)
        return d_hat - np.concatenate(predicted), d_hat


def _net_force(pieces: Sequence[tuple], observer: ObserverSettings) -> float:
    """rms of Jn a as the observer sees it, d_hat + Q u, unit of u."""
    parts = []
    for log, first in pieces:
        frame = Frame(log)
        parts.append((log["d_hat"] + frame.seen(frame.mean_u(log["u"], 0.0), observer))[first:])
    return _rms(np.concatenate(parts))


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2))) if x.size else math.nan
