"""Play between motor and load, in the response of the acceleration to the force.

The motion of motor against load follows from the force alone, and does not drift: so the play is simulated, and only
its output is compared with a noisy sensor. Driven by the measured motion instead, noise would pick the load up.
"""

from __future__ import annotations

import math

import numpy as np

from dsd_cli.effects.backlash import CONTACT_DAMPING
from dsd_cli.effects.memory import Coupling, driven_motor
from dsd_cli.identify.search.signals import Signals
from dsd_cli.signals.log import Array

#: Longest Runge-Kutta step, radians of the free vibration: while searching, and for what is judged.
_COARSE, _FINE = 0.2, 0.05
#: Grid: own frequencies of the load in Hz (the last: times the sample rate), gaps per travel, shares.
_LOWEST, _HIGHEST, _FREQUENCIES = 3.0, 0.08, 8
_SMALLEST, _LARGEST, _GAPS = 3e-4, 0.15, 8
_SHARES = (0.25, 0.5, 0.75)
#: Starts that are refined, evaluations for each, and for the best one.
_STARTS, _EVALUATIONS, _LAST = 3, 90, 300
#: Edges of the first simplex: log frequency, log gap, logit of the share, log inertia, samples of delay.
_EDGES = (0.2, 0.3, 0.5, 0.05, 0.3)
#: Fastest free vibration, times the sample rate, and samples of delay that are looked at.
_FASTEST, _LATEST = 0.25, 5.0
#: Of a share: 1e-4 and 1 - 1e-4.
_MOST_LOGIT = 9.2
#: Step of a derivative.
_STEP = 1e-3


class Play:
    """Fits of a gap; `at` : (log own frequency in Hz, log gap, logit of the share, log inertia, samples of delay)."""

    def __init__(self, signals: Signals, travel: float) -> None:
        self.signals, self.travel = signals, travel

    def best(self) -> Array:
        """The play that leaves least, shape (5,)."""
        from scipy.optimize import minimize

        def squares(at: Array, step: float = _COARSE) -> float:
            if not self._sensible(at):
                return math.inf
            rest = self.left(at, step)
            found = float(rest @ rest)
            return found if math.isfinite(found) else math.inf

        starts = sorted(self._grid(), key=squares)
        distinct = [starts[0]]
        for at in starts[1:]:
            if len(distinct) < _STARTS and all(np.abs(at[1] - d[1]) > 0.5 for d in distinct):
                distinct.append(at)

        def settled(at: Array, evaluations: int, step: float) -> Array:
            simplex = np.vstack([at, at + np.diag(_EDGES)])
            limits = {"maxfev": evaluations, "initial_simplex": simplex, "xatol": 1e-5, "fatol": 0.0, "adaptive": True}
            return np.asarray(minimize(squares, at, args=(step,), method="Nelder-Mead", options=limits).x)

        best = min((settled(at, _EVALUATIONS, _COARSE) for at in distinct), key=squares)
        return settled(best, _LAST, _FINE)

    def left(self, at: Array, step: float = _FINE) -> Array:
        """What remains of the whitened acceleration, shape (n,), unit of u."""
        signals, (frequency, gap, share, inertia, late) = self.signals, _plain(at)
        coupling = Coupling.of(frequency, CONTACT_DAMPING, gap)
        moved = []
        for force, shift in zip(signals.force, signals.shift, strict=True):
            push = (force + late * shift) / ((1.0 - share) * inertia)
            moved.append(driven_motor(push, signals.step, coupling, share, step))
        return np.asarray(signals.target - signals.inertia * signals.rows(moved))

    def values(self, at: Array, variance: float) -> dict[str, tuple[float, float]]:
        """{parameter of the effect: (value, standard error)}; `variance` of a row."""
        slopes = [(self.left(at + _STEP * e) - self.left(at - _STEP * e)) / (2.0 * _STEP) for e in np.eye(len(at))]
        jacobian = np.stack(slopes, axis=1)
        covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
        given = _of_effect(at)
        rates = np.stack([(_of_effect(at + 1e-6 * e) - given) / 1e-6 for e in np.eye(len(at))], axis=1)
        spread = np.sqrt(np.maximum(np.diag(rates @ covariance @ rates.T), 0.0))
        names = ("gap", "load_share", "stiffness")
        return {n: (float(v), float(s)) for n, v, s in zip(names, given, spread, strict=True)}

    def _sensible(self, at: Array) -> bool:
        """Whether samples can tell such a load at all: far outside, a step of the integration takes ages."""
        frequency, gap, share, _, late = _plain(at)
        fastest = frequency / math.sqrt(1.0 - share)
        return 0.1 * _LOWEST < fastest < _FASTEST / self.signals.step and gap < self.travel and abs(late) < _LATEST

    def _grid(self) -> list[Array]:
        top = _HIGHEST / self.signals.step
        frequencies = np.geomspace(_LOWEST, max(top, 2.0 * _LOWEST), _FREQUENCIES)
        gaps = np.geomspace(_SMALLEST, _LARGEST, _GAPS) * self.travel
        inertia = self.signals.inertia
        return [
            np.array([math.log(f), math.log(gap), math.log(s / (1.0 - s)), math.log(j), 0.0])
            for f in frequencies
            for gap in gaps
            for s in _SHARES
            for j in (inertia, inertia / (1.0 - 0.5 * s))  # between the motor's alone and that of both
        ]


def _plain(at: Array) -> tuple[float, float, float, float, float]:
    f, gap, s, j, late = (float(x) for x in np.clip(at, -60.0, 60.0))
    s = min(max(s, -_MOST_LOGIT), _MOST_LOGIT)
    return math.exp(f), math.exp(gap), 1.0 / (1.0 + math.exp(-s)), math.exp(j), late


def _of_effect(at: Array) -> Array:
    """(gap, load's share, stiffness of the contact)."""
    frequency, gap, share, inertia, _ = _plain(at)
    return np.array([gap, share, share * inertia * (2.0 * math.pi * frequency) ** 2])
