"""What the user knows of values before any fit: held, bounded, or known to a spread (a prior)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from dsd_cli.effects import Effect, Shape, get_effect
from dsd_cli.identify.results import DELAY, INERTIA
from dsd_cli.plant.model import PlantModel

#: Coefficients under which it is tried whether a parameter is independent of them, that is a shape.
_PROBES = (0.3, 0.6)


@dataclass(frozen=True)
class PriorKnowledge:
    """Names are "inertia", "delay" or "<effect>.<parameter>"; effects need not be in the model.

    fixed : values that no fit changes.
    bounds : smallest and largest value.
    priors : value and standard deviation: one more equation.
    events : effects all of whose values are held as the model has them, lists of events too.
    seen : of those that are fixed, the ones that the response has identified, with their standard errors
        (`search.response`).
    """

    fixed: Mapping[str, float] = field(default_factory=dict)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    events: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    seen: Mapping[str, float] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.fixed or self.bounds or self.priors or self.events)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All values of which something is known."""
        return tuple(dict.fromkeys((*self.fixed, *self.bounds, *self.priors)))

    def concerns(self, effect_id: str) -> bool:
        """Whether something is known of a value of that effect."""
        return effect_id in self.events or any(name.startswith(f"{effect_id}.") for name in self.names)

    def applied(self, model: PlantModel) -> PlantModel:
        """The model with what is fixed put into what it has."""
        there = {INERTIA, DELAY, *model.effects}
        return model.with_values({n: v for n, v in self.fixed.items() if n.partition(".")[0] in there})

    def seeing(
        self, effect_id: str, values: Mapping[str, tuple[float, float]], beside: Mapping[str, tuple[float, float]]
    ) -> PriorKnowledge:
        """With the values (and standard errors) of an effect that the response has identified; `beside`: of inertia and
        delay, which keep what is held."""
        found = {n: pair for n, pair in beside.items() if n not in self.fixed}
        found |= {f"{effect_id}.{name}": pair for name, pair in values.items()}
        fixed, errors = ({n: pair[i] for n, pair in found.items()} for i in (0, 1))
        return replace(self, fixed={**self.fixed, **fixed}, seen={**self.seen, **errors})

    def holding_effects(self, model: PlantModel, effects: Iterable[str]) -> PriorKnowledge:
        """With all values that the model has of these effects fixed, of which nothing else is known."""
        there = {f"{name}.{p}": v for name in effects for p, v in model.effects.get(name, {}).items()}
        there = {name: value for name, value in there.items() if name not in self.fixed}
        unknown = dict.fromkeys(there, math.nan)
        return replace(self, fixed={**self.fixed, **there}, seen={**self.seen, **unknown})

    def added_to(self, model: PlantModel, effect_id: str) -> PlantModel:
        """The model with an effect in it all of whose values are fixed."""
        prefix = f"{effect_id}."
        values = {n.removeprefix(prefix): value for n, value in self.fixed.items() if n.startswith(prefix)}
        return model.changed(None, None, {effect_id: values})

    def holding(self, model: PlantModel) -> PriorKnowledge:
        """With every value of that model fixed as well."""
        numbers = {INERTIA: model.inertia, DELAY: model.delay}
        events = {}
        for name, values in model.effects.items():
            if get_effect(name).listed:
                events[name] = values
            else:
                numbers |= {f"{name}.{p}": v for p, v in values.items() if isinstance(v, float)}
        rest = {name: found for name, found in self.priors.items() if name not in numbers}
        limits = {name: found for name, found in self.bounds.items() if name not in numbers}
        return replace(self, fixed={**numbers, **self.fixed}, events=events, priors=rest, bounds=limits)

    def limits(self, name: str) -> tuple[float, float]:
        """Bounds of a value; infinite where there are none."""
        return self.bounds.get(name, (-math.inf, math.inf))

    def ends(self, name: str) -> tuple[float, float]:
        """Between which a value may be: both that where it is held, else its bounds."""
        fixed = self.fixed.get(name)
        return self.limits(name) if fixed is None else (fixed, fixed)

    def pinned(self, effect_id: str, shape: Shape) -> dict[str, Any]:
        """A shape with what is known of it in place: fixed values, and within bounds."""
        found = dict(shape)
        for key, value in shape.items():
            name = f"{effect_id}.{key}"
            if name in self.names and is_shape(get_effect(effect_id), key, shape):
                low, high = self.limits(name)
                found[key] = self.fixed.get(name, min(max(value, low), high))
        return found

    def pull_of_shapes(self, effect_id: str, shape: Shape) -> float:
        """Sum of ((shape - prior) / spread)^2 over priors of shapes."""
        found = 0.0
        for key, value in shape.items():
            prior = self.priors.get(f"{effect_id}.{key}")
            if prior is not None and is_shape(get_effect(effect_id), key, shape):
                found += ((value - prior[0]) / prior[1]) ** 2
        return found


def is_shape(effect: Effect, parameter: str, shape: Shape) -> bool:
    """Whether a parameter stands in the shape as it is, whatever the coefficients are."""
    if parameter not in shape:
        return False
    if effect.split is None:
        return True
    count = len(effect.to_columns(_some_values(effect), 1.0)[0])
    found = [effect.from_columns((probe,) * count, shape, 1.0)[parameter] for probe in _PROBES]
    return all(math.isclose(one, shape[parameter], rel_tol=1e-12) for one in found)


def _some_values(effect: Effect) -> dict[str, Any]:
    """Any values within the bounds."""
    return {
        p.name: () if p.listed else min(max(0.5, p.lower), p.upper if math.isfinite(p.upper) else math.inf)
        for p in effect.parameters
    }
