"""Values beside a sample, and lengths over which a transform is fast, without the imports of SciPy.

`scipy.ndimage` and `scipy.fft` take 0.3 s of CPU each to load, more than all that is asked of them.
"""

from __future__ import annotations

import numpy as np

from dsd_cli.signals.log import Array

#: Rows that are sorted at once.
_ROWS = 100_000


def beside(x: Array, reach: int) -> Array:
    """Each value and those so far to either side, shape (n, 2 reach + 1), a view; the ends go on as they are."""
    return np.lib.stride_tricks.sliding_window_view(np.pad(x, reach, mode="edge"), 2 * reach + 1)


def median(rows: Array) -> Array:
    """Of each row of an odd number of values, shape (n,); `np.median` takes five times as long."""
    middle = rows.shape[1] // 2
    found = np.empty(len(rows))
    for i in range(0, len(rows), _ROWS):  # of a long log all of them are gigabytes
        found[i : i + _ROWS] = np.partition(rows[i : i + _ROWS], middle, axis=1)[:, middle]
    return found


def smooth_size(least: int) -> int:
    """The least even length of 2^a 3^b 5^c, from there on, over which a fast Fourier transform is fast."""
    power = 1 << max(least - 1, 1).bit_length()
    found = [power]
    for odd in (3, 5, 9, 15, 25, 27, 45, 75, 81, 125, 135, 225, 243):
        size = 2 * odd
        while size < least:
            size *= 2
        found.append(size)
    return min(found)
