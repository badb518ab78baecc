"""The speed at the start of a log that has neither speed nor position.

Integrating u and d_hat gives the speed but for a constant, and the position but for a ramp. Forces are what shows them:
friction jumps where the speed is truly zero, and springs, gravity and cogging come back at the same place only if the
position does not creep. So the constant (and a slow drift) is the one with which functions of speed and position
explain the net force best. Where the axis often rests, the rests themselves show it, from one to the next: noise of
d_hat makes the integrated speed a random walk, and friction taken to drive an axis that sticks is a large error.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.golden import golden_section
from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.runs import runs
from dsd_cli.signals.spread import robust_deviation

#: Samples that are averaged, the most averages, and hats over speed (each side of zero) and position.
AVERAGED, MOST_ROWS, SPEED_HATS, PLACE_HATS = 5, 4000, 6, 24
#: Offsets that are tried first, as multiples of the speed's standard deviation around its mean; then by golden section.
REACH, GRID, STEPS = 1.0, 81, 14
#: Samples over which the net force is averaged, share of the rms speed that counts as one speed, how often it must come
#: (of the most frequent), and by which factor a speed of rest may explain the force worse than the best constant.
QUIET, WIDTH, FREQUENT, PREFERENCE = 20, 5e-3, 0.1, 2.0
#: The net force is none within so many standard deviations of its noise, and in this share of the samples at least;
#: rests that show a ramp: how many, and over which part of the log.
NONE, LEAST_QUIET, RESTS_OF_RAMP, PART_OF_RAMP = 3.0, 0.1, 3, 0.5
#: Rests that follow each other: their shortest and longest piece (samples; both longer where the log is longer than so
#: many of the longest), how far from the constant they may be (share of the rms speed), by how many standard deviations
#: of the random walk and by which share of the rms speed the next may differ, which part of the log they must be and
#: span.
SHORTEST_REST, LONGEST_REST, MOST_RESTS = 30, 100, 2000
NEAR, WALKS, STEADY, RESTS, SPANNED = 0.1, 4.0, 2e-3, 0.1, 0.5


def drift(speed: Array, force: Array, piece: Log, walk: float) -> Array:
    """What is to be taken off an integrated speed, shape (n,): a constant and a slow ramp, or what the rests show.

    walk : standard deviation by which noise makes the speed wander in 1 s.
    """
    rms = float(np.std(speed))
    if not rms > 0.0:
        return np.full(len(speed), float(speed[0]))
    quiet = _quiet(force)
    found = _by_forces(speed, force, quiet, piece, rms)
    rests = _followed(speed, quiet, piece["t"], walk, found)
    return found if rests is None else rests


def _by_forces(speed: Array, force: Array, quiet: NDArray[np.bool_], piece: Log, rms: float) -> Array:
    """The constant with which functions of speed and position explain the force best; a ramp where rests show it."""
    n = len(speed)
    rows = _Rows(speed, force, piece)
    grid = float(np.mean(speed)) + rms * np.linspace(-REACH, REACH, GRID)
    rests = _frequent(speed[quiet], rms)
    least = min(rows.travel(x) for x in grid)
    found = {float(x): rows.squares(x) for x in (*grid, *rests) if rows.travel(x) <= POLICY.most_travel * least}
    start = min(found, key=lambda x: found[x])
    rest = min((x for x in rests if x in found), key=lambda x: found[x], default=None)
    if rest is not None and found[rest] < PREFERENCE * found[start]:
        return _with_ramp(speed, quiet, rest, rms)
    half = float(grid[1] - grid[0])
    offset = golden_section(rows.squares, start - half, start + half, STEPS)
    return np.full(n, offset)


def _quiet(force: Array) -> NDArray[np.bool_]:
    """Whether each sample is without net force, shape (n,): the axis rests or cruises there."""
    mean = np.abs(np.convolve(force, np.ones(QUIET) / QUIET, "same"))
    noise = robust_deviation(np.diff(force)) / np.sqrt(2.0 * QUIET)
    return np.asarray(mean < max(NONE * noise, float(np.quantile(mean, LEAST_QUIET))))


def _frequent(quiet: Array, rms: float) -> list[float]:
    """Of the speeds without net force, those that come often: rest, and usual speeds of the moves."""
    width = WIDTH * rms
    levels, counts = np.unique(np.round(quiet / width).astype(np.int64), return_counts=True)
    often = levels[counts >= FREQUENT * counts.max()] if levels.size else levels
    return [float(np.median(quiet[np.abs(quiet - level * width) <= width])) for level in often]


def _with_ramp(speed: Array, quiet: NDArray[np.bool_], rest: float, rms: float) -> Array:
    """The speed of the rests, as a line where they are spread over the log."""
    n = len(speed)
    at_rest = np.flatnonzero(quiet & (np.abs(speed - rest) <= 2.0 * WIDTH * rms))
    if at_rest.size < RESTS_OF_RAMP or np.ptp(at_rest) < PART_OF_RAMP * n:
        return np.full(n, rest)
    centre = float(at_rest.mean())
    slope, offset = np.polyfit(at_rest - centre, speed[at_rest], 1)
    return np.asarray(offset + slope * (np.arange(n) - centre))


def _followed(speed: Array, quiet: NDArray[np.bool_], t: Array, walk: float, found: Array) -> Array | None:
    """The speed of the rests, a line from each to the next; None where they are too few.

    Of all pieces without net force near the drift that was `found`, those count that follow each other as a random walk
    may, the longest such chain: slow moves at a constant speed leave it.
    """
    n, rms = len(speed), float(np.std(speed))
    longest = max(LONGEST_REST, n // MOST_RESTS)
    shortest = SHORTEST_REST * longest // LONGEST_REST
    pieces = [
        (int(a), int(b))
        for start, end in runs(quiet)
        if end - start >= shortest
        for a, b in pairwise(np.linspace(start, end, max(1, (end - start) // longest) + 1).astype(int))
    ]
    near = [
        (a, b)
        for a, b in pieces
        if np.std(speed[a:b]) < 2.0 * WIDTH * rms and abs(float(np.mean(speed[a:b] - found[a:b]))) < NEAR * rms
    ]
    if not near:
        return None
    at = np.array([t[a:b].mean() for a, b in near])
    level = np.array([speed[a:b].mean() for a, b in near])
    lasting = np.array([b - a for a, b in near], dtype=np.float64)
    chain = _longest_chain(at, level, lasting, walk, STEADY * rms)
    if lasting[chain].sum() < RESTS * n or at[chain[-1]] - at[chain[0]] < SPANNED * (t[-1] - t[0]):
        return None
    return found + np.interp(t, at[chain], level[chain] - np.interp(at[chain], t, found))


def _longest_chain(at: Array, level: Array, lasting: Array, walk: float, steady: float) -> list[int]:
    """Of levels at times, those that follow each other within the walk and together last longest."""
    total, before = lasting.copy(), np.full(len(at), -1)
    for j in range(1, len(at)):
        reach = WALKS * walk * np.sqrt(at[j] - at[:j]) + steady
        there = np.where(np.abs(level[:j] - level[j]) <= reach, total[:j], 0.0)
        best = int(np.argmax(there))
        if there[best] > 0.0:
            total[j], before[j] = there[best] + lasting[j], best
    chain = [int(np.argmax(total))]
    while before[chain[-1]] >= 0:
        chain.append(int(before[chain[-1]]))
    return chain[::-1]


class _Rows:
    """Averages over a few samples, for quick fits."""

    def __init__(self, speed: Array, force: Array, piece: Log) -> None:
        self._every = max(AVERAGED, len(speed) // MOST_ROWS)
        self._speed, self._time = self._mean(speed), self._mean(piece["t"] - piece["t"][0])
        self._force, self._u = self._mean(force), self._mean(np.concatenate([piece["u"][:1], piece["u"][:-1]]))
        self._step = np.diff(self._time, prepend=0.0)

    def _mean(self, x: Array) -> Array:
        rows = len(x) // self._every
        return np.asarray(x[: rows * self._every].reshape(rows, self._every).mean(axis=1))

    def travel(self, offset: float) -> float:
        """Range of the position with that taken off the speed."""
        return float(np.ptp(np.cumsum((self._speed - offset) * self._step)))

    def squares(self, offset: float) -> float:
        """What functions of speed and position leave of the net force, with that taken off the speed."""
        speed = self._speed - offset
        place = np.cumsum(speed * self._step)
        columns = [self._u, *_hats(place, PLACE_HATS)]
        for side in (1.0, -1.0):
            moving = side * speed > 0.0
            if moving.sum() > SPEED_HATS:
                columns += [hat * moving for hat in _hats(side * speed, SPEED_HATS, moving)]
        x = np.stack(columns)
        gram = x @ x.T
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        weights = np.linalg.solve(gram / np.outer(size, size) + 1e-6 * np.eye(len(x)), (x @ self._force) / size) / size
        return float(np.sum((self._force - weights @ x) ** 2))


def _hats(x: Array, count: int, among: NDArray[np.bool_] | None = None) -> list[Array]:
    """Linear B-splines over quantiles of x."""
    knots = np.unique(np.quantile(x if among is None else x[among], np.linspace(0.0, 1.0, count)))
    return [np.interp(x, knots, unit) for unit in np.eye(len(knots))]
