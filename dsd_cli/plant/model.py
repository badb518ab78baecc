"""A plant model (the disturbance state) and the disturbance observer that watches the plant."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from dsd_cli.effects import Effect, Role, get_effect
from dsd_cli.errors import UsageError

#: Values of every model that belong to no effect.
INERTIA, DELAY = "inertia", "delay"

#: Effect id -> parameter -> value (a number; a list of tables for a `listed` parameter).
EffectValues = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class ObserverSettings:
    """The disturbance observer d_hat = sign Q { Jn a - u }, Q = 1/(tau s + 1) (eq. 13).

    Attributes
    ----------
    nominal_inertia : Jn, kg m2 or kg (per unit of u).
    time_constant : tau, s; 0 is no filter.
    sign : -1 for logs whose d_hat is Q { u - Jn a }.
    """

    nominal_inertia: float = 1.0
    time_constant: float = 0.01
    sign: int = 1

    def __post_init__(self) -> None:
        _check("observer.nominal_inertia", self.nominal_inertia, above=0.0)
        _check("observer.time_constant", self.time_constant, lower=0.0)
        if self.sign not in (1, -1):
            raise UsageError(f"observer.sign = {self.sign}", "must be 1 or -1")

    def pole(self, interval: float) -> float:
        """p = exp(-T / tau) of Q over an interval of T s; 0 without filter."""
        return math.exp(-interval / self.time_constant) if self.time_constant > 0.0 else 0.0


@dataclass(frozen=True)
class PlantModel:
    """J a(t) = u(t - L) + sum of the effects' forces.

    Attributes
    ----------
    inertia : J, kg m2 or kg (per unit of u).
    delay : L, s, any real number from 0 on.
    effects : effect id -> parameter -> value; every parameter of an effect is given.
    rest_speed : speed up to which friction may hold the plant; 0 fits a log of `simulate`.

    Raises
    ------
    UsageError : an effect or parameter that does not exist, is missing, or is out of bounds.
    """

    inertia: float = 1.0
    delay: float = 0.0
    effects: EffectValues = field(default_factory=dict)
    rest_speed: float = 0.0

    def __post_init__(self) -> None:
        _check("model.inertia", self.inertia, above=0.0)
        _check("model.delay", self.delay, lower=0.0)
        _check("model.rest_speed", self.rest_speed, lower=0.0)
        checked = {name: _checked_values(get_effect(name), values) for name, values in self.effects.items()}
        object.__setattr__(self, "effects", MappingProxyType(checked))

    @property
    def motor_inertia(self) -> float:
        """J less the shares of the loads that hang on the motor, as J."""
        loads = (name for name in self.effects if get_effect(name).role is Role.STRUCTURE)
        shares = sum(get_effect(name).to_columns(self.effects[name], self.inertia)[0][0] for name in loads)
        return self.inertia * (1.0 - shares)

    def needs(self) -> dict[str, str]:
        """Channel that must be in the log -> the first effect that asks for it."""
        found: dict[str, str] = {}
        for name, values in self.effects.items():
            for channel in get_effect(name).needed(values):
                found.setdefault(channel, name)
        return found

    def changed(
        self, delay: float | None = None, inertia: float | None = None, effects: EffectValues | None = None
    ) -> PlantModel:
        """The model with these values in place; effects are merged parameter by parameter."""
        merged: dict[str, dict[str, Any]] = {name: dict(values) for name, values in self.effects.items()}
        for name, values in (effects or {}).items():
            merged.setdefault(name, {}).update(values)
        return PlantModel(
            self.inertia if inertia is None else inertia,
            self.delay if delay is None else delay,
            merged,
            self.rest_speed,
        )

    def with_values(self, values: Mapping[str, Any]) -> PlantModel:
        """The model with these in place: "inertia", "delay" or "<effect>.<parameter>" -> value."""
        effects: dict[str, dict[str, Any]] = {}
        for name, value in values.items():
            effect, dot, parameter = name.partition(".")
            if dot:
                effects.setdefault(effect, {})[parameter] = value
        return self.changed(values.get(DELAY), values.get(INERTIA), effects)


def _checked_values(effect: Effect, values: Mapping[str, Any]) -> Mapping[str, Any]:
    known = {p.name: p for p in effect.parameters}
    for name in values:
        if name not in known:
            raise UsageError(f"effect {effect.id} has no parameter '{name}'", "it has " + ", ".join(known))
    for name, parameter in known.items():
        if name not in values and not parameter.optional:
            raise UsageError(f"effect {effect.id} lacks {name}", parameter.meaning)
        if parameter.numeric and name in values:
            _check(f"{effect.id}.{name}", values[name], lower=parameter.lower, upper=parameter.upper)
    there = {name: p for name, p in known.items() if name in values}
    checked = {name: float(values[name]) if p.numeric else values[name] for name, p in there.items()}
    if any(p.data for p in known.values()):
        effect.to_columns(checked)  # says what is wrong with a table
    return MappingProxyType(checked)


def _check(
    name: str, value: float, lower: float = -math.inf, upper: float = math.inf, above: float = -math.inf
) -> None:
    """`value` is a finite number with above < value and lower <= value <= upper."""
    if math.isfinite(value) and above < value and lower <= value <= upper:
        return
    if above > -math.inf:
        allowed = f"a number above {above:g}"
    else:
        bounds = [f"from {lower:g}"] * (lower > -math.inf) + [f"up to {upper:g}"] * (upper < math.inf)
        allowed = " ".join(["a finite number", *bounds])
    raise UsageError(f"{name} = {value:g}", f"must be {allowed}")
