"""A load that swings on the motor, in the response of the acceleration to the force.

    a = (1/J) [ 1 + k s^2 / (s^2 + 2 z w s + w^2) ] F(t - L) + noise,      k = s_l / (1 - s_l), s_l the load's share

Two masses with a spring and a damper between them, as rigid body and vibration mode: linear in 1/J and k.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from dsd_cli.identify.search.signals import Signals, coefficients, left
from dsd_cli.signals.log import Array
from dsd_cli.signals.windows import smooth_size

_Spectrum = NDArray[np.complex128]
#: Ratio from one frequency to the next that is tried, and damping ratios of the mode.
_RATIO, _DAMPINGS = 1.07, (0.02, 0.1)
#: Time constants of a lag that are tried in the mode's place, s: from a sample to this.
_LONGEST_LAG, _LAGS = 0.1, 15
#: Rounds of Gauss and Newton, halvings of a step, step of a derivative.
_ROUNDS, _HALVINGS, _STEP = 20, 6, 1e-4
#: Share of the sum of squares that a round must take off, or the mode is found.
_FOUND = 1e-7
#: Share of its power that a mode must have beside a rigid body to be told from it.
_LEAST_OWN = 1e-12


class Modes:
    """Fits of one vibration mode; `at` : log of (frequency in Hz, damping ratio) of the mode, shape (2,)."""

    def __init__(self, signals: Signals) -> None:
        self.signals = signals
        self._fixed = [signals.rows(signals.force), signals.rows(signals.shift)]
        self._sizes = [smooth_size(2 * len(x)) for x in signals.force]
        self._spectra = [np.fft.rfft(x, n) for x, n in zip(signals.force, self._sizes, strict=True)]
        self._hz = [np.fft.rfftfreq(n, signals.step).astype(np.float64) for n in self._sizes]
        self._bent = [-(f**2) * x for f, x in zip(self._hz, self._spectra, strict=True)]

    def rigid(self) -> Array:
        """Columns, shape (n, 2), of a rigid axis, or of one behind the lag that leaves least."""
        times = np.geomspace(self.signals.step, _LONGEST_LAG, _LAGS).tolist()
        plain, shift = self._fixed
        lagged = [self._passed(self._spectra, _lag(float(time))) for time in times]
        found = [np.stack([x, shift], axis=1) for x in (plain, *lagged)]
        return min(found, key=lambda columns: float(np.sum(left(columns, self.signals.target) ** 2)))

    def best(self, lowest: float, highest: float) -> Array:
        """The mode between these frequencies (Hz) that leaves least; it may end beside them."""
        frequencies = np.exp(np.arange(math.log(lowest), math.log(highest), math.log(_RATIO)))
        tried = [np.array([math.log(f), math.log(z)]) for f in frequencies.tolist() for z in _DAMPINGS]
        basis = np.linalg.qr(np.stack(self._fixed, axis=1))[0]
        rest = self.signals.target - basis @ (basis.T @ self.signals.target)

        def gain(at: Array) -> float:
            mode = self._mode(at)
            own = mode - basis @ (basis.T @ mode)
            size = float(own @ own)
            return float(own @ rest) ** 2 / size if size > _LEAST_OWN * float(mode @ mode) else 0.0

        return self.refined(max(tried, key=gain))

    def left(self, at: Array) -> Array:
        """What the best rigid body and mode leave, shape (n,)."""
        return left(self.columns(at), self.signals.target)

    def early(self, at: Array) -> float:
        """Samples by which u acts earlier than the signals have it."""
        found = coefficients(self.columns(at), self.signals.target)
        return float(found[1] / found[0]) if found[0] > 0.0 else 0.0

    def values(self, at: Array, variance: float) -> tuple[dict[str, tuple[float, float]], float]:
        """({parameter: (value, standard error)} of a flexible coupling, damping ratio of the mode).

        variance : of a row.
        """
        columns = self.columns(at)
        found = coefficients(columns, self.signals.target)
        slopes = [(self.columns(at + _STEP * e) - columns) @ found / _STEP for e in np.eye(2)]
        jacobian = np.column_stack([*slopes, columns])
        size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
        scaled = jacobian / size
        covariance = variance * np.linalg.pinv(scaled.T @ scaled) / size / size[:, None]
        given = np.concatenate([at, found])
        tiny = 1e-6 * np.maximum(np.abs(given), 1e-12)
        rates = np.stack([(_of_effect(given + d) - _of_effect(given)) / d.sum() for d in np.diag(tiny)], axis=1)
        spread = np.sqrt(np.maximum(np.diag(rates @ covariance @ rates.T), 0.0))
        names = ("frequency", "load_share", "damping")
        told = {n: (float(v), float(s)) for n, v, s in zip(names, _of_effect(given), spread, strict=True)}
        return told, float(np.exp(at[1]))

    def _passed(self, spectra: Sequence[_Spectrum], resists: Callable[[Array], Array]) -> Array:
        """Spectra of the force divided by what resists it at a frequency (Hz): a causal response from rest, as rows."""
        parts = zip(spectra, self._hz, self._sizes, self.signals.force, strict=True)
        return self.signals.rows([np.fft.irfft(x / resists(f), n)[: len(force)] for x, f, n, force in parts])

    def _mode(self, at: Array) -> Array:
        """Rows of the mode."""
        frequency, damping = math.exp(at[0]), math.exp(at[1])

        def resists(f: Array) -> Array:
            return np.asarray((frequency**2 - f**2) + 2j * damping * frequency * f)

        return self._passed(self._bent, resists)

    def columns(self, at: Array) -> Array:
        """Rigid body, a sample of delay, and mode: shape (n, 3)."""
        return np.stack([*self._fixed, self._mode(at)], axis=1)

    def refined(self, at: Array) -> Array:
        """Gauss-Newton with halved steps; linear coefficients are solved for at every point (variable projection)."""
        rest = self.left(at)
        for _ in range(_ROUNDS):
            slopes = np.stack([(self.left(at + _STEP * e) - rest) / _STEP for e in np.eye(2)], axis=1)
            move = -np.linalg.lstsq(slopes, rest, rcond=None)[0]
            move *= min(1.0, 0.5 / max(float(np.abs(move).max()), 1e-300))
            for _ in range(_HALVINGS):
                found = self.left(at + move)
                if found @ found < rest @ rest:
                    break
                move = 0.5 * move
            else:
                return at
            done = float(found @ found) > (1.0 - _FOUND) * float(rest @ rest)
            at, rest = at + move, found
            if done:
                break
        return at


def _lag(time: float) -> Callable[[Array], Array]:
    return lambda f: np.asarray(1.0 + 2j * np.pi * f * time)


def _of_effect(given: Array) -> Array:
    """(resonance in Hz, load's share, damping of the load on a held motor) of (log f, log z, J0/J, -, J0 k/J)."""
    frequency, damping = np.exp(given[:2])
    ratio = given[4] / given[2] if given[2] > 0.0 else -1.0
    share = ratio / (1.0 + ratio) if ratio > -1.0 else -1.0
    return np.array([frequency, share, damping * math.sqrt(max(1.0 - share, 0.0))])
