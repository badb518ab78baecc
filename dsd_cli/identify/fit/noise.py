"""The spectrum of the measurement noise, and the filter that makes it white.

What measuring adds to d_hat is white (noise on d_hat) or rises with frequency (noise on velocity or position,
differentiated). Missing physics is strongest at low frequencies. So the noise spectrum is taken as the largest
non-decreasing one below that of a residual: whatever rises towards low frequencies is physics and is not whitened away.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dsd_cli.signals.log import Array

#: Order of the whitening filter, samples of a segment, and the least share of the largest density.
ORDER, SEGMENT, FLOOR = 24, 256, 1e-4
#: Bands of the spectrum; of a short log (fewer segments) they are few, or the least of them would be chance.
BANDS, FEW_BANDS, FEW_SEGMENTS = 64, 16, 40
#: A band stands out if it has this many times the least density of the bands above it; with fewer than so many
#: segments nothing does.
TOLERANCE, LEAST_SEGMENTS = 1.6, 5


def whitening_filter(residual: Sequence[Array]) -> Array:
    """Coefficients a (a_0 = 1) of the filter that whitens the noise in these stretches of a residual, shape (m+1,)."""
    density = _envelope(_density(residual)[0])
    if not density[-1] > 0.0:
        return np.ones(1)
    density, bands = np.maximum(density, FLOOR * density[-1]), len(density)
    frequencies = (np.arange(bands) + 0.5) * np.pi / bands
    lags = np.cos(np.outer(np.arange(ORDER + 1), frequencies)) @ density / bands
    lags[0] *= 1.0 + 1e-9
    order = np.arange(ORDER)
    toeplitz = lags[np.abs(order[:, None] - order[None, :])]
    return np.concatenate([[1.0], np.linalg.solve(toeplitz, -lags[1:])])


def structured_share(residual: Sequence[Array]) -> float:
    """Share of the power of these stretches that stands above any non-decreasing spectrum: it is no measuring noise."""
    density, segments = _density(residual)
    if segments < LEAST_SEGMENTS or not density.sum() > 0.0:
        return 0.0
    above = np.maximum(density - TOLERANCE * _envelope(density), 0.0)
    return float(above.sum() / density.sum())


def _envelope(density: Array) -> Array:
    """The largest non-decreasing function that is nowhere above it."""
    return np.asarray(np.minimum.accumulate(density[::-1])[::-1])


def _density(residual: Sequence[Array]) -> tuple[Array, int]:
    """(power per band of equal width up to half the sample rate, median over segments; segments).

    The median, because transients shall not count.
    """
    powers = []
    for x in residual:
        for start in range(0, len(x) - SEGMENT + 1, SEGMENT // 2):
            part = x[start : start + SEGMENT]
            if np.count_nonzero(part) > SEGMENT // 2:
                powers.append(np.abs(np.fft.rfft(part * np.hanning(SEGMENT))[1:]) ** 2)
    bands = BANDS if len(powers) >= FEW_SEGMENTS else FEW_BANDS
    if not powers:
        return np.ones(bands), 0
    return np.median(np.array(powers).reshape(len(powers), bands, -1).mean(axis=2), axis=0), len(powers)
