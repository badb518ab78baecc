"""The section [fit] of `dsd.toml`: what is known of values before any fit."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from dsd_cli.errors import UsageError
from dsd_cli.files.config.rules import LONGEST, Place, Rule, Section, flag, key, number, suggestion

if TYPE_CHECKING:
    from dsd_cli.effects import Effect
    from dsd_cli.identify.fit.priors import PriorKnowledge
    from dsd_cli.plant.model import PlantModel

#: Name of a value ("inertia", "viscous_friction.coefficient") -> what is known of it.
Named = Mapping[str, Any]
_NOTHING: Named = MappingProxyType({})
PRIOR = re.compile(r"\s*([^\s±]+?)\s*(?:\+-|\+/-|±)\s*(\S+)\s*")
_PRIOR_FORM = 'a value and its standard deviation, such as "0.35+-0.02" or "0.35+-5%"'
_BOUNDS_FORM = "a smaller and a larger number, such as [0, 5]"
#: Of [model] itself; their bounds are those of [model].
_OWN = {"inertia": (0.0, math.inf), "delay": (0.0, LONGEST)}
#: What else they are called.
_ALSO_CALLED = {"mass": "inertia", "m": "inertia", "j": "inertia", "l": "delay", "latency": "delay"}


def named_values(meaning: str, allowed: str, read: Callable[[Any, Place, str], Any]) -> Any:
    """A table of values by name, nested ({ viscous_friction = { coefficient = 1 } }) or dotted."""

    def tables(value: Any, at: Place) -> Named:
        if not isinstance(value, Mapping):
            raise at.wrong(value, f"a table of values, written [{at.path}]")
        return MappingProxyType(dict(_leaves(value, at, read)))

    return key(Rule(allowed, tables), meaning, default=_NOTHING)


def _leaves(table: Mapping[str, Any], at: Place, read: Callable[[Any, Place, str], Any]) -> Any:
    for name, value in table.items():
        if isinstance(value, Mapping):
            found: Any = {f"{name}.{inner}": one for inner, one in value.items()}
        else:
            found = {name: value}
        for full, one in found.items():
            yield full, read(one, at.child(full), full)


def limits_of(name: str, at: Place) -> tuple[float, float]:
    """What [model] allows for a value of that name.

    Raises
    ------
    UsageError : there is no such value.
    """
    if name in _OWN:
        return _OWN[name]
    from dsd_cli.effects import catalogue, find_effect  # late: brings numpy, and most commands have it by then

    effect, dot, parameter = name.partition(".")
    known = find_effect(effect)
    if known is None:
        raise UsageError(f"{at.subject}: no value is called '{name}'", _nearest(name, catalogue()))
    specs = {p.name: p for p in known.parameters}
    if not dot:
        names = " or ".join(f"{effect}.{one}" for one in specs)
        raise UsageError(f"{at.subject}: {effect} is an effect, not a value", f"write {names}")
    if parameter not in specs:
        raise UsageError(f"{at.subject}: {effect} has no '{parameter}'", f"it has {', '.join(specs)}")
    if not specs[parameter].numeric:
        raise UsageError(f"{at.subject}: {name} is a list or a word", "it cannot be held or bounded")
    return float(specs[parameter].lower), float(specs[parameter].upper)


def _nearest(name: str, known: Mapping[str, Effect]) -> str:
    """What was meant by the name of a value that there is not."""
    values = [f"{effect}.{p.name}" for effect, one in known.items() for p in one.parameters]
    for choice in ([*_OWN, *values], known):
        near = suggestion(_ALSO_CALLED.get(name.lower(), name), choice)
        if near.startswith("did"):
            return near
    return "there are inertia, delay, and EFFECT.PARAMETER as `dsd effects` lists them"


def read_fixed(value: Any, at: Place, name: str) -> float | None:
    """A value that is held; None: as [model] has it."""
    low, high = limits_of(name, at)
    if value is True:
        return None
    allowed = number(above=low, upper=high) if name == "inertia" else number(lower=low, upper=high)
    return float(allowed.read(value, at))


def read_bounds(value: Any, at: Place, name: str) -> tuple[float, float]:
    """(smallest, largest), those of [model] where the user's go beyond them."""
    low, high = limits_of(name, at)
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise at.wrong(value, _BOUNDS_FORM)
    given = [x if isinstance(x, float) and math.isinf(x) else number().read(x, at.item(i)) for i, x in enumerate(value)]
    if not given[0] < given[1]:
        same = f"the two are the same (to hold a value: --fix {name}={given[0]:g})"
        raise at.refused(value, same if given[0] == given[1] else "the smaller number comes first")
    lower, upper = max(given[0], low), min(given[1], high)
    if not lower < upper:
        raise at.refused(value, f"{name} cannot be there, it is {_range(name, low, high)}")
    return lower, upper


def read_prior(value: Any, at: Place, name: str) -> tuple[float, float]:
    """(mean, standard deviation)."""
    low, high = limits_of(name, at)
    found = PRIOR.fullmatch(value) if isinstance(value, str) else None
    try:
        mean, spread = _mean_and_spread(*found.groups()) if found else (math.nan, math.nan)
    except ValueError:
        raise at.wrong(value, _PRIOR_FORM) from None
    if spread <= 0.0:
        raise at.refused(value, f"the standard deviation must be above 0 (to hold a value: --fix {name}={mean:g})")
    if not (math.isfinite(mean) and math.isfinite(spread)):
        raise at.wrong(value, _PRIOR_FORM)
    if not low <= mean <= high or (name == "inertia" and mean == 0.0):
        raise at.refused(value, f"{name} cannot be there, it is {_range(name, low, high)}")
    return mean, spread


def _mean_and_spread(mean: str, spread: str) -> tuple[float, float]:
    """A spread may be a share of the mean: 5%."""
    if spread.endswith("%"):
        return float(mean), abs(float(mean)) * float(spread.removesuffix("%")) / 100.0
    return float(mean), float(spread)


def _range(name: str, low: float, high: float) -> str:
    if name == "inertia":
        return "above 0"
    return f"at least {low:g}" if math.isinf(high) else f"from {low:g} to {high:g}"


class Fit(Section):
    """[fit]: what a fit may change. Names are inertia, delay or <effect>.<parameter>, of [model] or of a candidate."""

    fix: Named = named_values(
        "values that no fit changes; true: as [model] has it", "a table of numbers (or true) by name", read_fixed
    )
    bounds: Named = named_values("smallest and largest value", "a table of lists such as [0, 5] by name", read_bounds)
    prior: Named = named_values(
        "what a data sheet says: one more equation", 'a table of texts such as "0.35+-0.02" by name', read_prior
    )
    hold: bool = key(flag(), "fit nothing that [model] has: a known machine", default=False)

    def check(self, at: Place) -> None:
        for name in self.fix:
            for other in ("bounds", "prior"):
                if name in getattr(self, other):
                    raise UsageError(
                        f"{at.file}: {name} is in {at.path}.fix and in {at.path}.{other}", "what is fixed needs no more"
                    )
        for name, (value, _) in self.prior.items():
            low, high = self.bounds.get(name, (-math.inf, math.inf))
            if not low <= value <= high:
                raise at.child("prior").child(name).wrong(value, f"within its bounds, {low:g} to {high:g}")

    def known(self, model: PlantModel, file: str) -> PriorKnowledge:
        """What a fit is given.

        Raises
        ------
        UsageError : a value is fixed as [model] has it, and [model] does not.
        """
        from dsd_cli.identify.fit.priors import PriorKnowledge
        from dsd_cli.identify.fit.values import flat

        given, fixed = flat(model), {}
        for name, value in self.fix.items():
            if value is None and name not in given:
                raise UsageError(f"{file}: fit.fix.{name} = true, but [model] has no {name}", "give the value itself")
            fixed[name] = given[name] if value is None else value
        found = PriorKnowledge(fixed, dict(self.bounds), dict(self.prior))
        return found.holding(found.applied(model)) if self.hold else found
