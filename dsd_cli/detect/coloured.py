"""Noise of a sensor that passed the observer: its spectrum, and the filter that makes it white again.

d_hat = Q { Jn a - u } differentiates a velocity once and a position twice, so that their white noise comes out with the
spectrum |Q|^2 (b d + c d^2), d = 2 - 2 cos wT, b = (Jn s_v / T)^2, c = (Jn s_q / T^2)^2, beside the white rho^2. The
sum is |theta(z)|^2 / |1 - p z^-1|^2 up to a factor, with theta of second order and its zeros inside the unit circle.
The filter W = (1 - p z^-1) / theta, scaled, makes it white with standard deviation rho. It acts on y and on every
prediction alike, so that eq. 15 holds again as it is written.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from dsd_cli.signals.log import Array


class SensorNoise(NamedTuple):
    """White noise of the channel that d_hat was made from, standard deviations; 0 is none.

    Attributes
    ----------
    velocity : rad/s or m/s.
    position : rad or m; a step of an encoder is step / sqrt(12).
    """

    velocity: float = 0.0
    position: float = 0.0

    def __bool__(self) -> bool:
        return self.velocity > 0.0 or self.position > 0.0


class Whitening(NamedTuple):
    """W and what it is used with.

    Attributes
    ----------
    numerator, denominator : of W in z^-1.
    memory : samples after which it has forgotten how it began.
    bound : denominator of a filter whose impulse response is never below that of 1 / theta: its poles are the moduli.
    force_gain : what bound's response is multiplied by, to bound what a force on the axis leaves in W y.
    rho : standard deviation of what W leaves of the noise.
    """

    numerator: Array
    denominator: Array
    memory: int
    bound: Array
    force_gain: float
    rho: float


def spectrum(noise: SensorNoise, nominal_inertia: float, sample_time: float) -> tuple[float, float]:
    """b and c of |Q|^2 (b d + c d^2), in the square of the unit of u."""
    b = (nominal_inertia * noise.velocity / sample_time) ** 2
    return b, (nominal_inertia * noise.position / sample_time**2) ** 2


def whitening(rho: float, b: float, c: float, pole: float) -> Whitening:
    """The spectral factor of rho^2 |1 - p z^-1|^2 + (1 - p)^2 (b d + c d^2), a polynomial in x = z + 1/z = 2 - d."""
    p, gain = pole, (1.0 - pole) ** 2
    polynomial = [
        gain * c,
        -(rho**2) * p - gain * (b + 4.0 * c),
        rho**2 * (1.0 + p * p) + gain * (2.0 * b + 4.0 * c),
    ]
    zeros = []
    for x in np.roots(polynomial):
        pair = np.roots([1.0, -x, 1.0])  # z + 1/z = x: one inside the unit circle, one outside
        zeros.append(pair[np.abs(pair).argmin()])
    theta = np.real(np.poly(zeros)) if zeros else np.ones(1)
    at_nyquist = np.polyval(polynomial, -2.0)  # d = 4: nothing cancels there
    scale = rho * abs(np.polyval(theta, -1.0)) / np.sqrt(at_nyquist)
    slowest = max([abs(zero) for zero in zeros], default=0.0)
    memory = 0 if slowest == 0.0 else int(np.ceil(np.log(0.01) / np.log(min(slowest, 0.9999))))
    bound = np.asarray(np.poly(np.abs(zeros)), dtype=np.float64) if zeros else np.ones(1)
    return Whitening(scale * np.array([1.0, -p]), theta, memory, bound, scale * (1.0 - p), rho)


class Whitened:
    """A prediction (`numpy_prediction`) whose y and z pass W; rows that W's own start still disturbs are warm-up.

    What friction did in an interval without a vote (its sign is infinite, see `detect.rest`) is not known, and W
    remembers it for long. It may have been the whole budget: as much is added to the variance of the rows it acts on.
    """

    def __init__(self, prediction: Any, found: Whitening) -> None:
        self._prediction, self._found = prediction, found
        self._state: Array | None = None
        self._warm = 0
        self._last = 0.0
        self._unknown = np.zeros(max(len(found.bound), 2) - 1)

    def step(self, u: float, d_hat: float) -> tuple[float, list[float], bool]:
        """(y, z, warm) of one sample."""
        y, z, warm = self.run(np.array([u]), np.array([d_hat]), None, None, None, None)
        return float(y[0]), z[0].tolist(), bool(warm)

    def run(self, u: Any, d: Any, t: Any, force: Any, budget: Any, sign: Any) -> tuple[Array, Array, int]:
        """(y of shape (n,), z of shape (n, groups), number of rows at the end that are past the warm-up)."""
        from scipy.signal import lfilter  # slow to import

        y, z, warm = self._prediction.run(u, d, t, force, budget, sign)
        rows = np.column_stack([self._without_holes(y, np.isfinite(d)), z])
        if self._state is None:
            self._state = np.zeros((max(len(self._found.denominator), 2) - 1, rows.shape[1]))
        out, self._state = lfilter(self._found.numerator, self._found.denominator, rows, axis=0, zi=self._state)
        if sign is not None:
            out *= self._weights(budget, sign)[:, None]
        settled = max(self._warm + warm - self._found.memory, 0)
        self._warm += warm
        return out[:, 0], out[:, 1:], min(settled, warm)

    def _weights(self, budget: Array, sign: Array) -> Array:
        """Standard deviation of the noise over that of noise and unknown friction, shape (n,)."""
        from scipy.signal import lfilter

        found, unknown = self._found, np.where(np.isinf(sign), budget.max(axis=1), 0.0)
        left, self._unknown = lfilter([found.force_gain], found.bound, unknown, zi=self._unknown)
        return np.asarray(found.rho / np.hypot(found.rho, left))

    def _without_holes(self, y: Array, measured: Any) -> Array:
        """y held where nothing was measured: a jump to 0 would ring in W."""
        at = np.maximum.accumulate(np.where(measured, np.arange(1, len(y) + 1), 0))
        held = np.concatenate([[self._last], y])[at]
        self._last = float(held[-1])
        return np.asarray(held)
