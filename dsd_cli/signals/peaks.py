"""Lines of a spectrum."""

import numpy as np

from dsd_cli.signals.log import Array

#: Lines that are followed up, and bins over which the background is averaged to either side, at least.
LINES, _AROUND = 4, 8


def peaks(power: Array, first: int) -> list[int]:
    """Positions of the highest local maxima over the local background, strongest first."""
    if len(power) < first + _AROUND:
        return []
    width = min(max(len(power) // 50, _AROUND), (len(power) - 1) // 2)
    background = np.convolve(power, np.ones(2 * width + 1), "same") / (2 * width + 1)
    strength = power / np.maximum(background, 1e-300)
    strength[:first] = 0.0
    inner = strength[1:-1]
    local = np.flatnonzero((inner >= strength[:-2]) & (inner >= strength[2:])) + 1
    return local[np.argsort(strength[local])[::-1][:LINES]].tolist()
