"""THE prediction of d_hat by a plant model; every command that predicts calls it or is built of its pieces.

    d_model_k = (Jn/J) z_k - w_k,   z = Q { delayed u + forces },  w = Q { u }

with every quantity the mean over an interval (docs/architecture.md).
"""

from __future__ import annotations

import numpy as np

from dsd_cli.effects import Channels
from dsd_cli.errors import DataError
from dsd_cli.plant.filtering import (
    delay_taps,
    delayed_mean,
    delayed_mean_irregular,
    irregular_stamps,
    lowpass,
    lowpass_irregular,
    poles_of,
    two_interval_mean,
)
from dsd_cli.plant.forces import IntervalChannels, Sample, combine, interval_channels, interval_forces
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.signals.log import Array, Log

__all__ = [
    "IntervalChannels",
    "Sample",
    "combine",
    "delay_taps",
    "delayed_mean",
    "interval_channels",
    "interval_forces",
    "lowpass",
    "predict_d_hat",
]


def predict_d_hat(model: PlantModel, log: Log, observer: ObserverSettings, observer_filter: bool = True) -> Array:
    """d_hat as the model predicts it from u and the motion in the log, with the sign of the log's d_hat.

    Parameters
    ----------
    observer_filter : the prediction passes Q like the measurement; False is eq. 14 to the letter.

    Returns
    -------
    Shape (n,), unit of u. The first max(L, 5 tau) s rest on u before the log, which is taken as held at u_0.

    Raises
    ------
    DataError : the log lacks u, or a channel that an effect needs.
    """
    if "u" not in log:
        raise DataError(f"{log.source}: no u", "the prediction needs the control input; set signals.u")
    stamps = irregular_stamps(log)
    intervals = np.full(len(log), log.sample_time)
    if stamps is not None:
        intervals[1:] = np.diff(stamps)
    lag = 1 if observer_filter else 0
    drive = _mean_u(log, stamps, model.delay, lag)
    z = _net_force(model, log, drive, intervals)
    w = _mean_u(log, stamps, 0.0, lag)
    if log.d_hat_source == "position":
        z, w = two_interval_mean(z, intervals), two_interval_mean(w, intervals)
    if observer_filter:
        z, w = (_observed(x, intervals, observer, stamps is None) for x in (z, w))
    return np.asarray(observer.sign * (observer.nominal_inertia / model.inertia * z - w))


def _mean_u(log: Log, stamps: Array | None, delay: float, lag: int) -> Array:
    """Mean of u(t - L) over the interval that ends (lag 1) or, for eq. 14, that begins (lag 0) at each sample."""
    u, ahead = log["u"], 1 - lag
    held = np.append(u, u[-1:] if ahead else [])
    if stamps is None:
        return delayed_mean(held, delay, log.sample_time)[ahead:]
    times = np.append(stamps, stamps[-1:] + log.sample_time if ahead else [])
    return delayed_mean_irregular(held, times, delay)[ahead:]


def _net_force(model: PlantModel, log: Log, drive: Array, intervals: Array) -> Array:
    if not model.effects:
        return drive
    velocity, position = (log.channels.get(name) for name in ("velocity", "position"))
    _check_needs(model, log)
    if velocity is None and position is None:
        unknown = np.full(len(log), np.nan)
        motion = IntervalChannels(unknown, unknown, unknown, unknown)
    else:
        motion = interval_channels(velocity, position, intervals, model.rest_speed)
    t = log["t"] if "t" in log else log.sample_time * np.arange(len(log))
    channels = Channels(t - 0.5 * intervals, drive, motion.velocity, motion.position)
    force, budget = interval_forces(model.effects, channels)
    return combine(drive, force, budget, motion.sign, model.inertia * motion.acceleration)


def _check_needs(model: PlantModel, log: Log) -> None:
    for channel, effect in model.needs().items():
        differentiable = channel == "velocity" and "position" in log
        if channel in ("velocity", "position") and channel not in log and not differentiable:
            remedy = f"set signals.{channel}" + (" or signals.position" if channel == "velocity" else "")
            raise DataError(f"{log.source}: effect {effect} needs {channel}", remedy + ", or leave the effect out")


def _observed(x: Array, intervals: Array, observer: ObserverSettings, regular: bool) -> Array:
    """Through Q, which has settled on the first value when the log begins."""
    if len(x) == 0:
        return x
    if regular:
        return lowpass(x, observer.pole(float(intervals[0])), float(x[0]))
    return lowpass_irregular(x, poles_of(intervals.tolist(), observer.time_constant), float(x[0]))
