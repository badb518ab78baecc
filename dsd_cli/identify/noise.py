"""The spectrum of the measurement noise, and the filter that makes it white.

What measuring adds to d_hat is white (noise on d_hat) or rises with frequency (noise on velocity or position,
differentiated). Missing physics is strongest at low frequencies. So the noise spectrum is taken as the largest
non-decreasing one below that of a residual: whatever rises towards low frequencies is physics and is not whitened away.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_toeplitz

from dsd_cli.signals.log import Array

#: Order of the whitening filter, bands of the spectrum, and the least share of the largest density.
ORDER, BANDS, FLOOR = 24, 64, 1e-4
#: A band stands out if it has this many times the least density of the bands above it.
TOLERANCE = 1.6


def whitening_filter(residual: Sequence[Array]) -> Array:
    """Coefficients a (a_0 = 1) of the filter that whitens the noise in these stretches of a residual, shape (m+1,)."""
    density = np.minimum.accumulate(_density(residual)[::-1])[::-1]
    if not density[-1] > 0.0:
        return np.ones(1)
    density = np.maximum(density, FLOOR * density[-1])
    frequencies = (np.arange(BANDS) + 0.5) * np.pi / BANDS
    lags = np.cos(np.outer(np.arange(ORDER + 1), frequencies)) @ density / BANDS
    lags[0] *= 1.0 + 1e-9
    return np.concatenate([[1.0], solve_toeplitz(lags[:-1], -lags[1:])])


def _density(residual: Sequence[Array]) -> Array:
    """Power per band of equal width up to half the sample rate, median over segments (transients do not count)."""
    found = []
    for x in residual:
        size = 4 * BANDS
        for start in range(0, len(x) - size + 1, size // 2):
            part = x[start : start + size] * np.hanning(size)
            if np.count_nonzero(x[start : start + size]) < size // 2:
                continue
            power = np.abs(np.fft.rfft(part)[1:]) ** 2
            found.append(power.reshape(BANDS, -1).mean(axis=1))
    return np.median(found, axis=0) if found else np.ones(BANDS)


def structured_share(residual: Sequence[Array]) -> float:
    """Share of the power of these stretches that stands above any non-decreasing spectrum: it is no measuring noise."""
    density = _density(residual)
    envelope = np.minimum.accumulate(density[::-1])[::-1]
    above = np.maximum(density - TOLERANCE * envelope, 0.0)
    return float(above.sum() / density.sum()) if density.sum() > 0.0 else 0.0
