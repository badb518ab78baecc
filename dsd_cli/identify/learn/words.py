"""Laws in words."""

from __future__ import annotations

from collections.abc import Sequence

from dsd_cli.identify.learn.families import ACCELERATION, INERTIA_OVER_TIME, MEMORY, TIME, Family


def of_several(families: Sequence[Family]) -> str:
    """Their names, joined."""
    return " and ".join(family.name for family in families)


#: Channel -> the motion that shows what depends on it.
_SHOWS = {
    "velocity": "constant speeds, slow and fast, both ways, over the same places",
    "position": "the same speed at different places of the travel",
    "direction": "the same places passed forward and backward",
    "u": "the same motion under two different loads",
    TIME: "the same motion early and late",
    ACCELERATION: "the same place passed with strong and with little acceleration",
    MEMORY: "turns of different width around one place, slow and fast",
}


def separating(one: Family, other: Family) -> str:
    """The motion that would separate two laws."""
    if other is INERTIA_OVER_TIME:
        return "a load held, or a crawl, early and late: a gain changes the u of this, an inertia does not"
    apart = [name for name in _SHOWS if (name in one.on) != (name in other.on)]
    return "; ".join(_SHOWS[name] for name in apart) or _SHOWS["velocity"]
