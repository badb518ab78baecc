"""Results of identification with the user's names of units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from dsd_cli.identify.results import Addition, Candidate, Diagnosis, Estimate, Ladder, LogLevels, Step
from dsd_cli.signals.units import PER_UNIT, Units


def in_units(result: Any, units: Units) -> Any:
    """A result whose estimates are in the user's units by name; numbers stay as they are (SI, u as it is)."""
    if isinstance(result, Estimate):
        return replace(result, unit=units.words(result.unit))
    if isinstance(result, Mapping):
        return {name: in_units(value, units) for name, value in result.items()}
    if isinstance(result, tuple):
        return tuple(in_units(value, units) for value in result)
    if isinstance(result, Units):
        return units
    if isinstance(result, Diagnosis) and units.is_force and PER_UNIT in result.advice:
        result = replace(result, advice=tuple(line for line in result.advice if line != PER_UNIT))
    if isinstance(result, Diagnosis | Candidate | Addition | Step | Ladder | LogLevels):
        held = {f.name: getattr(result, f.name) for f in fields(result)}
        return replace(result, **{name: in_units(x, units) for name, x in held.items() if name in _WITH_UNITS})
    return result


#: Fields of results in which there are estimates.
_WITH_UNITS = {
    *("parameters", "all_values", "ranking", "estimates", "refitted_values", "whole_values", "units"),
    *("steps", "last", "values", "levels"),
}
