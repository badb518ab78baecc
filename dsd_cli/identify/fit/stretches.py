"""A piece of a recording, prepared for rows: what acts in it per interval, and where the axis rests."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsd_cli.effects import Channels, Effect, Role, Shape
from dsd_cli.effects.driven import driven_load, forgotten
from dsd_cli.effects.memory import Coupling
from dsd_cli.identify.fit.pushes import SensorMotion
from dsd_cli.identify.policy import POLICY
from dsd_cli.identify.recordings.recording import SHARP, Recording
from dsd_cli.identify.recordings.sensor import FeedbackNoise, feedback_noise_of
from dsd_cli.identify.recordings.smoothing import MEAN_OF_SIX, extended
from dsd_cli.plant.filtering import delay_taps
from dsd_cli.plant.forces import IntervalChannels
from dsd_cli.plant.prediction import Frame
from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.passes import passed
from dsd_cli.signals.runs import runs


def resting(velocity: Array, rest_speed: ArrayLike) -> NDArray[np.bool_]:
    """Intervals (the one that ends at each sample) at rest, shape (n,).

    rest_speed : up to which the axis may rest, one for all samples or shape (n,).

    A run of slow samples is a rest if it `_stays`; noise may exceed the band for a moment, so that runs in wider bands
    count, too. An axis that creeps, by a fine sensor, far below its usual speed, sticks.
    """
    usual_speed = float(np.sqrt(np.mean(velocity**2)))
    most = POLICY.resting_most * usual_speed
    limit = np.broadcast_to(np.minimum(rest_speed, most), velocity.shape)
    usual = float(np.mean(np.abs(np.diff(velocity)))) if len(velocity) > 1 else 0.0
    found = slow_spells(velocity, POLICY.creep_share)
    for width in POLICY.resting_bands:
        for start, end in _runs(np.abs(velocity) <= width * limit):
            found[start:end] |= _stays(velocity[start:end], limit[start:end], usual)
    return found


def slow_spells(velocity: Array, share: float, least: int = 0) -> NDArray[np.bool_]:
    """Intervals of runs of at least so many that are no faster than a share of the rms speed, shape (n,)."""
    found = np.zeros(len(velocity), dtype=bool)
    for start, end in _runs(np.abs(velocity) <= share * float(np.sqrt(np.mean(velocity**2)))):
        found[start:end] = end - start >= least
    return found


def _runs(slow: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first, behind the last) interval of every run whose samples are slow, long enough to be a rest."""
    both = slow & np.concatenate([slow[:1], slow[:-1]])
    return [(start, end) for start, end in runs(both) if end - start >= POLICY.least_rest_samples]


def _stays(speed: Array, limits: Array, usual: float) -> bool:
    """Whether a run of speeds, their mean, and their change along a fitted line, are small; `usual` change a sample."""
    limit = float(limits[0] if limits.min() == limits.max() else np.median(limits))  # as a rule one for all samples
    if abs(speed.mean()) > POLICY.resting_share * limit or np.sqrt(np.mean(speed**2)) > POLICY.resting_size * limit:
        return False
    place = np.arange(len(speed)) - 0.5 * (len(speed) - 1)
    slope = abs(float(place @ speed) / float(place @ place))
    return slope * len(speed) <= POLICY.resting_share * limit or slope <= POLICY.resting_slope * usual


#: Standard deviations of the speed's noise beyond which the direction is certain.
_CERTAIN = 4.0
#: Mean of sgn v from which on the direction is sure.
_SURE = 0.999
#: Value in the middle of the interval between the inner two of six samples (exact for quintics).
_MIDDLE_OF_SIX = np.array([3.0, -25.0, 150.0, 150.0, -25.0, 3.0]) / 256.0
#: Quintic through the values at -2 to 3: the powers (columns) in the weight of each.
_QUINTIC = np.linalg.inv(np.vander(np.arange(-2.0, 4.0), increasing=True)).T
#: Mean over two intervals, that before a sample and the next.
_HALVES = np.array([0.5, 0.5])
#: Mean over an interval out of the values in its middle and of two more on either side (exact for quintics).
MEAN_OF_MIDDLES = np.array([-17.0, 308.0, 5178.0, 308.0, -17.0]) / 5760.0


class DelayTap(NamedTuple):
    """A command that is so many `samples` late, as the acceleration averages it: all of it; or, for a mean over two
    intervals, what the interval before a sample adds to it (`next` False), or the next one (True)."""

    samples: float
    next: bool | None = None


@dataclass(frozen=True)
class Stretch:
    """Arrays of shape (n,), per interval that ends at each sample.

    owner : number of its recording among those of the equations.
    middle, mean : speed and position in the middle of each interval, and their means over the interval.
    sensed : what drives a load; `noisy` : with the synthetic noise of the sensor.
    free : 1 where the axis slides, so that friction's direction is known, 0 where friction holds.
    clear : weight of each sample in every row: less than 1 where a load with play may touch (`fit.contacts`).
    sign : mean of sgn v, 0 where it is not known.
    measured : acceleration.
    two_intervals : the acceleration is a mean over both intervals beside a sample.
    stepping : the command jumps at samples alone; not where it was measured, or put on a regular clock.
    pushed, levels : see `Recording`.
    """

    log: Log
    frame: Frame
    middle: IntervalChannels
    mean: IntervalChannels
    sensed: SensorMotion
    free: Array
    clear: Array
    sign: Array
    measured: Array
    two_intervals: bool
    stepping: bool
    pushed: tuple[str, float, Coupling] | None
    levels: tuple[tuple[str, int, float], ...]
    owner: int
    noisy: bool = False

    @cached_property
    def begin(self) -> int:
        """Samples in which nobody knows where a load is that a force drives."""
        if self.pushed is None:
            return 0
        return forgotten(self.log["push"], self.log.sample_time, *self.pushed[2:0:-1], self.speed)

    @cached_property
    def speed(self) -> Array:
        """As measured, not smoothed: that would put off the instant at which a load comes to rest."""
        placed = self.two_intervals and "position" in self.log
        return finite(np.gradient(self.log["position"], self.log.sample_time) if placed else self.log["velocity"])

    @cached_property
    def answer(self) -> FeedbackNoise:
        """How u answers the noise of the sensor."""
        return feedback_noise_of(self.log["u"], self.measured, self.log.sample_time)

    @cached_property
    def remembered(self) -> tuple[Array, Array]:
        """What an effect with memory goes by: change of the speed over each interval, by its length, and direction."""
        speed = self.log["velocity"]
        change = np.diff(speed, prepend=speed[0]) / self.log.sample_time
        return change, direction(speed, self.log["speed_noise"])

    @property
    def surely_sliding(self) -> NDArray[np.bool_]:
        """Intervals in which friction's direction is sure."""
        return (self.free > 0.0) & (np.abs(self.sign) >= _SURE)

    @property
    def acceleration(self) -> Array:
        """As measured, where it counts."""
        return self._counting(self.measured)

    def channels(self, drive: Array, effect: Effect) -> Channels:
        """What an effect looks at under that delayed u: means over the interval, or the values in the middle of it."""
        if effect.role is Role.STRUCTURE:
            velocity, position = self.sensed.noisy if self.noisy else self.sensed.motion
            return self.frame.channels(drive, self.mean._replace(velocity=velocity, position=position))
        if effect.memory:
            change, side = self.remembered
            return self.frame.channels(drive, self.mean)._replace(acceleration=change, direction=side)
        return self.frame.channels(drive, self.middle)._replace(interval=np.broadcast_to(0.0, len(drive)))

    def columns(self, effect: Effect, shape: Shape, u: Array) -> list[Array]:
        """Regressor of each coefficient of an effect, mean per interval under that delayed u; minus the unit force."""
        pushed, log = self.pushed, self.log
        if pushed is not None and pushed[0] == effect.id and effect.coupling is not None:  # see `fit.driven_load`
            spring = effect.coupling(shape)
            return [driven_load(log["push"], log.sample_time, spring, pushed[1], velocity=self.speed)]
        found, _ = effect.run(self.channels(u, effect), shape)
        columns = [np.broadcast_to(c, len(u)) for c in found]
        if effect.role is Role.FRICTION:
            return [self.sign * c for c in columns]
        if effect.role is Role.STRUCTURE:
            return columns
        return [-c if effect.memory else passed(c, -MEAN_OF_MIDDLES, 2) for c in columns]

    def acting(self, x: Array, smooth: bool, held: bool) -> Array:
        """A force per interval as the acceleration averages it.

        smooth : x is; else it is constant within each interval and jumps between them, as a held u does.
        held : there is friction, so that at rest all forces balance and count as 0.
        """
        return self.averaged(x * self.free if held else x, smooth)

    def commanded(self, command: Array, delay: float, held: bool) -> Array:
        """A command, `delay` s late, as the acceleration averages it; held: see `acting`."""
        return np.asarray(sum(weight * self.part(command, one, held) for one, weight in self.parts(delay).items()))

    def parts(self, delay: float) -> dict[DelayTap, float]:
        """The parts of a command that is `delay` s late, and their weights.

        Between whole samples the mean of a held u over one interval is linear in the delay; under the hat each interval
        has the older value for its first part, then the newer one. A u that is not held follows a quintic through six
        samples.
        """
        whole, share = delay_taps(delay, self.frame.log.sample_time)
        if share == 0.0:
            return {DelayTap(whole): 1.0}
        if not self.stepping:
            return {DelayTap(whole + k): float(w) for k, w in enumerate(_QUINTIC @ share ** np.arange(6.0), -2)}
        if not self.two_intervals:
            linear = {DelayTap(whole): 1.0 - share, DelayTap(whole + 1): share}
            return linear if self.frame.regular else {DelayTap(whole + share): 1.0}
        ending = {DelayTap(whole + 1, False): share**2, DelayTap(whole, False): 1.0 - share**2}
        return ending | {DelayTap(whole + 1, True): share * (2.0 - share), DelayTap(whole, True): (1.0 - share) ** 2}

    def part(self, command: Array, part: DelayTap, held: bool) -> Array:
        """One part of a delayed command."""
        mean = self.frame.mean_u(command, max(part.samples, 0) * self.frame.log.sample_time)
        if (ahead := -round(part.samples)) > 0:
            mean = np.append(mean[ahead:], np.full(ahead, mean[-1]))
        if part.next is None:
            return self.acting(mean, not self.stepping, held)
        mean = mean * self.free if held else mean
        return self._counting(0.5 * (np.append(mean[1:], mean[-1]) if part.next else mean))

    def averaged(self, x: Array, smooth: bool) -> Array:
        """x per interval -> as the acceleration averages it."""
        if not self.two_intervals:
            return self._counting(x)
        return self._counting(passed(x, MEAN_OF_SIX, 2) if smooth else passed(x, _HALVES, 0))

    def _counting(self, x: Array) -> Array:
        return x * self.clear if "clear" in self.log else x


def stretch_of(log: Log, recording: Recording, owner: int) -> Stretch:
    """A piece of that recording, which is number `owner`."""
    sensor, frame = recording.sensor, Frame(log)
    speed = log["velocity"]
    way, known = direction(speed, log["speed_noise"]), ~resting(speed, log["rest_speed"])
    clear = np.abs(way) == 1.0
    if len({*way[known & clear].tolist()}) == 1:  # what never turns round rests wherever the sensor shows no motion
        known &= clear
    return Stretch(
        log=log,
        frame=frame,
        middle=_motion(log, _MIDDLE_OF_SIX),
        mean=_motion(log, MEAN_OF_SIX),
        sensed=SensorMotion(log, sensor),
        free=known.astype(np.float64),
        clear=log["clear"] if "clear" in log else np.ones(len(log)),
        sign=np.where(known, way, 0.0),
        measured=log["acceleration"],
        two_intervals=sensor.two_intervals,
        stepping=log.u_hold == "held" and "white" not in log,
        pushed=recording.pushed,
        levels=recording.levels,
        owner=owner,
    )


def _motion(log: Log, weights: Array) -> IntervalChannels:
    """Motion of each interval out of six samples; before its ends a log goes on as behind them, turned round."""
    unknown = np.broadcast_to(np.nan, len(log))

    def of(name: str) -> Array:
        if name not in log:
            return unknown
        x = log[SHARP] if name == "velocity" and SHARP in log else log[name]
        return np.convolve(extended(x, 3), weights, mode="valid")[:-1]

    return IntervalChannels(of("velocity"), of("position"), unknown, unknown)


def direction(speed: Array, noise: Array) -> Array:
    """Mean of sgn v over each interval, shape (n,), as far as a noisy speed shows it: between -1 and 1.

    noise : standard deviation of the speed's, shape (n,).
    """
    before = np.concatenate([speed[:1], speed[:-1]])
    size = np.abs(speed) + np.abs(before)
    found = (speed + before) / np.where(size > 0.0, size, 1.0)
    x = 0.5 * (speed + before) / np.maximum(noise, 1e-300)
    doubtful = np.flatnonzero(~(np.abs(x) >= _CERTAIN))  # few, as a rule
    x = x[doubtful]
    # erf(x / sqrt 2), the mean of sgn of v given v + noise
    found[doubtful] = np.tanh(np.sqrt(2.0 / np.pi) * (x + 0.044715 * x**3))
    return np.asarray(found)


def finite(x: Array) -> Array:
    """0 for NaN; x itself where there is none, which is quicker to see than to mend."""
    return x if bool(np.isfinite(x).all()) else np.nan_to_num(x)
