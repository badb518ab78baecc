"""The section [fit] of `dsd.toml`: what is known of values before any fit."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from dsd_cli.errors import UsageError
from dsd_cli.files.config.rules import Place, Rule, Section, flag, key, number

if TYPE_CHECKING:
    from dsd_cli.identify.fit.known import Known
    from dsd_cli.plant.model import PlantModel

#: Name of a value ("inertia", "viscous_friction.coefficient") -> what is known of it.
Named = Mapping[str, Any]
_NOTHING: Named = MappingProxyType({})
_PRIOR = re.compile(r"\s*([^\s±]+?)\s*(?:\+-|±)\s*(\S+)\s*")
_PRIOR_FORM = 'a value and its standard deviation, such as "0.35+-0.02"'
_BOUNDS_FORM = "a smaller and a larger number, such as [0, 5]"
#: Of [model] itself; their bounds are those of [model].
_OWN = {"inertia": (0.0, math.inf), "delay": (0.0, math.inf)}


def _named(meaning: str, allowed: str, read: Callable[[Any, Place, float, float], Any]) -> Any:
    """A table of values by name, nested ({ viscous_friction = { coefficient = 1 } }) or dotted."""

    def tables(value: Any, at: Place) -> Named:
        if not isinstance(value, Mapping):
            raise at.wrong(value, f"a table of values, written [{at.path}]")
        return MappingProxyType(dict(_leaves(value, at, read)))

    return key(Rule(allowed, tables), meaning, default=_NOTHING)


def _leaves(table: Mapping[str, Any], at: Place, read: Callable[[Any, Place, float, float], Any]) -> Any:
    for name, value in table.items():
        if isinstance(value, Mapping):
            found: Any = {f"{name}.{inner}": one for inner, one in value.items()}
        else:
            found = {name: value}
        for full, one in found.items():
            yield full, read(one, at.child(full), *_limits(full, at))


def _limits(name: str, at: Place) -> tuple[float, float]:
    """What [model] allows for a value of that name.

    Raises
    ------
    UsageError : there is no such value.
    """
    if name in _OWN:
        return _OWN[name]
    from dsd_cli.effects import catalogue  # late: brings numpy, and most commands have it by then

    effect, dot, parameter = name.partition(".")
    known = catalogue()
    if effect not in known:
        raise at.unknown(effect, [*_OWN, *known], what="value")
    here = at.child(effect)
    if not dot:
        example = known[effect].parameters[0].name
        raise UsageError(f"{at.file}: {here.path} names no value", f"write {effect}.{example}")
    specs = {p.name: p for p in known[effect].parameters}
    if parameter not in specs:
        raise here.unknown(parameter, specs, what="parameter")
    if specs[parameter].listed:
        raise UsageError(f"{at.file}: {here.child(parameter).path} is a list", "it cannot be held or bounded")
    return float(specs[parameter].lower), float(specs[parameter].upper)


def _read_fixed(value: Any, at: Place, low: float, high: float) -> float | None:
    """None: as [model] has it."""
    if value is True:
        return None
    if at.path.endswith(".inertia") and at.path.count(".") == 2:
        return float(number(above=0.0).read(value, at))
    return float(number(lower=low, upper=high).read(value, at))


def _read_bounds(value: Any, at: Place, low: float, high: float) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise at.wrong(value, _BOUNDS_FORM)
    given = [x if isinstance(x, float) and math.isinf(x) else number().read(x, at.item(i)) for i, x in enumerate(value)]
    lower, upper = max(given[0], low), min(given[1], high)
    if not lower < upper:
        raise at.wrong(value, _BOUNDS_FORM + (f" within {low:g} to {high:g}" if given[0] < given[1] else ""))
    return lower, upper


def _read_prior(value: Any, at: Place, low: float, high: float) -> tuple[float, float]:
    found = _PRIOR.fullmatch(value) if isinstance(value, str) else None
    try:
        mean, spread = (float(text) for text in found.groups()) if found else (math.nan, math.nan)
    except ValueError:
        raise at.wrong(value, _PRIOR_FORM) from None
    if not (math.isfinite(mean) and math.isfinite(spread) and spread > 0.0):
        raise at.wrong(value, _PRIOR_FORM)
    if not low <= mean <= high:
        raise at.wrong(value, f"{_PRIOR_FORM}, the value from {low:g} to {high:g}")
    return mean, spread


class Fit(Section):
    """[fit]: what a fit may change. Names are inertia, delay or <effect>.<parameter>, of [model] or of a candidate."""

    fix: Named = _named(
        "values that no fit changes; true: as [model] has it", "a table of numbers (or true) by name", _read_fixed
    )
    bounds: Named = _named("smallest and largest value", "a table of lists such as [0, 5] by name", _read_bounds)
    prior: Named = _named(
        "what a data sheet says: one more equation", 'a table of texts such as "0.35+-0.02" by name', _read_prior
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

    def known(self, model: PlantModel, file: str) -> Known:
        """What a fit is told.

        Raises
        ------
        UsageError : a value is fixed as [model] has it, and [model] does not.
        """
        from dsd_cli.identify.fit.known import Known
        from dsd_cli.identify.fit.values import flat

        given, fixed = flat(model), {}
        for name, value in self.fix.items():
            if value is None and name not in given:
                raise UsageError(f"{file}: fit.fix.{name} = true, but [model] has no {name}", "give the value itself")
            fixed[name] = given[name] if value is None else value
        found = Known(fixed, dict(self.bounds), dict(self.prior))
        return found.holding(found.applied(model)) if self.hold else found


def with_known(
    written: Mapping[str, Any], fix: tuple[str, ...], bounds: tuple[str, ...], prior: tuple[str, ...]
) -> dict[str, Any]:
    """A copy of the tables of a config with `--fix`, `--bounds` and `--prior` in [fit].

    Raises
    ------
    UsageError : a text of another form.
    """
    section: dict[str, Any] = {name: dict(x) if isinstance(x, Mapping) else x for name, x in _section(written).items()}
    for text in fix:
        name, equals, value = text.partition("=")
        _put(section, "fix", name, _number(value, f"--fix {text}") if equals else True)
    for text in bounds:
        name, _, value = text.partition("=")
        low, colon, high = value.partition(":")
        if not colon:
            raise UsageError(f"--bounds {text}", "write NAME=LOW:HIGH, such as viscous_friction.coefficient=0:5")
        ends = [_number(low, f"--bounds {text}", -math.inf), _number(high, f"--bounds {text}", math.inf)]
        _put(section, "bounds", name, ends)
    for text in prior:
        name, equals, value = text.partition("=")
        if not equals or not _PRIOR.fullmatch(value):
            raise UsageError(f"--prior {text}", "write NAME=VALUE+-SPREAD, such as inertia=0.35+-0.02")
        _put(section, "prior", name, value)
    return {**written, "fit": section} if section else dict(written)


def _section(written: Mapping[str, Any]) -> Mapping[str, Any]:
    found = written.get("fit", {})
    return found if isinstance(found, Mapping) else {}


def _put(section: dict[str, Any], kind: str, name: str, value: Any) -> None:
    """What the command line says of a value replaces what the file says of it, of whatever kind."""
    name = name.strip()
    for other in ("fix", "bounds", "prior"):
        table = section.get(other)
        if isinstance(table, Mapping) and (other == kind or kind == "fix" or other == "fix"):
            section[other] = _left_out(table, name)
    section.setdefault(kind, {})[name] = value


def _left_out(table: Mapping[str, Any], name: str) -> dict[str, Any]:
    effect, _, parameter = name.partition(".")
    inner = {k: {p: v for p, v in x.items() if p != parameter} if k == effect and isinstance(x, Mapping) else x
             for k, x in table.items()}  # fmt: skip
    return {k: x for k, x in inner.items() if k != name and x != {}}


def _number(text: str, option: str, empty: float = math.nan) -> float:
    if not text.strip() and not math.isnan(empty):
        return empty
    try:
        return float(text)
    except ValueError:
        raise UsageError(option, f"'{text}' is no number") from None
