"""A log cut at its gaps into evenly spaced stretches: what every check starts from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dsd_cli.plant.filtering import irregular_stamps
from dsd_cli.signals.log import Array, Log

#: Samples of the shortest stretch that is looked at.
SHORTEST = 50
#: A jump of the position by more than this share of its whole range, and by this many usual steps, is a wrap.
WRAP_SHARE, WRAP_STEPS = 0.4, 20.0


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
    wraps: int = 0
    turn: float = 0.0


def cut(log: Log, restarts: Sequence[int], true_stamps: bool) -> list[Stretch]:
    """The stretches of a log that are long enough.

    Parameters
    ----------
    restarts : samples that do not continue the one before.
    true_stamps : irregular stamps say when the samples were taken; else they are noise on a regular clock.
    """
    edges = [0, *(at for at in restarts if 0 < at < len(log)), len(log)]
    return [_stretch(log, a, b, true_stamps) for a, b in pairwise(edges) if b - a >= SHORTEST]


def stamps_of(log: Log) -> Array:
    """t, shape (n,); from the sample time where the log has none."""
    if "t" in log:
        return log["t"]
    return np.arange(len(log), dtype=np.float64) * log.sample_time


def _stretch(log: Log, a: int, b: int, true_stamps: bool) -> Stretch:
    channels = {name: np.array(log[name][a:b]) for name in ("u", "position", "velocity", "d_hat") if name in log}
    t, T = stamps_of(log)[a:b], log.sample_time
    wraps, turn = 0, 0.0
    if "position" in channels:
        channels["position"], wraps, turn = unwrapped(channels["position"])
    if true_stamps and irregular_stamps(log) is not None:
        T = float(np.mean(np.diff(t)))
        grid = t[0] + T * np.arange(int((t[-1] - t[0]) / T) + 1)
        channels = {name: _on_grid(x, t, grid, T, name == "u" and log.u_hold == "held") for name, x in channels.items()}
        t = grid
    u, position, velocity, d_hat = (channels.get(name) for name in ("u", "position", "velocity", "d_hat"))
    return Stretch(T, t, u, position, velocity, d_hat, wraps, turn)


def _on_grid(x: Array, t: Array, grid: Array, T: float, held: bool) -> Array:
    """A channel of irregular stamps at even ones; of a held u the mean over the interval that follows."""
    if not held:
        return np.asarray(np.interp(grid, t, x))
    integral = np.concatenate([[0.0], np.cumsum(x[:-1] * np.diff(t))])
    ends = np.concatenate([grid, [grid[-1] + T]])
    beyond = np.maximum(ends - t[-1], 0.0) * x[-1]
    return np.diff(np.interp(ends, t, integral) + beyond) / T


def unwrapped(q: Array) -> tuple[Array, int, float]:
    """(position without its jumps of one turn, how many there were, their size)."""
    steps = np.diff(q)
    if steps.size == 0:
        return q, 0, 0.0
    usual, span = float(np.percentile(np.abs(steps), 95)), float(np.ptp(q))
    jumps = np.flatnonzero((np.abs(steps) > WRAP_SHARE * span) & (np.abs(steps) > WRAP_STEPS * usual))
    if jumps.size == 0 or jumps.size > 0.02 * q.size:
        return q, 0, 0.0
    sizes = np.abs(steps[jumps])
    turn = _whole_turn(float(np.median(sizes)), usual)
    if np.max(np.abs(sizes - turn)) > 2.0 * usual + 1e-6 * turn:
        return q, 0, 0.0
    offsets = np.zeros(q.size)
    offsets[jumps + 1] = -np.sign(steps[jumps]) * turn
    return q + np.cumsum(offsets), int(jumps.size), turn


def _whole_turn(size: float, usual: float) -> float:
    """The turn that a jump stands for: a known one if there is one within the usual step, else the jump itself."""
    counts = 2.0 ** np.arange(8, 33)
    known = np.array([2.0 * np.pi, np.pi, 360.0, 180.0, 1.0, *counts, 1000.0, 4000.0, 10000.0, 100000.0, 1e6])
    near = known[np.argmin(np.abs(known - size))]
    return float(near) if abs(near - size) <= 2.0 * usual + 1e-6 * size else size
