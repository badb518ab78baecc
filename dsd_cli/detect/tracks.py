"""Signals of any length, remembered for a picture: their peaks, or their means over columns."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.envelope import envelope
from dsd_cli.signals.log import Array

#: Points of a line that are kept, and columns of means.
POINTS, COLUMNS = 20_000, 1_200


class Onward:
    """Stamps that never go back: another recording goes on where the last one ended."""

    def __init__(self) -> None:
        self._shift, self._end = 0.0, -np.inf
        self.restarts: list[float] = []

    def placed(self, t: Array) -> Array:
        """The next stamps, ascending, shape (n,)."""
        if not t.size:
            return t
        if t[0] + self._shift < self._end:
            self._shift = self._end - float(t[0])
            self.restarts.append(self._end)
        self._end = float(t[-1]) + self._shift
        return np.asarray(t + self._shift)


class Track:
    """A line that keeps its lowest and highest values, at most some `POINTS` times 2 at any time."""

    def __init__(self) -> None:
        self._parts: list[tuple[Array, Array]] = []
        self._size = 0

    def add(self, t: Array, x: Array) -> None:
        """The next values, shape (n,) each; t ascends."""
        self._parts.append((t, np.asarray(x, dtype=np.float64)))
        self._size += t.size
        if self._size > 2 * POINTS:
            kept = envelope(*self.line(), POINTS)
            self._parts, self._size = [kept], kept[0].size

    def interrupt(self) -> None:
        """What follows does not go on from here."""
        if self._parts and self._parts[-1][0].size:
            self._parts.append((self._parts[-1][0][-1:], np.array([np.nan])))
            self._size += 1

    def line(self) -> tuple[Array, Array]:
        """(times, values)."""
        if not self._parts:
            return np.zeros(0), np.zeros(0)
        t, x = zip(*self._parts, strict=True)
        return np.concatenate(t), np.concatenate(x)


class Means:
    """Means over columns of equally many rows; when there are too many columns, neighbours become one."""

    def __init__(self, width: int) -> None:
        self._rows = 1  # of a column
        self._times, self._values = np.zeros(0), np.zeros((0, width))
        self._rest: tuple[Array, Array] = (np.zeros(0), np.zeros((0, width)))

    def add(self, t: Array, x: Array) -> None:
        """The next rows, x of shape (n, width); a NaN makes its column NaN."""
        t, x = np.concatenate([self._rest[0], t]), np.concatenate([self._rest[1], x])
        whole = t.size // self._rows * self._rows
        self._rest = t[whole:], x[whole:]
        times, values = _together(t[:whole], x[:whole], self._rows)
        self._times, self._values = np.concatenate([self._times, times]), np.concatenate([self._values, values])
        while self._times.size > 2 * COLUMNS:
            self._pair()

    def _pair(self) -> None:
        """Twice the rows a column; an odd column at the end goes back to the rest."""
        self._rows *= 2
        even = self._times.size // 2 * 2
        if even < self._times.size:
            half = self._rows // 2
            again = np.repeat(self._times[even:], half), np.repeat(self._values[even:], half, axis=0)
            self._rest = (np.concatenate([again[0], self._rest[0]]), np.concatenate([again[1], self._rest[1]]))
        self._times, self._values = _together(self._times[:even], self._values[:even], 2)

    def columns(self) -> tuple[Array, Array]:
        """(time of the first row, mean) of each column, shapes (m,) and (m, width)."""
        t, x = self._rest
        if not t.size:
            return self._times, self._values
        return np.append(self._times, t[0]), np.vstack([self._values, x.mean(axis=0)])


def _together(t: Array, x: Array, rows: int) -> tuple[Array, Array]:
    return t[::rows], x.reshape(-1, rows, x.shape[1]).mean(axis=1)
