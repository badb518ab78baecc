"""The discrete disturbance observer, from velocity or from position alone, sample by sample or over arrays.

From velocity (aperture 1)     d_k = p d_{k-1} + (1-p) [ Jn (v_k - v_{k-1})/T - u_{k-1} ]
From position (aperture 2)     d_k = p d_{k-1} + (1-p) [ Jn a2 - u2 ]
                               a2 = (vbar_k - vbar_{k-1}) / ((T_k + T_{k-1})/2),  vbar_k = (q_k - q_{k-1})/T_k
                               u2 = (T_k u_{k-1} + T_{k-1} u_{k-2}) / (T_k + T_{k-1})

d_hat is 0 at the samples that have no complete interval behind them: the first, and from position the first two.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np

from dsd_cli.errors import DataError
from dsd_cli.plant.filtering import irregular_stamps, lowpass, lowpass_irregular, poles_of
from dsd_cli.plant.model import ObserverSettings
from dsd_cli.signals.log import Array, Log

Source = Literal["velocity", "position"]

#: Intervals that one value of d_hat averages.
APERTURE = {"velocity": 1, "position": 2}


class ObserverState(NamedTuple):
    """What the observer carries from sample to sample.

    d_hat in the unit of u, eq. 13's sign; `history` holds the last (t, u, measured) samples, newest last, at most
    two; with a regular clock t stays 0.
    """

    d_hat: float
    history: tuple[tuple[float, float, float], ...] = ()


class DisturbanceObserver:
    """`step` and `run` give the same bits, in chunks of any size and mixed.

    Parameters
    ----------
    settings : Jn, tau and sign; d_hat here has eq. 13's sign unless `settings.sign` is -1.
    sample_time : s, of a regular clock.
    source : what is measured.
    initial : d_hat before the first interval, unit of u, eq. 13's sign.
    """

    def __init__(
        self, settings: ObserverSettings, sample_time: float, source: Source = "velocity", initial: float = 0.0
    ) -> None:
        self.settings = settings
        self.sample_time = sample_time
        self.source = source
        self.state = ObserverState(d_hat=initial)
        self._pole = settings.pole(sample_time)

    def step(self, u: float, measured: float, t: float | None = None) -> float:
        """d_hat of one sample; `measured` is velocity or position, t (s) only for irregular stamps."""
        d_hat = self.observe(measured, t)
        self.apply(u)
        return d_hat

    def observe(self, measured: float, t: float | None = None) -> float:
        """d_hat of this sample, before its u is known (a controller needs d_hat to compute u); then call `apply`."""
        d_hat, history = self.state
        now = (0.0 if t is None else t, math.nan, measured)
        aperture = APERTURE[self.source]
        if len(history) == aperture:
            before = history[-1]
            interval = self.sample_time if t is None else t - before[0]
            pole = self._pole if t is None else self.settings.pole(interval)
            if aperture == 1:
                raw = self._from_velocity(measured, before[2], before[1], interval)
            else:
                earlier = history[-2]
                previous = self.sample_time if t is None else before[0] - earlier[0]
                mean, mean_before = (measured - before[2]) / interval, (before[2] - earlier[2]) / previous
                raw = self._from_position(mean, mean_before, (before[1], earlier[1]), (interval, previous))
            d_hat = (1.0 - pole) * raw + pole * d_hat
        self.state = ObserverState(d_hat, (*history, now)[-aperture:])
        return self.settings.sign * d_hat

    def apply(self, u: float) -> None:
        """The u that acts from the sample on that `observe` has just seen."""
        *older, (t, _, measured) = self.state.history
        self.state = ObserverState(self.state.d_hat, (*older, (t, u, measured)))

    def run(self, u: Array, measured: Array, t: Array | None = None) -> Array:
        """d_hat of a chunk, shape (n,), carrying on where the last call stopped."""
        aperture = APERTURE[self.source]
        lead = min(max(aperture - len(self.state.history), 0), len(u))
        stamps = np.zeros(len(u)) if t is None else t
        first = [
            self.step(float(u[k]), float(measured[k]), None if t is None else float(stamps[k])) for k in range(lead)
        ]
        if lead == len(u):
            return np.array(first, dtype=np.float64)
        kept = np.array(self.state.history, dtype=np.float64)
        chunk = np.column_stack([stamps[lead:], u[lead:], measured[lead:]])
        rows = np.concatenate([kept, chunk])
        filtered = self._run_rows(rows, regular=t is None)
        newest = tuple((float(a), float(b), float(c)) for a, b, c in rows[-aperture:])
        self.state = ObserverState(float(filtered[-1]), newest)
        return np.concatenate([first, self.settings.sign * filtered])

    def _run_rows(self, rows: Array, regular: bool) -> Array:
        """d_hat (eq. 13's sign) of rows (t, u, measured), of which the first `aperture` are history."""
        stamps, u, measured = rows.T
        intervals = np.full(len(u) - 1, self.sample_time) if regular else np.diff(stamps)
        if self.source == "velocity":
            raw = self._from_velocity(measured[1:], measured[:-1], u[:-1], intervals)
        else:
            mean = np.diff(measured) / intervals
            raw = self._from_position(mean[1:], mean[:-1], (u[1:-1], u[:-2]), (intervals[1:], intervals[:-1]))
            intervals = intervals[1:]
        if regular:
            return lowpass(raw, self._pole, self.state.d_hat)
        return lowpass_irregular(raw, poles_of(intervals.tolist(), self.settings.time_constant), self.state.d_hat)

    # The two below take floats (step) and arrays (run) alike: the same operations in the same order, so the same bits.

    def _from_velocity(self, velocity: Any, before: Any, u: Any, interval: Any) -> Any:
        return self.settings.nominal_inertia * ((velocity - before) / interval) - u

    def _from_position(self, mean: Any, mean_before: Any, u: tuple[Any, Any], intervals: tuple[Any, Any]) -> Any:
        now, before = intervals
        acceleration = (mean - mean_before) / (0.5 * (now + before))
        return self.settings.nominal_inertia * acceleration - (now * u[0] + before * u[1]) / (now + before)


def observe_log(log: Log, settings: ObserverSettings) -> Log:
    """The log with d_hat computed from velocity if there is one, else from position; `d_hat_source` says which.

    Raises
    ------
    DataError : the log lacks u, or has neither velocity nor position.
    """
    if "u" not in log:
        raise DataError(f"{log.source}: no u", "the observer needs the control input; set signals.u")
    source: Source = "velocity" if "velocity" in log else "position"
    if source not in log:
        raise DataError(
            f"{log.source}: neither velocity nor position", "the observer needs one; set signals.velocity or .position"
        )
    observer = DisturbanceObserver(settings, log.sample_time, source)
    d_hat = observer.run(log["u"], log[source], irregular_stamps(log))
    return replace(log, channels={**log.channels, "d_hat": d_hat}, d_hat_source=source)
