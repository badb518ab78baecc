"""Signals, and what each step of the ladder makes of them, reduced to what a picture can show."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsd_cli.errors import DsdError
from dsd_cli.identify.compare.evaluation import evaluate
from dsd_cli.identify.recordings.recording import Recording
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.report.figure import binned_median
from dsd_cli.report.page.timebase import Timebase, broken, laid_out
from dsd_cli.report.views_comparison import bins_for
from dsd_cli.report.views_diagnosis import Rows
from dsd_cli.signals.envelope import envelope
from dsd_cli.signals.log import Array, Log

#: Points of all curves together, and of one; 16 bytes each in the page.
ALL_POINTS, MOST_POINTS, FEWEST_POINTS = 170_000, 6_000, 800
#: Points of a cloud. A bin with fewer rows than this has no median worth a point.
CLOUD, _LEAST_ROWS = 1_500, 5
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


def channels_of(logs: Sequence[tuple[Log, Sequence[int]]]) -> Views:
    """Logs as they are, each with the samples that do not continue the one before; where no model can be asked."""
    pieces: list[tuple[str, dict[str, Array]]] = []
    for log, restarts in logs:
        edges = [0, *(at for at in restarts if 0 < at < len(log)), len(log)]
        t = log["t"] if "t" in log else np.asarray(log.sample_time * np.arange(len(log)), dtype=np.float64)
        columns = {**log.channels, "t": t}
        pieces += [(log.source, {n: x[a:b] for n, x in columns.items()}) for a, b in pairwise(edges) if b - a > 1]
    base = laid_out([(name, piece["t"]) for name, piece in pieces])
    shown = [name for name in (*CHANNELS, "d_hat") if all(name in piece for _, piece in pieces)]
    curves = {n: envelope(*base.joined([p[n] for _, p in pieces]), MOST_POINTS) for n in shown}
    return Views(base, curves, (), (), (), (), MOST_POINTS, sum(len(p["t"]) for _, p in pieces))


def _from(x: Array, first: int) -> Array:
    """NaN in the rows that do not count."""
    return np.concatenate([np.full(min(first, len(x)), np.nan), x[first:]])


class _Balance:
    """The residual r of the balance of forces under every model, row by row of its band."""

    def __init__(self, recordings: Sequence[Recording], models: Sequence[PlantModel]) -> None:
        self.missing, self.band_hz = "", math.nan
        self._residuals: list[Array] = []
        try:
            self._rows = Rows(recordings, models)
        except DsdError as failure:
            self.missing = str(failure)
            return
        self._residuals = [self._rows.balance(model) for model in models]
        self.band_hz = self._rows.equations.band.hz

    def curves(self, base: Timebase, pieces: Sequence[Log], points: int) -> tuple[Curve, ...]:
        """Over time; a break where friction holds and the balance says nothing."""
        if self.missing:
            return ()
        equations, kept = self._rows.equations, self._rows.kept
        places = {id(piece): times for piece, times in zip(pieces, base.times, strict=True)}
        t = equations.of_rows([places[id(s.log)] for s in equations.stretches])
        breaks, curves = np.cumsum(equations.lengths)[:-1], []
        for residual in self._residuals:
            values = np.full(kept.size, np.nan)
            values[kept] = residual
            curves.append(envelope(*broken(t, values, breaks), points))
        return tuple(curves)

    def clouds(self) -> tuple[Cloud, ...]:
        """Against every channel that is there."""
        if self.missing or not self._rows.kept.any():
            return ()
        logs = [s.log for s in self._rows.equations.stretches]
        channels = {name: self._rows.of(name) for name in AGAINST if all(name in log for log in logs)}
        ways = {"median": np.ones(int(self._rows.kept.sum()), dtype=bool)}
        if "velocity" in channels:
            ways = {"forward, median": channels["velocity"] > 0.0, "backward, median": channels["velocity"] < 0.0}
        return tuple(_cloud(name, x, self._residuals, ways) for name, x in channels.items() if np.ptp(x) > 0.0)


def _cloud(name: str, x: Array, residuals: Sequence[Array], ways: Mapping[str, NDArray[np.bool_]]) -> Cloud:
    every = max(-(-len(x) // CLOUD), 1)
    some = np.arange(0, len(x), every)  # evenly over time, then in order of x
    some = some[np.argsort(x[some], kind="stable")]
    medians = {
        way: tuple(_medians(x[rows], residual[rows]) for residual in residuals)
        for way, rows in ways.items()
        if rows.any()
    }
    return Cloud(name, every, x[some], tuple(residual[some] for residual in residuals), medians)


def _medians(x: Array, r: Array) -> Curve:
    """Medians of r over bins of x, with a NaN between bins that are no neighbours."""
    at, median = binned_median(x, r, bins_for(x), least=min(_LEAST_ROWS, x.size))
    gaps = np.flatnonzero(np.isnan(at))
    if gaps.size and gaps[-1] == at.size - 1:
        at, median, gaps = at[:-1], median[:-1], gaps[:-1]
    at[gaps] = 0.5 * (at[gaps - 1] + at[gaps + 1])
    return at, median
