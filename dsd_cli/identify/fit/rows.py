"""Equations: each row says what moved the plant at one sample, as the observer sees it.

    y = Q { Jn a } = alpha Q { u(t-L) } + sum_k alpha c_k Q { column_k } + noise,    alpha = Jn / Jm      (eq. 13)

Intervals in which friction may hold the plant (rest, starts, stops, reversals) say nothing about a force that slides:
there both sides are set to zero *before* Q, so that Q carries nothing of them into their neighbours. The rows are then
whitened by the noise's own spectrum, which makes least squares efficient and its counts of evidence honest.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsd_cli.effects import Channels
from dsd_cli.identify.fit.blocks import Blocks
from dsd_cli.identify.recordings.recording import Recording, net_force
from dsd_cli.plant.filtering import two_interval_mean
from dsd_cli.plant.forces import IntervalChannels
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.log import Array, Log

#: More rows than this are thinned: whitened rows stand for themselves, and so many tell enough.
MOST_ROWS = 60_000


@dataclass(frozen=True)
class Stretch:
    """A piece of a recording as equations.

    Attributes
    ----------
    force : Jn a per interval, shape (n,), before Q.
    keep : 1 where the interval can be used, 0 where not; after averaging over two intervals if d_hat does so.
    sign : mean of sgn v per interval, 0 where it is not known.
    """

    log: Log
    frame: Frame
    motion: IntervalChannels
    force: Array
    keep: Array
    sign: Array

    def channels(self, drive: Array) -> Channels:
        """What effects look at under that delayed u."""
        return self.frame.channels(drive, self.motion)


class Equations:
    """All stretches of some recordings, as rows.

    Parameters
    ----------
    startup : samples at the beginning of each stretch that are not used: they rest on u before the log.
    """

    def __init__(self, recordings: Sequence[Recording], observer: ObserverSettings, startup: int) -> None:
        self.observer = observer
        self.recordings = tuple(recordings)
        self.startup = startup
        pieces = [(r, piece) for r in recordings for piece in r.pieces if len(piece) > 2 * startup]
        self.stretches = tuple(_stretch(piece, r.rest_speed, observer, startup) for r, piece in pieces)
        self.sample_time = recordings[0].sample_time
        self.thinning = 1
        self._whitening: Array = np.ones(1)
        self.thinning = -(-sum(self.lengths) // MOST_ROWS)

    @property
    def lengths(self) -> list[int]:
        """Rows of each stretch."""
        return [len(range(self.startup, len(s.log), self.thinning)) for s in self.stretches]

    def whiten(self, coefficients: Array) -> None:
        """From now on rows pass this filter (an autoregressive noise model, first coefficient 1)."""
        self._whitening = coefficients

    def unwhitened(self) -> Equations:
        """The same equations in the unit of u."""
        plain = copy(self)
        plain.whiten(np.ones(1))
        return plain

    def rows(self, raw: Sequence[Array]) -> Array:
        """A force per interval of every stretch -> rows as the observer sees them, whitened and thinned."""
        return self._joined([self._averaged(s, x) for s, x in zip(self.stretches, raw, strict=True)])

    def measured(self) -> Array:
        """y: Jn a as the observer sees it, whitened and thinned."""
        return self._joined([s.force for s in self.stretches])

    def plain(self, raw: Sequence[Array]) -> Array:
        """As `rows`, but neither whitened nor thinned; unit of u."""
        return self._joined([self._averaged(s, x) for s, x in zip(self.stretches, raw, strict=True)], plain=True)

    def plain_measured(self) -> Array:
        """As `measured`, but neither whitened nor thinned; unit of u."""
        return self._joined([s.force for s in self.stretches], plain=True)

    def block_of_plain_rows(self, blocks: Blocks) -> NDArray[np.int_]:
        """Block of each row that is not thinned; `blocks` are those of the thinned rows."""
        thinned = blocks.block_of_rows()
        found, at = [], 0
        for stretch, length in zip(self.stretches, self.lengths, strict=True):
            rows = len(stretch.log) - self.startup
            found.append(thinned[at : at + length][np.arange(rows) // self.thinning])
            at += length
        return np.concatenate(found)

    @property
    def kept(self) -> NDArray[np.bool_]:
        """Whether each row (thinned) can be used."""
        return np.concatenate([s.keep[self.startup :: self.thinning] > 0.0 for s in self.stretches])

    def _averaged(self, stretch: Stretch, x: Array) -> Array:
        return two_interval_mean(x, stretch.frame.intervals) if stretch.log.d_hat_source == "position" else x

    def _joined(self, raw: Sequence[Array], plain: bool = False) -> Array:
        whitening, step = (np.ones(1), 1) if plain else (self._whitening, self.thinning)
        parts = [self._seen(s, x * s.keep, whitening) for s, x in zip(self.stretches, raw, strict=True)]
        return np.concatenate([x[self.startup :: step] for x in parts])

    def _seen(self, stretch: Stretch, x: Array, whitening: Array) -> Array:
        seen = stretch.frame.filtered(x, self.observer, 0.0)
        return seen if len(whitening) == 1 else np.convolve(seen, whitening)[: len(x)]


def _stretch(log: Log, rest_speed: float, observer: ObserverSettings, startup: int) -> Stretch:
    frame = Frame(log)
    motion = frame.motion(rest_speed)
    clear = np.isfinite(motion.sign) & ~np.isfinite(motion.acceleration)
    if "velocity" not in log and "position" not in log:
        clear[:] = True
    sign = np.where(clear, motion.sign, 0.0)  # of each interval; only what d_hat shows averages two of them
    if log.d_hat_source == "position":
        clear[1:] &= clear[:-1].copy()
    clear[:startup] = False
    force = net_force(log, observer)
    return Stretch(log, frame, motion, force, clear.astype(np.float64), sign)
