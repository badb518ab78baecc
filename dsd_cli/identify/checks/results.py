"""What a check of a log finds, as plain frozen values."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

from dsd_cli.identify.fit.priors import Grade
from dsd_cli.signals.log import Hold
from dsd_cli.signals.units import KeysOf, Units

Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True)
class Finding:
    """One thing that a log shows.

    what : one sentence.
    channel : the channel of `Log` that it is about; "t" is the clock, "log" the whole.
    severity : "error": what is asked of this log would be answered wrongly, or not at all; "warning": some of it
        would; "note": to know.
    sure : 0 to 1, how sure the check is of it.
    remedy : what to do; names the key of the config where there is one.
    multiply : (channel, factor) that would mend it; `worded` makes the remedy of it.
    late : s by which u is late, and the same.
    ratio : of velocity and slope of position, where that is what is wrong; else 0.
    first : it must be said before anything that the log answers, though it is no error.
    late_channel, late_by : velocity or position, where one is later than the other says, and by how many s.
    hold : how u lives between its samples (`Log.u_hold`), where the log does not have it so.
    """

    what: str
    channel: str
    severity: Severity
    sure: float
    remedy: str = ""
    multiply: tuple[tuple[str, float], ...] = ()
    late: float = 0.0
    ratio: float = 0.0
    first: bool = False
    late_channel: str = ""
    late_by: float = 0.0
    hold: Hold | None = None

    def worded(self, keys_of: KeysOf, u_shift: float = 0.0) -> Finding:
        """With a remedy that says what the keys of [signals] must be."""
        keys = [*keys_of({c: math.prod(x for other, x in self.multiply if other == c) for c, _ in self.multiply})]
        keys += [f"signals.u_shift = {u_shift - self.late:.3g}"] if self.late else []
        if not keys:
            return self
        joint = ", " if self.remedy.startswith("or ") else " and "
        return replace(self, remedy=" and ".join(keys) + (joint + self.remedy if self.remedy else ""))


@dataclass(frozen=True)
class Parameter:
    """Whether this log can identify a value of the model.

    name : "inertia", "delay" or "<effect>.<parameter>".
    identified : by the relative standard error: below 10 %, below 50 %, or not.
    value : what a fit in the band gives; NaN where it gives nothing.
    std_error : of the value, with correlated errors counted; infinite where the log says nothing.
    unit : with {u}, {v}, {q} for the units of the channels.
    tied_to : parameters that this log cannot distinguish from it (`POLICY.tied_correlation`).
    beside : the value with friction, weight and springs of any size beside the model, where that is so far off that it
        is less well known; `std_error` counts the difference. Else None. biased : beyond its own error.
    lacks_force : with those forces most of what is left is gone, so that one is missing; otherwise noise that the
        controller answers may be what `beside` is off by.
    leaning : what least squares makes of it where noise that the controller answers bends that, so that `value` is by
        the reference as instrument. Else None.
    """

    name: str
    identified: Grade
    value: float
    std_error: float
    unit: str = ""
    tied_to: tuple[str, ...] = ()
    beside: float | None = None
    biased: bool = False
    lacks_force: bool = False
    leaning: float | None = None


#: Moves that are needed for each effect that is asked for.
MOVES_PER_EFFECT = 3


@dataclass(frozen=True)
class Excitation:
    """What the axis did; None where no motion is logged.

    moving : share of the time.
    forward, backward : moves of each direction between rests and reversals (of u about its mean without a motion).
    top_speed, travel : rad/s or m/s, rad or m.
    at_limit : share of the time in which u keeps its largest or smallest value.
    """

    moving: float | None
    forward: int
    backward: int
    top_speed: float | None
    travel: float | None
    at_limit: float

    @property
    def stretches(self) -> int:
        """Moves of both directions."""
        return self.forward + self.backward

    @property
    def effects(self) -> int:
        """How many effects can be asked of this log."""
        return self.stretches // MOVES_PER_EFFECT


@dataclass(frozen=True)
class CheckResult:
    """Whether one log can answer.

    log : its name.
    findings : gravest first.
    parameters : of the model; of inertia and delay alone where there is no model.
    band_hz : up to this frequency the acceleration stands above the noise of its sensor; None without a motion.
    floor : rms of J a_noise within the band, in the unit of u; None where the sensor's noise or J is not known.
    excitation : what the axis did.
    seconds, samples : length of the log. units : what those of u and of positions are called.
    """

    log: str
    findings: tuple[Finding, ...]
    parameters: tuple[Parameter, ...]
    band_hz: float | None
    floor: float | None
    excitation: Excitation
    seconds: float
    samples: int
    units: Units = field(default_factory=Units)

    def named(self, units: Units) -> CheckResult:
        """With the user's names of the units."""
        parameters = tuple(replace(one, unit=units.words(one.unit)) for one in self.parameters)
        return replace(self, units=units, parameters=parameters)

    @property
    def errors(self) -> tuple[Finding, ...]:
        """The findings because of which the log cannot answer."""
        return tuple(f for f in self.findings if f.severity == "error")
