"""A log cut at its gaps into evenly spaced stretches: what every check starts from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dsd_cli.identify.recordings.jumps import continuous, in_pieces
from dsd_cli.plant.filtering import irregular_stamps
from dsd_cli.signals.log import Array, Log

#: Samples of the shortest stretch that is looked at.
SHORTEST = 50
#: In the order of `Stretch`.
_CHANNELS = ("u", "position", "velocity", "d_hat", "reference")


@dataclass(frozen=True)
class Stretch:
    """Samples T apart; each channel of shape (n,), None where it is not logged.

    `position` has its wraps undone. `wraps` : how often it jumped, `turn` : by how much (its unit).
    """

    T: float
    t: Array
    u: Array | None
    position: Array | None
    velocity: Array | None
    d_hat: Array | None
    reference: Array | None = None
    wraps: int = 0
    turn: float = 0.0


def cut(log: Log, restarts: Sequence[int], true_stamps: bool) -> list[Stretch]:
    """The stretches of a log that are long enough.

    Parameters
    ----------
    restarts : samples that do not continue the one before.
    true_stamps : irregular stamps say when the samples were taken; else they are noise on a regular clock.
    """
    _, edges = in_pieces(log, restarts)
    return [_stretch(log, a, b, true_stamps) for a, b in pairwise(edges) if b - a >= SHORTEST]


def stamps_of(log: Log) -> Array:
    """t, shape (n,); from the sample time where the log has none."""
    if "t" in log:
        return log["t"]
    return np.arange(len(log), dtype=np.float64) * log.sample_time


def _stretch(log: Log, a: int, b: int, true_stamps: bool) -> Stretch:
    channels = {name: np.array(log[name][a:b]) for name in _CHANNELS if name in log}
    t, T = stamps_of(log)[a:b], log.sample_time
    wraps, turn = 0, 0.0
    if "position" in channels:
        channels["position"], wraps, turn, *_ = continuous(channels["position"])
    if true_stamps and irregular_stamps(log) is not None:
        T = float(np.mean(np.diff(t)))
        grid = t[0] + T * np.arange(int((t[-1] - t[0]) / T) + 1)
        channels = {name: _on_grid(x, t, grid, T, name == "u" and log.u_hold == "held") for name, x in channels.items()}
        t = grid
    u, position, velocity, d_hat, reference = (channels.get(name) for name in _CHANNELS)
    return Stretch(T, t, u, position, velocity, d_hat, reference, wraps, turn)


def _on_grid(x: Array, t: Array, grid: Array, T: float, held: bool) -> Array:
    """A channel of irregular stamps at even ones; of a held u the mean over the interval that follows."""
    if not held:
        return np.asarray(np.interp(grid, t, x))
    integral = np.concatenate([[0.0], np.cumsum(x[:-1] * np.diff(t))])
    ends = np.concatenate([grid, [grid[-1] + T]])
    beyond = np.maximum(ends - t[-1], 0.0) * x[-1]
    return np.diff(np.interp(ends, t, integral) + beyond) / T
