"""Units of the values of a model, by their names."""

from __future__ import annotations

from collections.abc import Iterable

from dsd_cli.signals.units import Units

#: Of the values that every model has.
_OWN = {"delay": "s", "inertia": "{u}/({v}/s)"}


def units_of(names: Iterable[str], units: Units) -> dict[str, str]:
    """Unit of each value ("inertia", "delay" or "<effect>.<parameter>"), in the user's words where he named them."""
    return {name: units.words(_OWN[name] if name in _OWN else _of_effect(name)) for name in names}


def _of_effect(name: str) -> str:
    from dsd_cli.effects import get_effect  # late: most labels are of delay and inertia alone

    effect, _, parameter = name.partition(".")
    return next((p.unit for p in get_effect(effect).parameters if p.name == parameter), "")
