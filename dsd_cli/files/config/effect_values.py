"""Values of effects in `dsd.toml`, checked against the catalogue: `[model.effects.<id>]`, `[states.effects.<id>]`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from dsd_cli.errors import UsageError
from dsd_cli.files.config.rules import Place, Rule, axis, number

if TYPE_CHECKING:
    from dsd_cli.effects import Parameter

#: Effect id -> parameter -> value (a tuple of values on an axis of the grid).
EffectValues = Mapping[str, Mapping[str, Any]]

#: Keys of one entry of a listed parameter.
_PULSE = {"start": "s, when it begins", "end": "s, when it ends", "force": "unit of u, positive accelerates"}

NONE: EffectValues = MappingProxyType({})


def effect_values(axes: bool = False) -> Rule:
    """A table of effects, each a table of parameters; with `axes` every parameter is a list of candidates."""

    def read(value: Any, at: Place) -> EffectValues:
        if not isinstance(value, Mapping):
            raise at.wrong(value, f"a table, written [{at.path}.<effect>]")
        found = {name: _read_effect(name, parameters, at, axes) for name, parameters in value.items()}
        return MappingProxyType(found)

    return Rule("tables of effects" + (" with lists of values" if axes else ""), read)


def _read_effect(name: str, parameters: Any, at: Place, axes: bool) -> Mapping[str, Any]:
    from dsd_cli.effects import catalogue, find_effect  # late: brings numpy, and most commands have it by then

    effect = find_effect(name)
    if effect is None:
        unknown = at.unknown(name, catalogue(), what="effect")
        own = 'your own is read with --effects-from FILE.py, or [effects] from = ["FILE.py"]'
        raise UsageError(
            unknown.message, f"{unknown.hint}; {own}" if "did you" in unknown.hint else f"{own}; {unknown.hint}"
        )
    here = at.child(name)
    if not isinstance(parameters, Mapping):
        raise here.wrong(parameters, f"a table, written [{here.path}]")
    specs = {p.name: p for p in effect.parameters}
    values = {}
    for parameter, value in parameters.items():
        if parameter not in specs:
            raise here.unknown(parameter, specs, what="parameter")
        spec = specs[parameter]
        if spec.listed:
            if axes:
                raise here.child(parameter).wrong(value, "left out: a list of tables cannot be an axis of the grid")
            values[parameter] = _read_pulses(value, here.child(parameter))
            continue
        if spec.data:
            if axes:
                raise here.child(parameter).wrong(value, "left out: a table cannot be an axis of the grid")
            values[parameter] = _read_data(value, here.child(parameter))
            continue
        rule = number(lower=float(spec.lower), upper=float(spec.upper))
        values[parameter] = (axis(rule) if axes else rule).read(value, here.child(parameter))
    return MappingProxyType(values)


def _read_data(value: Any, at: Place) -> Any:
    """A word, or numbers in a list or in lists; what it must be the effect says."""
    if isinstance(value, list | tuple):
        return tuple(_read_data(one, at.item(i)) for i, one in enumerate(value))
    return value if isinstance(value, str) else number().read(value, at)


def _read_pulses(value: Any, at: Place) -> tuple[Mapping[str, float], ...]:
    """A list of { start, end, force }, each a finite number, start before end."""
    form = "a list of tables such as { start = 1.0, end = 1.2, force = 0.5 }"
    if not isinstance(value, list | tuple):
        raise at.wrong(value, form)
    return tuple(_read_pulse(entry, at.item(index), form) for index, entry in enumerate(value))


def _read_pulse(value: Any, at: Place, form: str) -> Mapping[str, float]:
    if not isinstance(value, Mapping):
        raise at.wrong(value, form.removeprefix("a list of ").replace("tables", "a table"))
    for name in value:
        if name not in _PULSE:
            raise at.unknown(name, _PULSE)
    for name, meaning in _PULSE.items():
        if name not in value:
            raise at.missing(name, meaning)
    pulse = {name: number().read(value[name], at.child(name)) for name in _PULSE}
    if not pulse["start"] < pulse["end"]:
        raise at.child("end").wrong(value["end"], f"after start = {pulse['start']:g}")
    return MappingProxyType(pulse)


def check_complete(values: EffectValues, at: Place, believed: EffectValues = NONE) -> None:
    """Every effect has all its parameters, here or in `believed`.

    Raises
    ------
    UsageError : names what is missing of the first effect that lacks something.
    """
    if not values:
        return
    from dsd_cli.effects import get_effect

    for name, given in values.items():
        known = {*given, *believed.get(name, {})}
        lacking = [p for p in get_effect(name).parameters if not (p.optional or p.name in known)]
        if lacking:
            first, *more = (p.name for p in lacking)
            wanted = [f"{p.name}: {_wanted(p)}" if more else _wanted(p) for p in lacking]
            raise at.child(name).missing(first, "; ".join(wanted), *more)


def _wanted(parameter: Parameter) -> str:
    bounds = f", at least {parameter.lower:g}" if parameter.lower > -math.inf else ""
    return f"{parameter.meaning}{bounds}"
