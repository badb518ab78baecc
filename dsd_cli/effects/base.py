"""The interface that every effect file fills.

The force law of an effect is `sum(coefficient_i * column_i)`: the simulator evaluates the columns at one instant,
prediction and identification evaluate the same function over a whole log, so the two cannot drift apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from dsd_cli.effects.joint_terms import JointTerms

#: Parameters by name that shape the columns and do not multiply them.
Shape = Mapping[str, Any]
#: All parameters of an effect by name, as they stand in `dsd.toml`.
Values = Mapping[str, Any]


class Role(Enum):
    """How the plant uses the columns of an effect.

    APPLIED : force on the plant is coefficients x columns.
    FRICTION : coefficients x columns is a non-negative *budget*; the plant owns sign and sticking.
    INPUT : the one column is the changed command, u_eff, before the delay; there are no coefficients.
    STRUCTURE : a load of share s of the inertia hangs on the motor: the motor has J (1 - s), and the one column is the
        acceleration of the load (rad/s2 or m/s2), so that the coupling pulls with -s J x column.
    """

    APPLIED = "applied"
    FRICTION = "friction"
    INPUT = "input"
    STRUCTURE = "structure"


class Channels(NamedTuple):
    """What an effect may look at; each a float (simulator) or an array of shape (n,) (prediction).

    t in s, u in the user's unit (INPUT: the command as logged; else what reaches the plant after input effects and
    delay), velocity and position in SI units, interval in s: the time that this row stands for. acceleration and
    direction (mean of sgn v) where they are measured; None: they follow from the velocity.
    """

    t: Any
    u: Any
    velocity: Any
    position: Any
    interval: Any = 0.0
    acceleration: Any = None
    direction: Any = None


class Ranges(NamedTuple):
    """What a log contains, for choosing starting shapes: SI units, u in the user's unit.

    speed : rms speed while moving; top_speed : largest; travel : range of the position; drive : rms of u; top_drive :
    largest |u| but for rare spikes; sample_time and duration in s; resolution : the shortest way that the sensor of
    the position resolves; band_hz : up to which forces are balanced; passes : how often the axis goes over the travel;
    spike_drive : largest |u| of all.
    """

    speed: float
    top_speed: float
    travel: float
    drive: float
    top_drive: float
    sample_time: float
    duration: float
    resolution: float = 0.0
    band_hz: float = np.inf
    passes: float = np.inf
    spike_drive: float = 0.0


@dataclass(frozen=True)
class Parameter:
    """One value of an effect.

    `unit` uses `{u}` for the unit of u, `{v}` for velocity's and `{q}` for position's.
    A `linear` parameter multiplies one column, in the order of declaration; the others shape the columns.
    `listed` : the value is a list of events (`external_force.events`), not a number: the shape is
    {"edges": ((start, end), ...)}, s, with a column per event.
    `data` : it is no number but a list or a word that says which law this is; no fit changes it, and `split` checks it.
    `optional` : such a one that may be left out.
    """

    name: str
    unit: str
    meaning: str
    lower: float = -np.inf
    upper: float = np.inf
    linear: bool = True
    listed: bool = False
    data: bool = False
    optional: bool = False

    @property
    def numeric(self) -> bool:
        """Whether it is a number, which can be fitted, held and bounded."""
        return not (self.listed or self.data)

    @property
    def whole_turn(self) -> bool:
        """Whether it is an angle that may have any value."""
        return self.unit == "rad" and math.isclose(self.upper - self.lower, 2.0 * math.pi)


class SpectralLines(Protocol):
    """The strongest lines of a residual: Hz over time, rad per unit of position over the position."""

    @property
    def over_time(self) -> tuple[float, ...]: ...

    @property
    def over_position(self) -> tuple[float, ...]: ...


def _no_starts(_: Ranges) -> list[Shape]:
    return []


def _no_seeds(_: SpectralLines) -> list[Shape]:
    return []


def _one_start(_: Ranges) -> list[Shape]:
    return [{}]


@dataclass(frozen=True)
class Effect:
    """One physical effect: what it is, what it needs, and the one function giving its unit-force columns.

    Attributes
    ----------
    id : the name used in `dsd.toml` and on the command line.
    law : the formula, as text.
    needs : channels of `Channels` that must be in the log.
    pattern : the residual pattern that betrays it.
    columns : (channels, shape) -> one column per coefficient. With `memory` it is
        (channels, shape, state) -> (columns, state): the rows continue those that left `state` (None: the log begins).
    starts : (ranges of the log) -> shapes from which the search for shape parameters starts, ordered along the
        shape where there is one parameter; `[{}]` where nothing is searched.
    split : values -> (coefficients, shape); by default linear parameters and the others. Effects whose coefficients
        are not parameters (amplitude and phase -> sine and cosine) give their own, and `join` undoes it.
    memory : the columns depend on earlier rows.
    seeds : (lines of the residual) -> further shapes to start from.
    closely : (ranges of the log) -> starts so close together that one is in the best valley, where valleys are narrow:
        they are asked once. valley : how far from the best one may be, natural logarithm of each of these parameters.
        hidden_by : effects that any machine may have, beside which it is looked for so.
    lateness : shape -> s by which the effect makes a command late, so that a search moves the delay along with it.
    periods : (shape, ranges) -> periods of it in the log: it is determined to about that share of itself.
    broad : shape parameters that matter less than the others.
    coupling : shape -> spring, damper and play (`memory.Coupling`) between the motor and a load of its own.
    rarity : of effects that explain a log alike, the one that is met more often (0) is named before a rarer one.
    varies : linear parameters that differ from log to log of one machine: an offset that drifts, friction that warms
        up.
    repeats : ranges of the log -> whether it may distinguish several of this effect, by their `periods`. A
        model then has sections `<id>`, `<id>_2`, `<id>_3`, ... of one law. None: there is one in a model.
    told_apart : another effect, "inertia" or "delay", that logs often cannot distinguish from this one -> the
        experiment that can. It is enough if one of the two says so.
    of_angle : the position is an angle: an axis of which it is a length has no such effect.
    needs_of : values -> channels that it needs with these; None: `needs`, which is all that it may need.
    joint : (values, inertia J of the whole plant) -> what it is in the joint of a robot simulator; None: nobody said.
    of_joint : (terms of a joint, inertia) -> values for each of this effect that is among them; None: it is none.
    """

    id: str
    role: Role
    law: str
    summary: str
    pattern: str
    parameters: tuple[Parameter, ...]
    needs: tuple[str, ...]
    columns: Callable[..., Any]
    starts: Callable[[Ranges], list[Shape]] = field(default=_one_start)
    split: Callable[[Values, float], tuple[tuple[float, ...], Shape]] | None = None
    join: Callable[[tuple[float, ...], Shape, float], Values] | None = None
    memory: bool = False
    seeds: Callable[[SpectralLines], list[Shape]] = field(default=_no_seeds)
    closely: Callable[[Ranges], list[Shape]] = field(default=_no_starts)
    valley: Mapping[str, float] = field(default_factory=dict)
    hidden_by: tuple[str, ...] = ()
    lateness: Callable[[Shape], float] | None = None
    periods: Callable[[Shape, Ranges], float] | None = None
    broad: tuple[str, ...] = ()
    coupling: Callable[[Shape], Any] | None = None
    rarity: int = 6
    varies: tuple[str, ...] = ()
    repeats: Callable[[Ranges], bool] | None = None
    told_apart: Mapping[str, str] = field(default_factory=dict)
    of_angle: bool = False
    needs_of: Callable[[Values], tuple[str, ...]] | None = None
    joint: Callable[[Values, float], JointTerms] | None = None
    of_joint: Callable[[JointTerms, float], Sequence[Values]] | None = None

    @property
    def searched(self) -> int:
        """Number of parameters that are searched, not solved for: a part of the price of the effect."""
        return sum(not p.linear and p.numeric for p in self.parameters)

    @property
    def sizes(self) -> int:
        """Number of parameters that multiply its columns, which least squares solve for; none of one that acts on u."""
        return sum(p.linear for p in self.parameters)

    @property
    def of_time(self) -> bool:
        """Whether it is a function of time alone, free in shape: a list of events, or a line."""
        return self.role is Role.APPLIED and not self.needs and (self.listed or self.searched > 0)

    @property
    def listed(self) -> bool:
        """Whether it is a list of events, found in the residual over time and not from the ranges of a log."""
        return any(p.listed for p in self.parameters)

    def parameter(self, name: str) -> Parameter:
        """The parameter of that name, which must exist."""
        return next(p for p in self.parameters if p.name == name)

    def needed(self, values: Values) -> tuple[str, ...]:
        """Channels that it looks at with these values."""
        return self.needs if self.needs_of is None else self.needs_of(values)

    def run(self, channels: Channels, shape: Shape, state: Any = None) -> tuple[tuple[Any, ...], Any]:
        """(columns, state to carry on from); the state of an effect without memory is None."""
        if self.memory:
            columns, state = self.columns(channels, shape, state)
            return tuple(columns), state
        return tuple(self.columns(channels, shape)), None

    def to_columns(self, values: Values, inertia: float = 1.0) -> tuple[tuple[float, ...], Shape]:
        """Values as they stand in the config -> (a coefficient per column, shape); inertia J of the whole plant."""
        if self.split is not None:
            return self.split(values, inertia)
        linear = tuple(float(values[p.name]) for p in self.parameters if p.linear)
        return linear, {p.name: values[p.name] for p in self.parameters if not p.linear}

    def from_columns(self, coefficients: tuple[float, ...], shape: Shape, inertia: float = 1.0) -> Values:
        """The inverse of `to_columns`."""
        if self.join is not None:
            return self.join(coefficients, shape, inertia)
        given: Iterator[float] = iter(coefficients)
        return {p.name: next(given) if p.linear else shape[p.name] for p in self.parameters}

    def force(self, channels: Channels, values: Values, inertia: float = 1.0, state: Any = None) -> tuple[Any, Any]:
        """(coefficients x columns, state): a force (APPLIED) or a budget (FRICTION), in the unit of u."""
        coefficients, shape = self.to_columns(values, inertia)
        columns, state = self.run(channels, shape, state)
        return sum((c * column for c, column in zip(coefficients, columns, strict=True)), 0.0), state


def sine_and_cosine(amplitude: float, phase: float) -> tuple[float, float]:
    """A sin(x + phi) = a sin x + b cos x -> (a, b)."""
    return amplitude * math.cos(phase), amplitude * math.sin(phase)


def amplitude_and_phase(a: float, b: float) -> tuple[float, float]:
    """The inverse of `sine_and_cosine`; amplitude >= 0, phase in (-pi, pi]."""
    return math.hypot(a, b), math.atan2(b, a)


def sinc(x: Any) -> Any:
    """`np.sinc`; where no row lasts (x is 0 throughout) 1, which spares a sine of each."""
    if isinstance(x, float) and 0.0 < abs(x) < math.inf:  # in a simulation, sample by sample
        return math.sin(math.pi * x) / (math.pi * x)
    return np.sinc(x) if np.any(x) else 1.0


def log_spaced(low: float, high: float, count: int) -> list[float]:
    """`count` values from low to high, each the same factor above the one before; [] unless 0 < low < high < inf."""
    return list(_log_spaced(low, high, count)) if 0.0 < low < high < math.inf else []


@lru_cache(maxsize=256)  # a search asks for the ends of the same ranges again and again
def _log_spaced(low: float, high: float, count: int) -> tuple[float, ...]:
    return tuple(np.geomspace(low, high, count).tolist())


def decay(x: Any) -> tuple[Any, Any]:
    """(exp(-x), its mean over [0, x]) for x >= 0: what is left, and was left on average, after x time constants."""
    if isinstance(x, float):  # in a simulation, sample by sample
        return math.exp(-x), -math.expm1(-x) / x if x > 0.0 else 1.0
    left = np.exp(-x)
    moving = x > 0.0
    if np.all(moving):
        return left, np.expm1(-x) / -x
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(moving, -np.expm1(-x) / np.where(moving, x, 1.0), 1.0)
    return left, mean
