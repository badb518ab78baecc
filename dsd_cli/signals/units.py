"""The units of the channels in words: {u}, {v} and {q} of `Parameter.unit` and `Estimate.unit`."""

from __future__ import annotations

_WORDS = {"({v})": "v", "({q})": "q", "{u}": "u", "{v}": "v", "{q}": "q"}

#: What the words mean; for the foot of a table.
LEGEND = "Units: u is the unit of the control input; v is rad/s or m/s; q is rad or m."


def in_words(unit: str) -> str:
    """`{u}/({v})` -> `u/v`; whatever else is in it stays."""
    for placeholder, word in _WORDS.items():
        unit = unit.replace(placeholder, word)
    return unit
