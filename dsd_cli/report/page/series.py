"""Signals, and what each step of the ladder makes of them, reduced to what a picture can show."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dsd_cli.errors import DataError, DsdError
from dsd_cli.identify.compare.evaluation import evaluate
from dsd_cli.identify.fit.bank import Bank
from dsd_cli.identify.fit.equations import equations_of
from dsd_cli.identify.fit.values import coefficients_of, terms_of
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.report.page.timebase import Timebase, broken, laid_out
from dsd_cli.signals.envelope import envelope
from dsd_cli.signals.log import Array, Log

#: Points of all curves together, and of one; 16 bytes each in the page.
ALL_POINTS, MOST_POINTS, FEWEST_POINTS = 170_000, 6_000, 800
#: Points of a cloud; most and fewest bins of the curve through it, and rows for each of them.
CLOUD, BINS, FEWEST_BINS, ROWS_PER_BIN = 1_500, 48, 8, 25
#: A bin with fewer rows than this has no median worth a point.
_LEAST_ROWS = 5
#: Channels that are shown over time, and those that residuals are shown against.
CHANNELS, AGAINST = ("u", "reference", "velocity", "position"), ("velocity", "position", "u")

Curve = tuple[Array, Array]


@dataclass(frozen=True)
class Cloud:
    """Force residual of every step against one channel: every `every`-th row, and medians over bins of all rows.

    Attributes
    ----------
    x : shape (n,), ascending. residuals : of each step, shape (n,).
    medians : name -> curve of each step; by direction of motion, where the speed is known.
    """

    on: str
    every: int
    x: Array
    residuals: tuple[Array, ...]
    medians: Mapping[str, tuple[Curve, ...]]


@dataclass(frozen=True)
class Views:
    """What the page draws; curves are (time, value), NaN where a curve breaks.

    Attributes
    ----------
    base : where each log lies on the axis of time.
    channels : curve of each channel that is there; `d_hat` is the measured one.
    predicted, residual : d_hat of every step's model, and the measured one less that.
    force : residual of the balance of forces of every step, in the band; () with `no_force` saying why.
    points : of a curve; longer ones are envelopes. samples : of the longest curve.
    """

    base: Timebase
    channels: Mapping[str, Curve]
    predicted: tuple[Curve, ...]
    residual: tuple[Curve, ...]
    force: tuple[Curve, ...]
    clouds: tuple[Cloud, ...]
    points: int
    samples: int
    provenance: Mapping[str, str] = field(default_factory=dict)
    band_hz: float = math.nan
    no_force: str = ""

    def reduced(self, t: Array, x: Array) -> Curve:
        """A curve as the page holds it."""
        return envelope(t, x, self.points)


def views(
    recordings: Sequence[Recording], models: Sequence[PlantModel], observer: ObserverSettings, more: int = 0
) -> Views:
    """The recordings under the models of all steps, the model as given first.

    Parameters
    ----------
    more : curves beside these that the page has to hold.

    Raises
    ------
    DataError : see `evaluate`.
    """
    pieces = [piece for recording in recordings for piece in recording.pieces]
    base = laid_out([(r.name, piece["t"]) for r in recordings for piece in r.pieces])
    shown = [name for name in (*CHANNELS, "d_hat") if all(name in piece for piece in pieces)]
    points = ALL_POINTS // (len(shown) + 3 * len(models) + more)
    points = min(max(points, FEWEST_POINTS), MOST_POINTS)

    def curve(by_piece: Sequence[Array]) -> Curve:
        return envelope(*base.joined(by_piece), points)

    predicted, residual = [], []
    for model in models:
        stretches = {id(s.log): s for s in evaluate(recordings, model, observer).stretches}
        of = [stretches.get(id(piece)) for piece in pieces]
        nothing = [np.full(len(piece), np.nan) for piece in pieces]
        both = [
            (x, x) if s is None else (_from(s.predicted, s.first), _from(s.residual, s.first))
            for s, x in zip(of, nothing, strict=True)
        ]
        predicted.append(curve([p for p, _ in both]))
        residual.append(curve([e for _, e in both]))
    balance = _Balance(recordings, models)
    return Views(
        base,
        {name: curve([piece[name] for piece in pieces]) for name in shown},
        tuple(predicted),
        tuple(residual),
        balance.curves(base, pieces, points),
        balance.clouds(),
        points,
        sum(len(piece) for piece in pieces),
        dict(recordings[0].provenance),
        balance.band_hz,
        balance.missing,
    )


def _from(x: Array, first: int) -> Array:
    """NaN in the rows that do not count."""
    return np.concatenate([np.full(min(first, len(x)), np.nan), x[first:]])


class _Balance:
    """The residual r of the balance of forces under every model, row by row of its band."""

    def __init__(self, recordings: Sequence[Recording], models: Sequence[PlantModel]) -> None:
        self.missing, self.band_hz = "", math.nan
        self._residuals: list[Array] = []
        try:
            latest = max(model.delay for model in models) / recordings[0].sample_time
            self._equations = equations_of(recordings, math.ceil(latest) + _LATER)
            if not self._equations.stretches:
                raise DataError("the log is too short for the balance of forces")
            bank = Bank(self._equations)
            self._residuals = [_residual(bank, model) for model in models]
            self._kept, self.band_hz = self._equations.kept, self._equations.band.hz
        except DsdError as failure:
            self.missing, self._residuals = str(failure), []

    def curves(self, base: Timebase, pieces: Sequence[Log], points: int) -> tuple[Curve, ...]:
        """Over time; a break where friction holds and the balance says nothing."""
        if self.missing:
            return ()
        places = {id(piece): times for piece, times in zip(pieces, base.times, strict=True)}
        equations = self._equations
        t = equations.of_rows([places[id(s.log)] for s in equations.stretches])
        breaks = np.cumsum(equations.lengths)[:-1]
        curves = []
        for residual in self._residuals:
            curves.append(envelope(*broken(t, np.where(self._kept, residual, np.nan), breaks), points))
        return tuple(curves)

    def clouds(self) -> tuple[Cloud, ...]:
        """Against every channel that is there."""
        if self.missing or not self._kept.any():
            return ()
        logs = [s.log for s in self._equations.stretches]
        channels = {
            name: self._equations.of_rows([log[name] for log in logs])[self._kept]
            for name in AGAINST
            if all(name in log for log in logs)
        }
        ways = {"median": np.ones(int(self._kept.sum()), dtype=bool)}
        if "velocity" in channels:
            ways = {"forward, median": channels["velocity"] > 0.0, "backward, median": channels["velocity"] < 0.0}
        residuals = [residual[self._kept] for residual in self._residuals]
        return tuple(_cloud(name, x, residuals, ways) for name, x in channels.items() if np.ptp(x) > 0.0)


#: Samples after the delay with which the first row begins: a row looks at one step of delay more.
_LATER = 50


def _residual(bank: Bank, model: PlantModel) -> Array:
    """r of every row."""
    terms = terms_of(model)
    tap, theta = coefficients_of(model, terms, bank.tap_time)
    drive, *columns = bank.design(terms, tap).rows
    return np.asarray(drive - theta @ np.stack(columns))


def _cloud(name: str, x: Array, residuals: Sequence[Array], ways: Mapping[str, NDArray[np.bool_]]) -> Cloud:
    order = np.argsort(x, kind="stable")
    every = max(-(-len(x) // CLOUD), 1)
    some = np.arange(0, len(x), every)  # evenly over time, then in order of x
    some = some[np.argsort(x[some], kind="stable")]
    width = float(np.ptp(x)) / min(max(len(x) // ROWS_PER_BIN, FEWEST_BINS), BINS)
    medians = {}
    for way, rows in ways.items():
        mine = order[rows[order]]
        if mine.size >= _LEAST_ROWS:
            medians[way] = tuple(_medians(x[mine], residual[mine], width) for residual in residuals)
    return Cloud(name, every, x[some], tuple(residual[some] for residual in residuals), medians)


def _medians(x: Array, r: Array, width: float) -> Curve:
    """Medians of r over bins of x (ascending) of that width; 0 is an edge, so that a jump there stays one."""
    edges = np.flatnonzero(np.diff(np.floor(x / width))) + 1
    parts = [(a, b) for a, b in zip([0, *edges], [*edges, len(x)], strict=True) if b - a >= _LEAST_ROWS]
    at = np.array([np.mean(x[a:b]) for a, b in parts])
    return at, np.array([np.median(r[a:b]) for a, b in parts])
