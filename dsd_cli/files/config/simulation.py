"""The section [simulate] of `dsd.toml`: reference, controller, horizon, noise, events."""

from __future__ import annotations

from typing import Literal

from dsd_cli.errors import UsageError
from dsd_cli.files.config.effect_values import NONE, EffectValues, effect_values
from dsd_cli.files.config.rules import (
    LONGEST,
    Place,
    Section,
    axis,
    choice,
    integer,
    key,
    kinds,
    number,
    table,
    tables,
    text,
)
from dsd_cli.signals.units import SHORTEST

#: They are held in memory.
MOST_SAMPLES = 1e8


class Step(Section):
    """A step from 0 to `amplitude`."""

    time: float = key(number(lower=0), "time of the step", "s", default=0.0)
    amplitude: float = key(number(), "height of the step", "rad or m", default=1.0)


class Sine(Section):
    """amplitude sin(frequency (t - start))."""

    frequency: float = key(number(above=0), "angular frequency", "rad/s")
    amplitude: float = key(number(), "amplitude", "rad or m", default=1.0)
    start: float = key(number(lower=0), "0 before this time", "s", default=0.0)


class Multisine(Section):
    """Sines of equal amplitude and random phase."""

    frequencies: tuple[float, ...] = key(axis(number(above=0)), "angular frequencies", "rad/s")
    amplitude: float = key(number(), "amplitude of each sine", "rad or m", default=1.0)
    seed: int = key(integer(0), "seed of the phases", default=0)


class Trapezoid(Section):
    """To and fro with trapezoidal speed, at rest for `dwell` at both ends."""

    distance: float = key(number(above=0), "distance of one move", "rad or m")
    speed: float = key(number(above=0), "greatest speed", "rad/s or m/s")
    acceleration: float = key(number(above=0), "acceleration", "rad/s2 or m/s2")
    dwell: float = key(number(lower=0), "rest between moves", "s", default=0.0)
    start: float = key(number(lower=0), "at rest before this time", "s", default=0.0)


class Column(Section):
    """A column of a CSV or Parquet file, one row per sample; its last value is held."""

    file: str = key(text(), "CSV or Parquet file, relative to the config file")
    column: str = key(text(), "its column with the reference")


class Planned(Section):
    """A motion that `dsd plan` wrote: its position, velocity and, added to u, its feedforward; at rest behind it."""

    file: str = key(text(), "CSV file of dsd plan, relative to the config file")
    delay: float = key(number(lower=0), "at rest at the first position before this time", "s", default=0.0)


Reference = Step | Sine | Multisine | Trapezoid | Column | Planned


class Controller(Section):
    """PD with a disturbance observer, with the network disturbance observer, alone, or u = reference."""

    kind: Literal["network_observer", "observer", "pd", "open_loop"] = key(
        choice("network_observer", "observer", "pd", "open_loop"),
        "Fig. 5 (stable for any delay), Fig. 1, PD alone, or u = reference",
    )
    kp: float | None = key(number(lower=0), "proportional gain; with kd", "u per rad or m", default=None)
    kd: float | None = key(number(lower=0), "derivative gain; with kp", "u per rad/s or m/s", default=None)
    ki: float = key(number(lower=0), "gain of the integral of the error", "u per rad s or m s", default=0.0)
    time_constant: float | None = key(
        number(above=0), "instead of kp and kd: time constant of the coefficient diagram method", "s", default=None
    )
    gamma: float = key(number(above=0), "stability index gamma_1 of that method", default=2.5)
    derivative: Literal["output", "error"] = key(
        choice("output", "error"),
        "what is differentiated: a step of the reference kicks only with error",
        default="output",
    )
    limit: float | None = key(
        number(above=0), "saturation: |u| stays within it; none without", "unit of u", default=None
    )

    def check(self, at: Place) -> None:
        gains = self.kp is not None and self.kd is not None
        if (self.kp is None) != (self.kd is None):
            name, other = ("kd", "kp") if self.kd is None else ("kp", "kd")
            raise at.missing(name, f"{other} is given, a controller needs both (or time_constant)")
        if self.kind == "open_loop":
            if gains or self.time_constant is not None:
                raise UsageError(f'{at.file}: [{at.path}] kind = "open_loop" contradicts gains', "leave them out")
        elif gains and self.time_constant is not None:
            raise UsageError(f"{at.file}: [{at.path}] has kp, kd and time_constant", "give the gains or time_constant")
        elif not gains and self.time_constant is None:
            raise at.missing("time_constant", "the gains need it (s), or give kp and kd")


class Event(Section):
    """From `time` on the true plant has these values."""

    time: float = key(number(lower=0), "when the plant changes", "s")
    delay: float | None = key(number(lower=0, upper=LONGEST), "new delay", "s", default=None)
    inertia: float | None = key(number(above=0), "new inertia", "as nominal_inertia", default=None)
    effects: EffectValues = key(effect_values(), "new values of effects", default=NONE)
    noise: float | None = key(
        number(lower=0), "new standard deviation of the noise on d_hat", "unit of u", default=None
    )

    def check(self, at: Place) -> None:
        if self.delay is None and self.inertia is None and self.noise is None and not self.effects:
            allowed = "give delay, inertia, noise or effects.<id>.<parameter>"
            raise UsageError(f"{at.file}: {at.path} changes nothing", allowed)


class Adapt(Section):
    """What `dsd simulate --adapt` does with the labels of [detector]."""

    dwell: float = key(number(lower=0), "a label is adopted that stands confident for so long", "s", default=0.1)
    ramp: float = key(number(lower=0), "the controller changes its law over so long", "s", default=0.2)


class Simulate(Section):
    """[simulate]: what `dsd simulate` runs."""

    duration: float = key(number(above=0), "length of the log", "s")
    sample_time: float = key(number(lower=SHORTEST), "sample time", "s")
    seed: int = key(integer(0), "seed of the noise", default=0)
    noise: float = key(number(lower=0), "standard deviation of the noise on d_hat", "unit of u", default=0.0)
    position_noise: float = key(number(lower=0), "standard deviation of the noise on position", "rad or m", default=0.0)
    velocity_noise: float = key(
        number(lower=0), "standard deviation of the noise on velocity", "rad/s or m/s", default=0.0
    )
    encoder_step: float = key(
        number(lower=0), "position is rounded to multiples of it; 0 is exact", "rad or m", default=0.0
    )
    start: float = key(number(), "position of the axis at the beginning, at rest", "rad or m", default=0.0)
    reference: Reference = key(
        kinds(step=Step, sine=Sine, multisine=Multisine, trapezoid=Trapezoid, column=Column, plan=Planned),
        "what the plant follows",
    )
    controller: Controller = key(table(Controller), "what computes u")
    events: tuple[Event, ...] = key(tables(Event), "changes of the true plant", default=())
    adapt: Adapt = key(table(Adapt), "the detected state back into the controller (--adapt)", default=Adapt())

    def check(self, at: Place) -> None:
        if self.duration / self.sample_time > MOST_SAMPLES:
            raise at.child("duration").wrong(self.duration, f"at most {MOST_SAMPLES:g} sample times")
        if self.duration < self.sample_time:
            raise at.child("duration").wrong(self.duration, f"at least one sample_time ({self.sample_time:g} s)")
