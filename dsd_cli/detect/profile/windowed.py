"""Sums over the last M samples that never subtract: prefix of this block of M, suffix of the one before."""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.log import Array


class WindowedSums:
    """Sums over a sliding window, of `width` columns at once; the same bits however the rows are cut.

    A running sum that adds the new sample and subtracts the old one drifts, and a spike of 1e9 leaves a trace in it for
    ever. Here a value is gone when it leaves the window.
    """

    def __init__(self, window: int, width: int) -> None:
        self._window = window
        self._slot = 0
        self._prefix = np.zeros(width)
        # rows of this block so far, then what is left of the suffix sums of the block before; the last row is 0
        self._ring = np.zeros((window + 1, width))

    def feed(self, rows: Array) -> Array:
        """Sum over the window that ends at each of the next rows; both of shape (n, width)."""
        out = np.empty_like(rows)
        begin = 0
        while begin < len(rows):
            end = min(len(rows), begin + self._window - self._slot)
            out[begin:end] = self._block(rows[begin:end])
            begin = end
        return out

    def _block(self, rows: Array) -> Array:
        """Rows within one block of the window."""
        slot, n = self._slot, len(rows)
        prefix = rows.copy()
        prefix[0] += self._prefix
        np.add.accumulate(prefix, axis=0, out=prefix)
        sums = prefix + self._ring[slot + 1 : slot + n + 1]
        self._ring[slot : slot + n] = rows
        self._prefix = prefix[-1]
        self._slot = slot + n
        if self._slot == self._window:
            self._ring[:-1] = np.add.accumulate(self._ring[:-1][::-1], axis=0)[::-1]
            self._prefix = np.zeros(rows.shape[1])
            self._slot = 0
        return sums
