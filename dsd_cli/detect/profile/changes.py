"""Change points: where two windows side by side are better explained by two states than by one.

Generalised likelihood ratio of the two windows of M samples that end at k - M and at k:

    nats(k) = [S(both) - S(before) - S(after)] / 2 sigma^2,

S the residual sum of squares of the best delay, inertia and effect values. The sums of both windows together are the
sum of their sums, so that this costs one fit more. It looks for a change of any direction in any of the values. One
window after the test's peak the change is placed: its time is the median of the likelihood of all splits of the two
windows between the two states, its uncertainty their spread. The next two windows begin after it: changes closer than
that are missed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsd_cli.detect.profile.likelihood import Fit, Sums, best
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.signals.log import Array

#: Q has forgotten a change when exp(-QUIET) of it is left.
QUIET = 12.0
#: Of the likelihood of all splits, what `low` and `high` leave out on each side.
TAIL = 0.025


class Side(NamedTuple):
    """The state on one side of a change: delay in s, inertia, index of the effect values."""

    delay: float
    inertia: float
    combination: int


class Change(NamedTuple):
    """A change of state.

    time : stamp of the first sample of the new state; low, high : it is between these with 95 %.
    detected : stamp at which the test passed its threshold; nats : its peak.
    """

    time: float
    low: float
    high: float
    detected: float
    nats: float
    before: Side
    after: Side


class Level(NamedTuple):
    """A fit: delay in steps of the lattice, alpha, effect values, square."""

    lag: float
    alpha: float
    combination: int
    square: float


class Found(NamedTuple):
    """A `Change` in the units of the fit."""

    time: float
    low: float
    high: float
    detected: float
    nats: float
    before: Level
    after: Level


class Evidence(NamedTuple):
    """What a pass of the detector has of its n samples: stamps, y, z, missing, windowed sums, and their fits."""

    clock: Array
    y: Array
    z: Array
    missing: NDArray[np.bool_]
    sums: Array
    fit: Fit


class _Peak(NamedTuple):
    row: int
    nats: float
    variance: float
    before: Level
    after: Level


class ChangeTest:
    """Fed block by block; `found` grows when a change is placed."""

    def __init__(
        self, settings: DetectorSettings, shape: tuple[int, int], width: int, known_alpha: float | None, pole: float
    ) -> None:
        self._settings, self._shape, self._width, self._pole = settings, shape, width, pole
        self._known_alpha = known_alpha
        self._memory = int(np.ceil(-QUIET / np.log(pole))) if pole > 0.0 else 0
        self.found: list[Found] = []
        self._peak: _Peak | None = None
        self.restart()

    def restart(self) -> None:
        """What comes next is another recording; what was found stays, a change that is being placed as it is now."""
        self.found = self.changes
        window = self._settings.window
        self._row = 0
        self._sums = np.zeros((window, self._width if self._settings.change > 0.0 else 0))
        # the last 4 M samples: fit; stamp, y, and z per group
        kept = 4 * window if self._settings.change > 0.0 else 0
        self._levels = np.zeros((kept, 4))
        self._past = np.zeros((kept, 2 + self._shape[0] * self._shape[1]))
        self._peak = None
        self._detected = np.nan
        self._blind = 0  # first sample whose two windows are clear of the last change

    @property
    def changes(self) -> list[Found]:
        """All changes, the last one where it is now even if it may still move."""
        return self.found if self._peak is None else [*self.found, self._placed(self._peak)[0]]

    def feed(self, evidence: Evidence, as_sums: Callable[[Array], Sums]) -> None:
        """The next samples."""
        if self._settings.change <= 0.0:
            return
        window, n = self._settings.window, len(evidence.y)
        levels = np.column_stack([evidence.fit.lag, evidence.fit.alpha, evidence.fit.combination, evidence.fit.square])
        raw = np.column_stack([evidence.clock, evidence.y, evidence.z.reshape(n, -1)])
        raw[evidence.missing, 1:] = 0.0  # says nothing, for any state
        for begin in range(0, n, window):
            part = slice(begin, min(begin + window, n))
            self._part(evidence.sums[part], levels[part], raw[part], as_sums)

    def _part(self, sums: Array, levels: Array, raw: Array, as_sums: Callable[[Array], Sums]) -> None:
        """At most one window of samples."""
        window, n = self._settings.window, len(sums)
        rows = self._row + np.arange(n)
        before_sums, before = self._sums[rows % window], self._levels[(rows - window) % len(self._levels)]
        self._sums[rows % window] = sums
        self._levels[rows % len(self._levels)], self._past[rows % len(self._past)] = levels, raw
        self._row += n
        use = np.flatnonzero(rows >= 2 * window - 1)
        if use.size == 0:
            return
        both = as_sums(before_sums[use] + sums[use])
        together, *_ = best(both, self._known_alpha)
        apart = before[use, 3] + levels[use, 3]
        variance = np.maximum(self._settings.rho**2, apart / np.maximum(both.votes - 4.0, 1.0))
        nats = (together.square - apart) / (2.0 * variance)
        for i in np.flatnonzero(nats > self._settings.change).tolist():
            k = int(use[i])
            self._above(int(rows[k]), float(nats[i]), float(variance[i]), before[k], levels[k])
        self._settle(self._row)

    def _above(self, row: int, nats: float, variance: float, before: Array, after: Array) -> None:
        """A sample at which the test is above its threshold."""
        self._settle(row)
        if row < self._blind:
            return
        if self._peak is None:
            self._detected = float(self._past[row % len(self._past), 0])
        if self._peak is None or nats > self._peak.nats:
            self._peak = _Peak(row, nats, variance, _level(before), _level(after))

    def _settle(self, now: int) -> None:
        """One window after its peak a change is placed; the next pair of windows begins when Q has forgotten it."""
        if self._peak is None or now - self._peak.row < self._settings.window:
            return
        found, row = self._placed(self._peak)
        self.found.append(found)
        self._peak = None
        self._blind = row + 2 * self._settings.window + self._memory

    def _placed(self, peak: _Peak) -> tuple[Found, int]:
        """The change at the median split of the two windows between the two states, and its sample."""
        window = self._settings.window
        rows = np.arange(peak.row - 2 * window + 1, peak.row + 1) % len(self._past)
        past = self._past[rows]
        before, after = self._clear_of_it(peak)
        cost = split_costs(self._residuals(past, before), self._residuals(past, after), self._pole)
        weight = np.exp(-(cost - cost.min()) / (2.0 * peak.variance))
        share = np.cumsum(weight) / weight.sum()
        # not the best split: where many are nearly as good it may stand outside of its own interval
        low, at, high = (int(np.searchsorted(share, level)) for level in (TAIL, 0.5, 1.0 - TAIL))
        time, early, late = (float(past[i + 1, 0]) for i in (at, low, min(high, cost.size - 1)))
        row = peak.row - 2 * window + 2 + at
        return Found(time, early, late, self._detected, peak.nats, before, after), row

    def _clear_of_it(self, peak: _Peak) -> tuple[Level, Level]:
        """The states a quarter of a window away from the change, where the fits are there."""
        window, kept = self._settings.window, len(self._levels)
        early, late = peak.row - window - window // 4, peak.row + window // 4
        before = _level(self._levels[early % kept]) if early >= window - 1 else peak.before
        return before, _level(self._levels[late % kept]) if late < self._row else peak.after

    def _residuals(self, past: Array, level: Level) -> Array:
        """y - alpha z at that level."""
        combos = self._shape[1]
        whole = min(int(level.lag), max(self._shape[0] - 2, 0))
        fraction = level.lag - whole
        z = past[:, 2 + whole * combos + level.combination]
        if fraction > 0.0:
            z = (1.0 - fraction) * z + fraction * past[:, 2 + (whole + 1) * combos + level.combination]
        return np.asarray(past[:, 1] - level.alpha * z)


def split_costs(before: Array, after: Array, pole: float) -> Array:
    """Residual sum of squares if the state changes at sample i = 1 .. n - 1; shape (n - 1,).

    Q does not follow at once: at k >= i it still holds p^(k - i + 1) of what the two predictions differed by at i - 1.

    Parameters
    ----------
    before, after : residuals of the two states, as if each had held throughout, shape (n,).
    """
    n, p = len(before), pole
    held = after - before  # minus the difference of the predictions
    echo, echoes = np.zeros(n + 1), np.zeros(n + 1)
    for k in range(n - 1, -1, -1):
        echo[k] = p * (after[k] + echo[k + 1])
        echoes[k] = p * p * (1.0 + echoes[k + 1])
    tail = np.cumsum((after**2)[::-1])[::-1]
    late = tail[1:] - 2.0 * held[:-1] * echo[1:n] + held[:-1] ** 2 * echoes[1:n]
    return np.asarray(np.cumsum(before**2)[:-1] + late)


def _level(row: Array) -> Level:
    return Level(float(row[0]), float(row[1]), int(row[2]), float(row[3]))
