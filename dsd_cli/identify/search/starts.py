"""Where the search for a shape begins: from what the log exercises, and from the lines of the residual's spectrum."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from dsd_cli.effects import Ranges, Shape, get_effect
from dsd_cli.identify.fit.errors import Errors
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.identify.policy import POLICY
from dsd_cli.signals.log import Array

#: Lines of a spectrum that are followed up, and bins over the position.
LINES, BINS = 4, 4096
#: Quantile of the speed at which a ripple over the position must pass the band.
SLOW = 0.25


def starts(effect_id: str, found: Ranges, lines: Lines) -> list[Shape]:
    """Starting shapes of an effect: those over the ranges of the log, and those that the residual's lines suggest."""
    effect = get_effect(effect_id)
    return [*effect.starts(found), *effect.seeds(lines)]


class Lines:
    """Lines in the spectrum of what a fit leaves (rows in the unit of u)."""

    def __init__(self, errors: Errors, fit: Fit) -> None:
        self._equations = errors.equations
        self._residual = errors.residual(fit, held_out=False)

    @cached_property
    def over_time(self) -> tuple[float, ...]:
        """Frequencies of the strongest lines, Hz."""
        parts = self._equations.by_stretch(self._residual)
        row_time = self._equations.band.step * self._equations.sample_time
        size = 2 * max(len(x) for x in parts)
        power = sum(np.abs(np.fft.rfft(x - x.mean(), size)) ** 2 for x in parts if len(x))
        step = 1.0 / (size * row_time)
        shortest = POLICY.least_periods / (max(len(x) for x in parts) * row_time)
        last = int(self._equations.band.hz / step) + 1
        return tuple(k * step for k in _peaks(np.asarray(power)[:last], int(shortest / step) + 1))

    @cached_property
    def over_position(self) -> tuple[float, ...]:
        """Spatial frequencies of the strongest lines, rad per unit of position."""
        stretches = self._equations.stretches
        if any("position" not in s.log for s in stretches):
            return ()
        place = self._equations.of_rows([s.log["position"] for s in stretches])
        speed = np.abs(self._equations.of_rows([s.log["velocity"] for s in stretches]))
        travel = float(np.ptp(place))
        usual = float(np.quantile(speed[speed > 0.0], SLOW)) if np.any(speed > 0.0) else 0.0
        if not travel > 0.0 or not usual > 0.0:
            return ()
        bins = np.minimum(((place - place.min()) / travel * BINS).astype(int), BINS - 1)
        sums = np.bincount(bins, self._residual - self._residual.mean(), BINS)
        power = np.abs(np.fft.rfft(sums, 2 * BINS)) ** 2
        step = 2.0 * np.pi / (2.0 * travel)
        highest = 2.0 * np.pi * self._equations.band.hz / usual  # what passes the band at such speeds
        told = POLICY.resolved_deviations * max(r.position_noise for r in self._equations.recordings)
        highest = min(highest, 2.0 * np.pi / max(told, 1e-300))  # a line of the sensor's own counts is no force
        return tuple(k * step for k in _peaks(power[: int(highest / step) + 1], int(2 * POLICY.least_periods)))


def _peaks(power: Array, first: int) -> list[int]:
    """Positions of the highest local maxima over the local background, strongest first."""
    if len(power) < first + 8:
        return []
    width = min(max(len(power) // 50, 8), (len(power) - 1) // 2)
    background = np.convolve(power, np.ones(2 * width + 1), "same") / (2 * width + 1)
    strength = power / np.maximum(background, 1e-300)
    strength[:first] = 0.0
    inner = strength[1:-1]
    local = np.flatnonzero((inner >= strength[:-2]) & (inner >= strength[2:])) + 1
    return local[np.argsort(strength[local])[::-1][:LINES]].tolist()
