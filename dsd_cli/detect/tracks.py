"""Signals of any length, remembered for a picture: their peaks, or their means over columns."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.log import Array

#: Columns of lines, and of means (up to twice as many).
COLUMNS_OF_LINES, COLUMNS = 10_000, 1_200


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
    """A line that keeps the lowest and the highest value of every column of equally many rows, at their own times.

    When there are too many columns, neighbours become one. What is not finite is a gap, kept once per column.
    """

    def __init__(self) -> None:
        self._rows, self._filled = 1, 0  # of a column; of the one that is not full yet
        nothing = np.zeros((0, 3))
        self._columns, self._rest = (nothing, nothing), (np.zeros(0), np.zeros(0))

    def add(self, t: Array, x: Array) -> None:
        """The next values, shape (n,) each; t ascends."""
        first = min(self._rows - self._filled, t.size)
        self._fill(t[:first], x[:first])
        whole = first + (t.size - first) // self._rows * self._rows
        if whole > first:
            self._append(t[first:whole].reshape(-1, self._rows), x[first:whole].reshape(-1, self._rows))
        self._fill(t[whole:], x[whole:])
        while len(self._columns[0]) > COLUMNS_OF_LINES:
            self._pair()

    def interrupt(self) -> None:
        """What follows does not go on from here."""
        t, _ = self.line()
        if t.size:
            self._rest = np.append(self._rest[0], t[-1]), np.append(self._rest[1], np.nan)

    def line(self) -> tuple[Array, Array]:
        """(times, values)."""
        t, x = (np.concatenate([of.ravel(), rest]) for of, rest in zip(self._columns, self._rest, strict=True))
        there = np.isfinite(t)
        return t[there], x[there]

    def _fill(self, t: Array, x: Array) -> None:
        """Into the column that is not full yet."""
        self._rest = np.concatenate([self._rest[0], t]), np.concatenate([self._rest[1], x])
        self._filled += t.size
        if self._filled == self._rows:
            self._append(self._rest[0][None, :], self._rest[1][None, :])
            self._rest, self._filled = (np.zeros(0), np.zeros(0)), 0

    def _append(self, t: Array, x: Array) -> None:
        new = _ends(t, x)
        self._columns = np.concatenate([self._columns[0], new[0]]), np.concatenate([self._columns[1], new[1]])

    def _pair(self) -> None:
        """Twice the rows a column; an odd one at the end goes back to what is not full."""
        even = len(self._columns[0]) // 2 * 2
        if even < len(self._columns[0]):
            self._rest = (
                np.concatenate([self._columns[0][-1], self._rest[0]]),
                np.concatenate([self._columns[1][-1], self._rest[1]]),
            )
            self._filled += self._rows
        self._rows *= 2
        t, x = (of[:even].reshape(-1, 6) for of in self._columns)
        self._columns = _ends(t, x)


def _ends(t: Array, x: Array) -> tuple[Array, Array]:
    """Of each row of entries (k, n) the lowest, the highest and the first gap, (k, 3), in their order.

    A time of NaN is no entry, in what comes in and in what goes out.
    """
    there, finite = np.isfinite(t), np.isfinite(t) & np.isfinite(x)
    gap = there & ~finite
    lowest, highest = np.where(finite, x, np.inf).argmin(axis=1), np.where(finite, x, -np.inf).argmax(axis=1)
    some, at = finite.any(axis=1), np.stack([lowest, highest, gap.argmax(axis=1)], axis=1)
    kept = np.stack([some, some & (highest != lowest), gap.any(axis=1)], axis=1)
    order = np.argsort(at, axis=1, kind="stable")
    at, kept = np.take_along_axis(at, order, axis=1), np.take_along_axis(kept, order, axis=1)
    values = np.take_along_axis(np.where(finite, x, np.nan), at, axis=1)
    return np.where(kept, np.take_along_axis(t, at, axis=1), np.nan), values


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
