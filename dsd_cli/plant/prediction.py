"""THE prediction of d_hat by a plant model; every command that predicts calls it or is built of its pieces.

    d_model_k = (Jn/Jm) z_k - w_k,   z = Q { delayed u_eff + forces },  w = Q { u }

with every quantity the mean over an interval (docs/how/architecture.md), and Jm the inertia of the motor: all of J, but
for loads that hang on it.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from dsd_cli.effects import Channels, Role, Shape, get_effect
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
from dsd_cli.plant.model import EffectValues, ObserverSettings, PlantModel
from dsd_cli.signals.log import Array, Log

__all__ = [
    "Frame",
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
    frame = Frame(log, lag=1 if observer_filter else 0)
    z = frame.net_force(model)
    w = frame.mean_u(log["u"], 0.0)
    z, w = (frame.seen(x, observer if observer_filter else None) for x in (z, w))
    return np.asarray(observer.sign * (observer.nominal_inertia / model.motor_inertia * z - w))


class Frame:
    """A log cut into intervals: what acts in each, and how the observer sees it.

    Parameters
    ----------
    lag : 1 for the interval that ends at each sample; 0, for eq. 14, takes u of the interval that begins there.

    Attributes
    ----------
    intervals : T_k of the interval that ends at each sample, s, shape (n,).

    Raises
    ------
    DataError : the log lacks u.
    """

    def __init__(self, log: Log, lag: int = 1) -> None:
        if "u" not in log:
            raise DataError(f"{log.source}: no u", "the prediction needs the control input; set signals.u")
        self.log, self._lag = log, lag
        self._stamps = irregular_stamps(log)
        self._poles: dict[float, Array] = {}
        self.intervals: Array = np.broadcast_to(log.sample_time, len(log))
        if self._stamps is not None:
            self.intervals = np.concatenate([self.intervals[:1], np.diff(self._stamps)])

    def mean_u(self, command: Array, delay: float) -> Array:
        """Mean of command(t - L) over each interval; `command` shape (n,) is held from sample to sample."""
        ahead = 1 - self._lag
        held = np.append(command, command[-1:]) if ahead else command
        if self._stamps is None:
            return np.asarray(delayed_mean(held, delay, self.log.sample_time)[ahead:])
        times = np.append(self._stamps, self._stamps[-1:] + self.log.sample_time if ahead else [])
        return delayed_mean_irregular(held, times, delay)[ahead:]

    def command(self, effects: EffectValues) -> Array:
        """u after the input effects, mean over the interval that begins at each sample, before the delay."""
        command: Array = self.log["u"]
        for name, values in effects.items():
            effect = get_effect(name)
            if effect.role is Role.INPUT:
                command = self.changed_command(name, effect.to_columns(values)[1], command)
        return command

    @cached_property
    def _ahead(self) -> Array:
        """s of the interval that begins at each sample."""
        if self._stamps is None:
            return self.intervals
        return np.append(self.intervals[1:], self.log.sample_time)

    @cached_property
    def _middles(self) -> Array:
        return np.asarray(self.times + 0.5 * self._ahead)

    @cached_property
    def _centres(self) -> Array:
        """Of the interval that ends at each sample."""
        return np.asarray(self.times - 0.5 * self.intervals)

    def changed_command(self, effect_id: str, shape: Shape, command: Array) -> Array:
        """`command` after the input effect of that shape."""
        missing = np.broadcast_to(np.nan, len(command))
        channels = Channels(self._middles, command, missing, missing, self._ahead)
        (changed,), _ = get_effect(effect_id).run(channels, shape)
        return np.asarray(changed)

    @property
    def times(self) -> Array:
        """Stamps of the log, s."""
        if "t" in self.log:
            return self.log["t"]
        return np.asarray(self.log.sample_time * np.arange(len(self.log)), dtype=np.float64)

    def motion(self, rest_speed: float) -> IntervalChannels:
        """Mean motion per interval; all NaN where neither velocity nor position is logged.

        A channel "turning" holds the measured acceleration of intervals in which speed and measurement leave open
        what friction does, NaN elsewhere; it takes the place of the difference of speeds.
        """
        velocity, position = (self.log.channels.get(name) for name in ("velocity", "position"))
        if velocity is None and position is None:
            unknown = np.full(len(self.log), np.nan)
            return IntervalChannels(unknown, unknown, unknown, unknown)
        found = interval_channels(velocity, position, self.intervals, rest_speed)
        return found._replace(acceleration=self.log["turning"]) if "turning" in self.log else found

    def channels(self, drive: Array, motion: IntervalChannels) -> Channels:
        """What effects look at, in the interval that ends at each sample, under that delayed u."""
        return Channels(self._centres, drive, motion.velocity, motion.position, self.intervals)

    def net_force(self, model: PlantModel) -> Array:
        """Delayed u and all forces on the motor, mean over each interval, unit of u, shape (n,).

        Raises
        ------
        DataError : the log lacks a channel that an effect needs.
        """
        drive = self.mean_u(self.command(model.effects), model.delay)
        if not model.effects:
            return drive
        _check_needs(model, self.log)
        motion = self.motion(model.rest_speed)
        force, budget = interval_forces(model.effects, self.channels(drive, motion), model.inertia)
        return combine(drive, force, budget, motion.sign, model.motor_inertia * motion.acceleration)

    def seen(self, x: Array, observer: ObserverSettings | None) -> Array:
        """A force per interval as d_hat shows it: averaged like the log's d_hat, and through Q (None: no Q).

        Q has settled on the first value when the log begins.
        """
        if self.log.d_hat_source == "position":
            x = two_interval_mean(x, self.intervals)
        if observer is None or len(x) == 0:
            return x
        return self.filtered(x, observer, float(x[0]))

    @property
    def regular(self) -> bool:
        """The clock of the log is regular."""
        return self._stamps is None

    def filtered(self, x: Array, observer: ObserverSettings, initial: float) -> Array:
        """x through Q, which stood at `initial` before the log."""
        if self._stamps is None:
            return lowpass(x, observer.pole(float(self.intervals[0])), initial)
        tau = observer.time_constant
        if tau not in self._poles:
            self._poles[tau] = poles_of(self.intervals.tolist(), tau)
        return lowpass_irregular(x, self._poles[tau], initial)


def _check_needs(model: PlantModel, log: Log) -> None:
    for channel, effect in model.needs().items():
        differentiable = channel == "velocity" and "position" in log
        if channel in ("velocity", "position") and channel not in log and not differentiable:
            remedy = f"set signals.{channel}" + (" or signals.position" if channel == "velocity" else "")
            raise DataError(f"{log.source}: effect {effect} needs {channel}", remedy + ", or leave the effect out")
