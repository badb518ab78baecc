"""Where the search for a shape parameter begins, for effects whose shape is seen in the residual."""

from __future__ import annotations

import numpy as np

from dsd_cli.effects import Ranges, Role, Shape
from dsd_cli.identify.fit.bank import Term, drive, raw_columns
from dsd_cli.identify.fit.rows import Equations
from dsd_cli.identify.fit.solve import Fit
from dsd_cli.signals.log import Array

#: Lines of a spectrum that are followed up, and bins over the position.
LINES, BINS = 4, 4096
#: A line has at least this many periods in the log (in the travel), else it is a trend.
LEAST_PERIODS = 2.5
#: Damping ratio with which the search for a ringing load begins.
RINGING = 0.05


def starts(effect_id: str, found: Ranges, residual: Residual) -> list[Shape]:
    """Starting shapes of an effect; of those that show up as lines, the strongest lines of the residual."""
    if effect_id == "periodic_disturbance":
        return [{"frequency": f} for f in residual.lines_in_time()]
    if effect_id == "cogging":
        return [{"periods": n} for n in residual.lines_over_position()]
    known = Term(effect_id).effect.starts(found)
    if effect_id == "flexible_coupling":
        # a load that is hardly damped rings: its line lies at or above the frequency that it has alone
        lines = [f * below for f in residual.lines_in_time() for below in (1.0, 0.8)]
        known = [*known, *({"frequency": f, "damping": RINGING} for f in lines)]
    return known


class Residual:
    """What a fit leaves, per stretch, as the observer sees it (not whitened), unit of u."""

    def __init__(self, equations: Equations, fit: Fit) -> None:
        self.equations = equations
        self.values = residual_of(equations, fit)

    def by_stretch(self) -> list[Array]:
        """One array per stretch, from `startup` on."""
        edges = np.cumsum([len(s.log) - self.equations.startup for s in self.equations.stretches])[:-1]
        return list(np.split(self.values, edges))

    def lines_in_time(self) -> list[float]:
        """Frequencies of the strongest lines, Hz."""
        parts = self.by_stretch()
        size = 2 * max(len(x) for x in parts)
        power = sum(np.abs(np.fft.rfft(x - x.mean(), size)) ** 2 for x in parts)
        step = 1.0 / (size * self.equations.sample_time)
        shortest = LEAST_PERIODS / (max(len(x) for x in parts) * self.equations.sample_time)
        return [k * step for k in _peaks(np.asarray(power), int(shortest / step) + 1)]

    def lines_over_position(self) -> list[float]:
        """Spatial frequencies of the strongest lines, rad per unit of position."""
        skip, observer = self.equations.startup, self.equations.observer
        places = []
        for s in self.equations.stretches:
            seen = s.frame.filtered(s.motion.position, observer, float(s.motion.position[0]))  # as late as the residual
            places.append(seen[skip:])
        place = np.concatenate(places)
        travel = float(np.ptp(place))
        if not travel > 0.0:
            return []
        bins = np.minimum(((place - place.min()) / travel * BINS).astype(int), BINS - 1)
        sums = np.bincount(bins, self.values - self.values.mean(), BINS)
        power = np.abs(np.fft.rfft(sums, 2 * BINS)) ** 2
        step = 2.0 * np.pi / (2.0 * travel)
        top = max(float(np.nanmax(np.abs(s.motion.velocity))) for s in self.equations.stretches)
        highest = 0.5 * np.pi / max(top * self.equations.sample_time, 1e-300)  # half of what sampling can follow
        return [k * step for k in _peaks(power[: int(highest / step) + 1], int(2 * LEAST_PERIODS))]


def residual_of(equations: Equations, fit: Fit) -> Array:
    """y less what the fit explains, as the observer sees it, of all stretches from `startup` on."""
    from dsd_cli.identify.fit.bank import inputs_of

    inputs = inputs_of(fit.terms)
    left = equations.plain_measured()
    for coefficient, tap in zip(fit.total[:2], (fit.tap, fit.tap + 1), strict=True):
        if coefficient != 0.0:
            left = left - coefficient * equations.plain(drive(equations, inputs, tap))
    for term in fit.terms:
        if term.effect.role is not Role.INPUT:
            for coefficient, raw in zip(fit.coefficients(term), raw_columns(equations, term, fit.tap), strict=True):
                left = left - coefficient * equations.plain(raw)
    return left


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
