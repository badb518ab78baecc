"""Which line of one model is which of another: by their periods, for their numbers only say in what order they came."""

from __future__ import annotations

import math
from collections.abc import Mapping

from dsd_cli.effects import free_name, get_effect, kind_of
from dsd_cli.plant.model import PlantModel

#: Periods (or frequencies) of one line in two models differ by no more than this share.
_NEAR = 0.02


def paired(first: PlantModel, second: PlantModel) -> dict[str, str]:
    """Effect of the second model -> the name under which it stands beside the first one's, where that is another."""
    names: dict[str, str] = {}
    for kind in dict.fromkeys(kind_of(name) for name in second.effects):
        if get_effect(kind).periods is None:
            continue
        one, other = (_lines(model, kind) for model in (first, second))
        pairs = sorted((abs(math.log(y / x)), a, b) for a, x in one.items() for b, y in other.items())
        taken: dict[str, str] = {}
        for off, a, b in pairs:
            if off < _NEAR and a not in taken.values() and b not in taken:
                taken[b] = a
        for b in other:
            if b not in taken:
                taken[b] = b if b not in {*one, *taken.values()} else free_name(kind, {*one, *other, *taken.values()})
        names |= taken
    return {b: a for b, a in names.items() if a != b}


def renamed(values: Mapping[str, float], names: Mapping[str, str]) -> dict[str, float]:
    """Values by "<effect>.<parameter>" under the other names."""
    found = {}
    for name, value in values.items():
        effect, dot, parameter = name.partition(".")
        found[f"{names.get(effect, effect)}{dot}{parameter}"] = value
    return found


def _lines(model: PlantModel, kind: str) -> dict[str, float]:
    """Effect of that kind -> how many periods it has, per what its unit says."""
    shape = next(p.name for p in get_effect(kind).parameters if not p.linear)
    found = {name: float(x[shape]) for name, x in model.effects.items() if kind_of(name) == kind}
    return {name: value for name, value in found.items() if value > 0.0}
