"""A log on a regular clock with a held command and without jumps: all that follows counts in samples.

On irregular stamps position and speed are taken from a cubic spline through the samples, and the command from its
integral, which is exact. A command that was measured (`u_hold = "sampled"`) becomes its mean over each interval.

A spline takes off the highest frequencies of white noise a quarter and more, and those are where noise is read. So a
synthetic noise goes the same way, as "white" of the log: what is lost of it is lost of the sensor's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dsd_cli.plant.filtering import irregular_stamps
from dsd_cli.signals.log import Array, Log

#: Mean of a smooth signal over the interval between the inner two of four samples (exact for cubics).
MEAN_OF_FOUR = np.array([-1.0, 13.0, 13.0, -1.0]) / 24.0
#: u as it was sampled: what the maker of a logged d_hat has put into it.
SAMPLED_U = "sampled_u"
#: Seed of the white noise that is interpolated as the channels are.
_SEED = 20261122


def regularised(piece: Log) -> Log:
    """The piece on a regular clock, u its mean from each sample to the next; with "white" where it was interpolated,
    and with `SAMPLED_U` where u was measured and d_hat logged."""
    stamps = irregular_stamps(piece)
    if piece.u_hold == "sampled":
        own = {SAMPLED_U: piece["u"]} if "d_hat" in piece else {}
        piece = replace(piece, channels={**piece.channels, **own, "u": mean_ahead(piece["u"])})
    if stamps is None:
        return piece
    from scipy.interpolate import CubicSpline

    step = float(stamps[-1] - stamps[0]) / max(round((stamps[-1] - stamps[0]) / piece.sample_time), 1)
    grid = stamps[0] + step * np.arange(int((stamps[-1] - stamps[0]) / step * (1.0 + 1e-12)) + 1)
    kept = {name: x for name, x in piece.channels.items() if name not in ("t", "u")}
    kept["white"] = np.random.default_rng(_SEED).normal(size=len(stamps))
    channels = {name: CubicSpline(stamps, x)(grid) for name, x in kept.items()}
    channels |= {"t": grid, "u": _mean_held(piece["u"], stamps, np.append(grid, grid[-1] + step))}
    return replace(piece, channels=channels, sample_time=step)


def mean_ahead(x: Array) -> Array:
    """Mean over the interval that begins at each sample of a smooth sampled signal, shape (n,)."""
    padded = np.concatenate([x[:1], x, np.full(2, x[-1])])
    return np.convolve(padded, MEAN_OF_FOUR[::-1], mode="valid")


def _mean_held(u: Array, stamps: Array, edges: Array) -> Array:
    """Mean of a u that is held between stamps, over the intervals between edges."""
    steps = np.diff(stamps)
    integral = np.concatenate([[0.0], np.cumsum(u[:-1] * steps)])
    ends = np.append(stamps, max(edges[-1], stamps[-1]) + steps[-1])
    integral = np.append(integral, integral[-1] + u[-1] * (ends[-1] - stamps[-1]))
    return np.asarray(np.diff(np.interp(edges, ends, integral)) / np.diff(edges))
