"""Inner products of the rows of a motion under an effect: all that the expected evidence needs, and they add up.

The rows are those of the search (`fit.bank`): drive, acceleration, change of the drive with the delay, the effects' own
columns; and behind them the slope of what they take over each shape parameter, so that a rival whose shape can follow
does so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dsd_cli.design.inverse import Path, as_recording
from dsd_cli.design.seen import as_seen, times_white
from dsd_cli.effects import Channels, Role
from dsd_cli.identify.fit.band import Band, band_of
from dsd_cli.identify.fit.bank import FIXED, INERTIA, Term, Terms, columns_of, commands, has_friction, inputs_of
from dsd_cli.identify.fit.direction import held_weight
from dsd_cli.identify.fit.equations import Equations, equations_of
from dsd_cli.identify.fit.row_weights import many_sure
from dsd_cli.identify.fit.stretches import Stretch
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.identify.search.sets import Search
from dsd_cli.plant.forces import interval_forces
from dsd_cli.plant.model import EffectValues, PlantModel
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.log import Array, with_channels

#: Relative step of the slopes over shapes.
_STEP = 0.02
#: s between the samples of a planned motion, at most, while it is looked for.
LONGEST_STEP = 0.005


@dataclass(frozen=True, eq=False)
class Model:
    """Effects with shapes, a delay in s, and the coefficients of `fit.solve.Fit.total`, shape (p,)."""

    terms: Terms
    delay: float
    tap_time: float
    total: Array
    widths: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of rows of the Gram matrix, the drive's included."""
        return 1 + len(self.total) + len(shapes_of(self.terms))


@dataclass(frozen=True, eq=False)
class Products:
    """Inner products of the rows of a motion under several models, shape (K, P, P), how many rows there are, and the
    squares of acceleration and of u beside a weight in all of them, not whitened, shape (2,)."""

    rows: float
    grams: Array
    moved: Array

    def __add__(self, other: Products) -> Products:
        """Of one motion after the other."""
        return Products(self.rows + other.rows, self.grams + other.grams, self.moved + other.moved)

    def __rmul__(self, times: float) -> Products:
        """Of a motion that is made so many times."""
        return Products(times * self.rows, times * self.grams, times * self.moved)


def shapes_of(terms: Terms) -> list[tuple[int, str, float]]:
    """(term, name, value) of the shapes that are searched: as `fit.covariance.Information.shapes`."""
    return [(i, n, v) for i, t in enumerate(terms) for n, v in t.items if isinstance(v, float) and v > 0.0]


def planning_step(band: Band) -> float:
    """s between samples while a motion is looked for: a whole part of a row, fine enough for the band."""
    fits = [k for k in range(1, band.step + 1) if band.step % k == 0]
    most = min(LONGEST_STEP, POLICY.highest_share / band.hz)
    return max((k for k in fits if k * band.sample_time <= most), default=1) * band.sample_time


class MotionRows:
    """The rows of one motion under one command.

    equations : of the motion, in the rows of the log (`equations_like`). shared : columns that other commands on the
        same motion have made.
    """

    def __init__(self, equations: Equations, shared: dict[Any, list[Array]] | None = None) -> None:
        self.equations = equations
        self._shared: dict[Any, list[Array]] = {} if shared is None else shared
        self._drives: dict[Any, Array] = {}

    def under(self, u: Array) -> MotionRows:
        """The same motion (of one stretch) under another command, shape (n,)."""
        (stretch,) = self.equations.stretches
        log = with_channels(stretch.log, u=u)
        moved = replace(stretch, log=log, frame=Frame(log))
        return MotionRows(replace(self.equations, stretches=(moved,)), self._shared)

    def gram(self, model: Model) -> Array:
        """Inner products of the rows, shape (`Model.size`, `Model.size`)."""
        rows = self.rows(model)
        return np.asarray(rows @ rows.T)

    def moved(self, model: Model) -> Array:
        """Squares of acceleration and of what the actuator makes of u beside a weight, shape (2,)."""
        u = self.equations.commanded(commands(self.equations, inputs_of(model.terms)), model.delay, held=False)
        return np.array([np.sum(self.equations.acceleration() ** 2), np.sum((u - held_weight(self.equations, u)) ** 2)])

    def rows(self, model: Model) -> Array:
        """Drive, columns, slopes over shapes; shape (`Model.size`, N)."""
        found = self._linear(model.terms, model)
        weights = np.concatenate([[-1.0], model.total])
        slopes = []
        for i, name, value in shapes_of(model.terms):
            ends = []
            for factor in (1.0 + _STEP, 1.0 - _STEP):
                terms = list(model.terms)
                terms[i] = Term.of(terms[i].id, {**terms[i].shape, name: value * factor})
                ends.append(weights @ self._linear(tuple(terms), model, i))
            slopes.append((ends[0] - ends[1]) / (2.0 * _STEP))
        return np.concatenate([found, np.stack(slopes)]) if slopes else found

    def _linear(self, terms: Terms, model: Model, changed: int = -1) -> Array:
        """Drive, acceleration, change with the delay, columns; what does not change with one term is left 0."""
        held, inputs = has_friction(terms), inputs_of(terms)
        nothing = np.zeros(sum(self.equations.lengths))
        rows = [nothing] * (1 + FIXED)
        if changed < 0 or terms[changed].effect.role is Role.INPUT:
            drive, later = (self._drive(inputs, model.delay + k * model.tap_time, held) for k in (0, 1))
            rows = [drive, self._acceleration() if changed < 0 else nothing, drive - later]
        for i, (term, width) in enumerate(zip(terms, model.widths, strict=True)):
            same = width and changed not in (-1, i)
            rows += [nothing] * width if same else self._columns(term, model.delay, held) if width else []
        return np.stack(rows)

    def _drive(self, inputs: Terms, delay: float, held: bool) -> Array:
        key = (inputs, delay, held)
        if key not in self._drives:
            equations = self.equations
            self._drives[key] = equations.whitened(equations.commanded(commands(equations, inputs), delay, held))
        return self._drives[key]

    def _columns(self, term: Term, delay: float, held: bool) -> list[Array]:
        if "u" in term.effect.needs:
            return [self.equations.whitened(x) for x in columns_of(self.equations, term, delay, held)]
        key = (term, held)
        if key not in self._shared:
            self._shared[key] = [self.equations.whitened(x) for x in columns_of(self.equations, term, delay, held)]
        return self._shared[key]

    def _acceleration(self) -> Array:
        if INERTIA not in self._shared:
            self._shared[INERTIA] = [self.equations.whitened(self.equations.acceleration())]
        return self._shared[INERTIA][0]


def equations_like(form: tuple[Band, Array], recording: Recording, delay: float, held: bool) -> Equations:
    """Rows of a planned motion in a band, at the samples of the logs, and with that whitening.

    held : there may be friction: rows in which the direction is not sure say nothing. Where few are sure, as of a
        short part in a narrow band, all count: as in the search.
    """
    (band, taps), step = form, recording.sample_time
    if not math.isclose(step, band.sample_time):
        part = round(step / band.sample_time)
        band = replace(band_of(min(band.hz, POLICY.highest_share / step), step), step=max(band.step // part, 1))
    found = equations_of([recording], math.ceil(delay / step) + 3, band).with_whitening(taps)
    if not (held and found.stretches and taps.any()):  # a sensor that shows nothing of it tells no direction either
        return found
    sure = many_sure(found)
    return found if sure is None else replace(found, row_weight=sure.astype(np.float64))


@dataclass(frozen=True)
class LikeLogs:
    """How motions become rows.

    template : a log of the axis. delay : s, the longest of all plants. held : whether there may be friction.
    form : band and whitening, of that log which shows most.
    """

    template: Recording
    rest_speed: float
    delay: float
    held: bool
    form: tuple[Band, Array]

    @classmethod
    def of(cls, search: Search, delay: float, held: bool) -> LikeLogs:
        """By the logs of a search."""
        known, problem = search.equations, search.problem
        form = known.band, known.whitening[known.bands.index(known.band)]
        return cls(problem.recordings[0], problem.model.rest_speed, delay, held, form)

    def equations(self, path: Path, u: Array) -> Equations:
        """Rows of a motion; the axis rests before and after it."""
        seen = as_seen(self.template, path, u, self.rest_speed)
        recording = as_recording(self.template, path, u, self.rest_speed, seen)
        band, taps = self.form
        louder = 1.0 if seen is None else max(times_white(seen, path, band, taps), 1.0)
        return equations_like((band, taps / np.sqrt(louder)), recording, self.delay, self.held)


def left(grams: Array, target: int) -> Array:
    """Sum of squares of the target row that the other rows do not explain; `grams` of shape (K, P, P) -> (K,).

    Rows that are 0 in a matrix, as those that only fill it up, explain nothing.
    """
    others = [i for i in range(grams.shape[-1]) if i != target]
    size = np.sqrt(np.maximum(np.diagonal(grams, axis1=-2, axis2=-1)[:, others], 0.0))
    scale = np.where(size > 0.0, size, 1.0)
    normal = grams[:, others][:, :, others] / (scale[:, :, None] * scale[:, None, :])
    normal = normal + np.eye(len(others)) * np.where(size > 0.0, 1e-9, 1.0)[:, None, :]
    moment = grams[:, others, target] / scale
    explained = np.einsum("ki,ki->k", moment, np.linalg.solve(normal, moment[..., None])[..., 0])
    return np.asarray(np.maximum(grams[:, target, target] - explained, 0.0))


def variance_of(normal: Array, slope: Array) -> float:
    """Of a value per variance of a row, by the inverse of the normal matrix."""
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inverse = np.linalg.pinv(normal / np.outer(size, size), rcond=1e-10, hermitian=True)
    return max(float((slope / size) @ inverse @ (slope / size)), 1e-300)


def at_rest(s: Stretch, effects: EffectValues, plant: PlantModel) -> Array:
    """u, the forces of effects and what friction may hold where a stretch rests, shape (3, n)."""
    u, mean = s.frame.mean_u(s.log["u"], plant.delay), s.mean
    seen = Channels(s.frame.times, u, mean.velocity, mean.position, s.frame.intervals)
    return np.stack([u, *interval_forces(effects, seen, plant.inertia)])[:, s.free == 0.0]
