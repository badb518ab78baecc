"""Several logs, and logs with gaps, along one axis of time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsd_cli.report.figure import ZERO, in_picture, shortened
from dsd_cli.signals.log import Array

#: Stamps that are so much larger than the time they span are counted from the first one.
_FAR = 1e4
#: Characters over the width of a page, and of the shortest name that says something.
_CHARACTERS, _SHORTEST = 150, 12
#: An interval of so many times the usual one is a gap.
_GAP = 5.0


@dataclass(frozen=True)
class TimedPiece:
    """One piece of a log: its stamps, shape (n,), s; `aside`: it is of a log that was held out."""

    name: str
    t: Array
    aside: bool = False


@dataclass(frozen=True)
class Log:
    """Where a log lies on the axis, s."""

    name: str
    start: float
    end: float
    aside: bool


@dataclass(frozen=True)
class Timeline:
    """Pieces laid along one axis.

    Attributes
    ----------
    times : of each piece, as drawn. logs : in their order.
    origin : stamp that is drawn as 0; 0 where stamps are as they were.
    """

    times: tuple[Array, ...]
    logs: tuple[Log, ...]
    origin: float

    @property
    def label(self) -> str:
        """Of the axis."""
        if len(self.logs) > 1:
            return "time (s), the logs one after the other"
        return time_label(self.origin)

    def _name(self, number: int, log: Log) -> str:
        """As much of it as has room; where there is none, its number."""
        share = (log.end - log.start) / max(self.logs[-1].end - self.logs[0].start, 1e-300)
        name, room = ("hold-out: " if log.aside else "") + Path(log.name).name, int(_CHARACTERS * share) - 2
        return shortened(name, room) if room >= _SHORTEST else "hold-out" if log.aside else str(number)

    def joined(self, pieces: Sequence[Array]) -> tuple[Array, Array]:
        """(times, values) of all pieces, with a NaN wherever time does not go on."""
        times: list[Array] = []
        values: list[Array] = []
        for t, x in zip(self.times, pieces, strict=True):
            where = gaps(t)
            times += [np.insert(t, where, t[where]), t[-1:]]
            values += [np.insert(np.asarray(x, dtype=np.float64), where, np.nan), np.array([np.nan])]
        return np.concatenate(times), np.concatenate(values)

    def mark(self, axes: Sequence[Any]) -> None:
        """Where each log begins, on every axis; their names on the first. What was held out is grey."""
        for axis in axes:
            for k, log in enumerate(self.logs):
                if log.aside:
                    axis.axvspan(log.start, log.end, color="0.93", lw=0, zorder=0)
                if k:
                    axis.axvline(log.start, color="0.25", lw=0.9, ls=(0, (4, 2)), zorder=1)
        axes[-1].set_xlabel(self.label)
        if len(self.logs) < 2:
            return
        for number, log in enumerate(self.logs, 1):
            name = self._name(number, log)
            axes[0].annotate(
                in_picture(name),
                (log.start, 1.0),
                (3, 2),
                xycoords=axes[0].get_xaxis_transform(),
                textcoords="offset points",
                fontsize=8.5,
                annotation_clip=False,
            )


def gaps(t: Array) -> NDArray[np.intp]:
    """Rows before which time does not go on as usual: backwards, or after more than 5 usual intervals."""
    if t.size < 3:
        return np.zeros(0, dtype=np.intp)
    steps = np.diff(t)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    return 1 + np.flatnonzero((steps < 0.0) | (steps > _GAP * usual))


def timeline(parts: Sequence[TimedPiece]) -> Timeline:
    """Pieces of one log keep their stamps; another log, or stamps that begin anew, go on where the last one ended."""
    several = len({(part.name, part.aside) for part in parts}) > 1
    first, last = float(parts[0].t[0]), float(parts[-1].t[-1])
    origin = first if several else origin_of(first, last)
    shift, end = -origin, -np.inf
    times: list[Array] = []
    logs: list[Log] = []
    for part in parts:
        new = not logs or (logs[-1].name, logs[-1].aside) != (part.name, part.aside)
        if times and (new or part.t[0] + shift < end):
            shift = end - float(part.t[0])
        times.append(part.t + shift)
        end = float(times[-1][-1])
        if new:
            logs.append(Log(part.name, float(times[-1][0]), end, part.aside))
        logs[-1] = Log(part.name, logs[-1].start, end, part.aside)
    return Timeline(tuple(times), tuple(logs), origin)


def origin_of(first: float, last: float) -> float:
    """The stamp to count from: a whole second near the first, where stamps are far larger than their span; else 0."""
    return math.floor(first) if abs(first) > _FAR * max(abs(last - first), 1e-300) else 0.0


def time_label(origin: float) -> str:
    """Of the axis of one log."""
    return f"time since {origin:.16g} s (s)" if origin else "time (s)"


def zero(axis: Any) -> None:
    """The line of no error."""
    axis.axhline(0.0, color=ZERO, lw=0.8, zorder=1)
