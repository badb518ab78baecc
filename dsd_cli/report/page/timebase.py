"""Pieces of one or more logs along one axis of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsd_cli.signals.log import Array


@dataclass(frozen=True)
class Placed:
    """Where a log lies on the axis, s; a stamp of its first piece is drawn `shift` later."""

    name: str
    start: float
    end: float
    shift: float


@dataclass(frozen=True)
class Timebase:
    """The axis begins with 0 at the first stamp.

    Attributes
    ----------
    times : of each piece, as drawn. logs : in their order.
    """

    times: tuple[Array, ...]
    logs: tuple[Placed, ...]

    @property
    def end(self) -> float:
        """s."""
        return self.logs[-1].end

    def joined(self, pieces: Sequence[Array]) -> tuple[Array, Array]:
        """(times, values) of all pieces, with a NaN between them."""
        return broken(np.concatenate(self.times), np.concatenate(pieces), np.cumsum([len(t) for t in self.times])[:-1])


def broken(t: Array, x: Array, at: NDArray[np.intp]) -> tuple[Array, Array]:
    """A curve with a NaN before each of these rows, at a time of its own: curves are joined by their times."""
    return np.insert(t, at, 0.5 * (t[at - 1] + t[at])), np.insert(np.asarray(x, dtype=np.float64), at, np.nan)


def laid_out(pieces: Sequence[tuple[str, Array]]) -> Timebase:
    """(name of the log, stamps in s) of each piece; what begins before the end of the last piece goes on after it,
    one sample later."""
    shift, end = -float(pieces[0][1][0]), 0.0
    times: list[Array] = []
    logs: list[Placed] = []
    for name, t in pieces:
        new = not logs or logs[-1].name != name
        if times and (new or t[0] + shift < end):
            shift = end - float(t[0]) + float(np.median(np.diff(t)))
        times.append(t + shift)
        end = float(times[-1][-1])
        if new:
            logs.append(Placed(name, float(times[-1][0]), end, shift))
        logs[-1] = replace(logs[-1], end=end)
    return Timebase(tuple(times), tuple(logs))


def onward(t: Array, log: Placed) -> Array:
    """Stamps of all rows of a log on the axis; those that begin anew go on where they were."""
    placed = t + log.shift
    return np.asarray(placed + np.concatenate([[0.0], np.cumsum(np.maximum(-np.diff(placed), 0.0))]))
