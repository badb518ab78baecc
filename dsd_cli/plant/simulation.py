"""The loop of plant, delay, observer and controller: what would the log look like?

At t_k: measure, observe d_hat_k, compute u_k; then the plant runs to t_k+1 under u(t - L), u held between samples and 0
before the log, if nothing else is said. Each interval is cut where the delayed u switches, so any real L is exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from dsd_cli.errors import DataError, UsageError
from dsd_cli.plant.adaptive import AdaptiveController, Feedback
from dsd_cli.plant.controllers import Controller, ControllerSettings, Measured
from dsd_cli.plant.filtering import delay_taps
from dsd_cli.plant.model import EffectValues, ObserverSettings, PlantModel
from dsd_cli.plant.motion import Actuator, Plant
from dsd_cli.plant.observer import DisturbanceObserver, Source
from dsd_cli.plant.references import Reference, Step
from dsd_cli.signals.log import CHANNELS, Array, Log

#: What the controller believes, in the log of an adaptive loop: s, and the unit of inertia.
ADOPTED = ("adopted_delay", "adopted_inertia")

_THERE = 1e-6  # samples
#: Samples between two reports of progress.
STRIDE = 1000


@dataclass(frozen=True)
class Event:
    """From `time` (s; the first sample at or after it) on the plant has these values.

    When the delay changes, u(t - L) simply uses the new L: commands are skipped or repeated. `noise` is the standard
    deviation of the noise on d_hat from then on, in place of `Measurement.d_hat_noise`.
    """

    time: float
    delay: float | None = None
    inertia: float | None = None
    effects: EffectValues = field(default_factory=dict)
    noise: float | None = None


@dataclass(frozen=True)
class Measurement:
    """What the measurement adds.

    Attributes
    ----------
    d_hat_noise, position_noise, velocity_noise : standard deviations of white noise, in the channel's unit. All are
        inside the loop: the controller gets what is logged.
    encoder_step : position is rounded to multiples of it, velocity is its backward difference, and d_hat comes from
        position; 0 is exact.
    seed : of the noise.
    """

    d_hat_noise: float = 0.0
    position_noise: float = 0.0
    velocity_noise: float = 0.0
    encoder_step: float = 0.0
    seed: int = 0


@dataclass(frozen=True)
class SimulationSettings:
    """Everything that `simulate` needs; duration and sample_time in s, start the position at rest (rad or m).

    feedforward : added to the controller's u, shape (n,), one per sample; the last is held. None: nothing. before : u
    before the log.
    """

    model: PlantModel
    duration: float
    sample_time: float = 1e-3
    observer: ObserverSettings = field(default_factory=ObserverSettings)
    controller: ControllerSettings = field(default_factory=ControllerSettings)
    reference: Reference = field(default_factory=Step)
    events: tuple[Event, ...] = ()
    measurement: Measurement = field(default_factory=Measurement)
    observe_from: Source = "velocity"
    start: float = 0.0
    feedforward: Array | None = None
    before: float = 0.0

    def __post_init__(self) -> None:
        if not self.sample_time > 0.0:
            raise UsageError(f"simulate.sample_time = {self.sample_time:g}", "must be above 0")
        if not self.duration >= self.sample_time:
            raise UsageError(f"simulate.duration = {self.duration:g}", "must be at least one sample time")


@np.errstate(over="ignore", invalid="ignore")  # what diverges is said, in one line
def simulate(
    settings: SimulationSettings,
    feedback: Feedback | None = None,
    progress: Callable[[int], None] = lambda _samples: None,
) -> Log:
    """The log of the loop: t, u, d_hat, position, velocity, reference, true_delay, true_inertia.

    With `feedback` the controller takes up what that says of the plant (`AdaptiveController`), and the log has
    adopted_delay and adopted_inertia, NaN while the nominal law holds.

    `round(duration / sample_time)` samples. The observer has settled when the log begins: d_hat_0 is its value under
    u = 0 and the forces at the start. `progress` is called with the number of samples just done.

    Raises
    ------
    DataError : the loop is unstable and its signals are no longer finite.
    """
    samples = round(settings.duration / settings.sample_time)
    loop = _Loop(settings, feedback)
    rows = np.empty((samples, 8))
    references = settings.reference.sample(samples, settings.sample_time)
    added = _added(settings.feedforward, samples)
    targets = list(zip(references.position.tolist(), references.rate.tolist(), added.tolist(), strict=True))
    models = _models(settings, samples)
    noise = _Noise(settings, samples)
    for k in range(samples):
        if k % STRIDE == 0 and k:
            progress(STRIDE)
        rows[k] = loop.step(k, models.get(k), targets[k], noise.at(k))
        if not math.isfinite(rows[k, 0]):
            raise DataError(
                f"the simulated loop is unstable: u is no longer finite at t = {k * settings.sample_time:g} s",
                "lower the gains or the delay, or set simulate.controller.limit",
            )
    if not loop.heard:  # the same bits, over arrays
        rows[:, 1] += loop.observer.run(rows[:, 0], rows[:, 3 if loop.observer.source == "velocity" else 2])
    channels = dict(zip(("u", "d_hat", "position", "velocity", *CHANNELS[-2:], *ADOPTED), rows.T, strict=True))
    channels |= {"t": _stamps(samples, settings.sample_time), "reference": references.position}
    ordered = CHANNELS if feedback is None else (*CHANNELS, *ADOPTED)
    return Log(
        {name: channels[name] for name in ordered},
        settings.sample_time,
        source="simulation",
        d_hat_source=loop.observer.source,
    )


class _Loop:
    """The state of the loop between samples."""

    def __init__(self, settings: SimulationSettings, feedback: Feedback | None) -> None:
        self.settings = settings
        self.feedback = feedback
        self.model = settings.model
        self.plant = Plant(settings.model, settings.start)
        self.actuator = Actuator(settings.model, settings.before)
        encoder = settings.measurement.encoder_step > 0.0
        source: Source = "position" if encoder else settings.observe_from
        settled = settings.observer.nominal_inertia * self.plant.acceleration(0.0, self.actuator.at_rest)
        self.observer = DisturbanceObserver(settings.observer, settings.sample_time, source, settled)
        self.controller = _controller(settings, feedback)
        #: Whether the loop itself hears what the observer says.
        self.heard = feedback is not None or settings.controller.kind in ("network_observer", "observer")
        self.drive: list[float] = []  # u_eff, the whole past: an event may lengthen the delay
        self._encoder: float | None = None  # last encoder position

    def step(
        self, k: int, model: PlantModel | None, target: tuple[float, float, float], noise: tuple[float, float, float]
    ) -> tuple[float, ...]:
        """One sample, then the plant to the next one; (u, d_hat, position, velocity, truth, what is believed)."""
        if model is not None:
            self.model = model
            self.plant.set(model)
            self.actuator.set(model)
        position, velocity = self._measure(noise)
        d_hat = noise[0]
        if self.heard:
            d_hat += self.observer.observe(velocity if self.observer.source == "velocity" else position)
        sign = self.settings.observer.sign
        u = self.controller.step(Measured(*target[:2], position, velocity, sign * d_hat, target[2]))
        sample_time = self.settings.sample_time
        self.drive.append(self.actuator.drive(k * sample_time, u, sample_time))
        if self.heard:
            self.observer.apply(u)
        self._advance(k)
        believed = self._believed(u, d_hat)
        return u, d_hat, position, velocity, self.model.delay, self.model.inertia, *believed

    def _believed(self, u: float, d_hat: float) -> tuple[float, float]:
        """(delay, inertia) that this sample's u came from; then the feedback has its say about the next one."""
        if self.feedback is None or not isinstance(self.controller, AdaptiveController):
            return math.nan, math.nan
        held = self.controller.believed
        self.controller.adopt(self.feedback.step(u, d_hat))
        return (math.nan, math.nan) if held is None else (held.delay, held.inertia)

    def _measure(self, noise: tuple[float, float, float]) -> tuple[float, float]:
        position = self.plant.position + noise[1]
        step = self.settings.measurement.encoder_step
        if step <= 0.0 or not math.isfinite(position / step):  # a loop that diverges gets here
            return position, self.plant.velocity + noise[2]
        position = step * round(position / step)
        before = position if self._encoder is None else self._encoder
        self._encoder = position
        return position, (position - before) / self.settings.sample_time + noise[2]

    def _advance(self, k: int) -> None:
        """Over [t_k, t_k+1): first the older of two commands for f T, then the newer."""
        sample_time = self.settings.sample_time
        whole, fraction = delay_taps(self.model.delay, sample_time)
        t, split = k * sample_time, fraction * sample_time
        if fraction > 0.0:
            self.plant.advance(t, self._command(k - whole - 1), split)
        self.plant.advance(t + split, self._command(k - whole), sample_time - split)

    def _command(self, k: int) -> float:
        return self.drive[k] if k >= 0 else self.actuator.at_rest


class _Noise:
    """White noise on d_hat, position and velocity; each channel has a stream of its own."""

    def __init__(self, settings: SimulationSettings, samples: int) -> None:
        measurement = settings.measurement
        on_d_hat = np.full(samples, measurement.d_hat_noise)
        for event in sorted(settings.events, key=lambda e: e.time):
            if event.noise is not None:
                on_d_hat[_sample_of(event, settings.sample_time, samples) :] = event.noise
        levels = (on_d_hat, np.array(measurement.position_noise), np.array(measurement.velocity_noise))
        seeds = np.random.SeedSequence(measurement.seed).spawn(len(levels))
        self._columns = [
            (level * np.random.default_rng(seed).standard_normal(samples)).tolist()
            for level, seed in zip(levels, seeds, strict=True)
        ]

    def at(self, k: int) -> tuple[float, float, float]:
        """Noise on (d_hat, position, velocity) at sample k."""
        d_hat, position, velocity = self._columns
        return d_hat[k], position[k], velocity[k]


def _models(settings: SimulationSettings, samples: int) -> dict[int, PlantModel]:
    """Sample -> the model from there on."""
    model, models = settings.model, {}
    for event in sorted(settings.events, key=lambda e: e.time):
        model = model.changed(event.delay, event.inertia, event.effects)
        models[_sample_of(event, settings.sample_time, samples)] = model
    return {k: model for k, model in models.items() if k < samples}


def _added(feedforward: Array | None, samples: int) -> Array:
    if feedforward is None:
        return np.zeros(samples)
    return np.asarray(feedforward[np.minimum(np.arange(samples), len(feedforward) - 1)])


def _sample_of(event: Event, sample_time: float, samples: int) -> int:
    return math.ceil(min(event.time / sample_time, samples) - _THERE)


def _controller(settings: SimulationSettings, feedback: Feedback | None) -> Controller | AdaptiveController:
    if feedback is None:
        return Controller(settings.controller, settings.observer.nominal_inertia, settings.sample_time)
    return AdaptiveController(
        settings.controller, settings.observer, settings.sample_time, feedback.longest_delay, feedback.ramp
    )


def _stamps(samples: int, sample_time: float) -> Array:
    """k T, as k / rate where the rate is whole: 0.003 instead of 0.0030000000000000001."""
    rate = round(1.0 / sample_time)
    if rate > 0 and abs(rate * sample_time - 1.0) < 1e-12:
        return np.arange(samples, dtype=np.float64) / rate
    return np.arange(samples, dtype=np.float64) * sample_time
