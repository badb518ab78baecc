"""The states of eq. 6: what d(d_hat)/dt must be, from u and d_hat alone, if the damping is B_i.

The net force on a plant with damping is y = u + d_hat = Q Jn a (eq. 13 without a model), and J a' = u'(t - L) - B a, so

    d(d_hat)/dt = Jn/J u'(t - L) - (B/J)(u + d_hat) - u'

which is eq. 6 with the sign of this project, for an observer that knows of no damping (there B_n is 0, so dB_i = B_i).
Under the zero-order hold it is exact from sample to sample (for an L between samples to first order in B T/J),

    y_k = phi_i y_{k-1} + c_i (z_k - z_{k-1}),   phi_i = exp(-B_i T/J),   c_i = Jn (1 - phi_i)/(B_i T)  (Jn/J for B = 0)

with z = Q u(t - L), and so is d_hat = y - w, w = Q u. No velocity is needed, and a constant force that is no state
leaves nothing: it changes d_hat, not its derivative.
"""

from __future__ import annotations

import numpy as np

from dsd_cli.detect.engine import Forces, Measurement
from dsd_cli.detect.grid import Grid
from dsd_cli.errors import UsageError
from dsd_cli.plant.filtering import SETTLED, delay_taps, delayed_mean, lowpass
from dsd_cli.signals.log import Array

#: The axis of a grid of damping states.
AXIS = "viscous_friction.coefficient"


class DampingStates:
    """From u and d_hat, in chunks of any size, to the measured derivative and that of every state.

    Parameters
    ----------
    grid : one delay, one inertia, and the dampings as the axis `AXIS`.
    measurement : the clock (regular), Jn, tau and sign behind d_hat.

    Raises
    ------
    UsageError : a grid with other axes, or an irregular clock.
    """

    def __init__(self, grid: Grid, measurement: Measurement) -> None:
        check(grid)
        if measurement.timed:
            raise UsageError('output = "derivative" needs a regular clock', 'use output = "d_hat"')
        self._m = measurement
        self._inertia, self._delay = grid.inertias[0], grid.delays[0]
        ratio = np.array(grid.effects[AXIS]) * measurement.sample_time / self._inertia  # B T/J
        self._phi = np.exp(-ratio)
        share = np.divide(-np.expm1(-ratio), ratio, out=np.ones_like(ratio), where=ratio > 0.0)
        self._gain = measurement.nominal_inertia / self._inertia * share
        self._pole = float(np.exp(-measurement.sample_time / measurement.time_constant)) if (
            measurement.time_constant > 0.0
        ) else 0.0  # fmt: skip
        self._memory = delay_taps(self._delay, measurement.sample_time)[0] + 2 + measurement.aperture
        self.restart()

    def restart(self) -> None:
        """Forget what came before."""
        self._u = np.empty(0)
        self._seen = 0
        self._w = self._z = self._d = 0.0

    def run(self, u: Array, d_hat: Array) -> tuple[Array, Forces]:
        """(d(d_hat)/dt, the states' as forces of the engine): shapes (n,) and (n, states), unit of u per s.

        NaN where Q has not yet forgotten how it began (`SETTLED`).
        """
        n = len(u)
        if n == 0:
            return np.empty(0), Forces(np.empty((0, len(self._phi))), np.zeros((0, len(self._phi))), np.zeros(0))
        first = self._u.size == 0
        known = np.concatenate([self._u, u])
        w, z = (self._mean(known, delay)[-n:] for delay in (0.0, self._delay))
        begin = (w[0], z[0], d_hat[0]) if first else (self._w, self._z, self._d)
        w, z = (lowpass(x, self._pole, start) for x, start in zip((w, z), begin[:2], strict=True))
        d = self._m.sign * d_hat
        before = begin[2] if not first else d[0]
        w_before, z_before, d_before = (
            np.concatenate([[x], column[:-1]]) for x, column in zip((*begin[:2], before), (w, z, d), strict=True)
        )
        y = (w_before + d_before)[:, None] * self._phi + (z - z_before)[:, None] * self._gain
        rates = (y - (w + d_before)[:, None]) / self._m.sample_time
        measured = (d - d_before) / self._m.sample_time
        settled = self._seen + np.arange(n) >= np.ceil(SETTLED * self._m.time_constant / self._m.sample_time) + 2
        self._u, self._seen = known[-self._memory :], self._seen + n
        self._w, self._z, self._d = float(w[-1]), float(z[-1]), float(d[-1])
        # the engine subtracts (Jn/J) times the forces from what it is given with the log's sign
        applied = rates * (self._inertia / self._m.nominal_inertia)
        forces = Forces(applied, np.zeros_like(applied), np.zeros(n))
        return np.where(settled, self._m.sign * measured, np.nan), forces

    def _mean(self, u: Array, delay: float) -> Array:
        """Mean of u(t - delay) over the intervals that one value of d_hat averages."""
        mean = delayed_mean(u, delay, self._m.sample_time)
        if self._m.aperture == 2:
            mean = 0.5 * (mean + np.concatenate([mean[:1], mean[:-1]]))
        return mean


def check(grid: Grid) -> None:
    """Whether these states differ by their damping alone.

    Raises
    ------
    UsageError : they do not.
    """
    if set(grid.effects) != {AXIS} or len(grid.delays) != 1 or len(grid.inertias) != 1:
        raise UsageError(
            'detector.output = "derivative" distinguishes dampings, nothing else (eq. 6)',
            "give one delay, one inertia, and [states.effects.viscous_friction] coefficient = [...]",
        )
