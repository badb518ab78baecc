"""What the picture of a comparison shows, as numbers: forces as measured and as the model has them, and a spectrum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dsd_cli.identify.compare.balance import Forces
from dsd_cli.identify.recordings.spectrum import density
from dsd_cli.report.figure import binned_median
from dsd_cli.signals.log import Array

#: Samples that a bin should hold, and bins at least and at most; along the position as fine as cogging.
_PER_BIN, _FEWEST_BINS, _MOST_BINS = 30, 12, 120
_PER_FINE_BIN, _MOST_FINE_BINS = 6, 400


@dataclass(frozen=True)
class Curve:
    """Medians over bins of a channel, shape (bins,), NaN between bins that do not touch."""

    name: str
    x: Array
    measured: Array
    modelled: Array


def curves_over(x: Array, forces: Forces, direction: Array | None = None) -> list[Curve]:
    """Medians of both forces over the speed `x`.

    With `direction` (sign of the speed, rest is left out) over the position `x`, for each direction in fine bins.
    """
    if direction is None:
        return [_curve("", x, forces, fine=False)]
    found = []
    for sign, name in ((1.0, "forward"), (-1.0, "backward")):
        way = direction == sign
        if way.any():
            found.append(_curve(name, x[way], Forces(forces.measured[way], forces.modelled[way]), fine=True))
    return found


def _curve(name: str, x: Array, forces: Forces, fine: bool) -> Curve:
    bins = bins_for(x, fine)
    at, measured = binned_median(x, forces.measured, bins)
    return Curve(name, at, measured, binned_median(x, forces.modelled, bins)[1])


def bins_for(x: Array, fine: bool = False) -> int:
    """Bins of a channel; `fine` : of the position, along which forces may go to and fro."""
    per_bin, most = (_PER_FINE_BIN, _MOST_FINE_BINS) if fine else (_PER_BIN, _MOST_BINS)
    return int(np.clip(x.size // per_bin, _FEWEST_BINS, most))


@dataclass(frozen=True)
class Spectrum:
    """Amplitude density over frequency (Hz), shape (m,): the square of it adds up to the mean square."""

    frequency: Array
    amplitude: Array


def spectrum_of(parts: list[Array], interval: float) -> Spectrum:
    """Of stretches of one signal without gaps (Welch), one-sided, unit per sqrt(Hz); not of those too short."""
    parts = [part for part in parts if part.size >= 16]
    if not parts:
        return Spectrum(np.zeros(0), np.zeros(0))
    found = density(parts)
    return Spectrum(found.angle / (2.0 * np.pi * interval), np.sqrt(2.0 * interval * found.power))
