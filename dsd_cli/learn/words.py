"""Laws in words."""

from __future__ import annotations

from dsd_cli.effects.lagging import LAGGED
from dsd_cli.learn.curves import coefficients, parts
from dsd_cli.learn.families import ACCELERATION, DIRECTION, INERTIA_OVER_TIME, MEMORY, TIME, Family
from dsd_cli.learn.judge import LawFit

#: Friction behind lags of sgn v whose levels are below 0: most right after a turn.
_FALLS = "friction that falls off over time after each turn"


def of_laws(fit: LawFit) -> str:
    """Their names, joined; the levels of friction that acts late say which way it goes after a turn."""
    theta, names = coefficients(fit), list[str]()
    for law, at in parts(fit):
        late = law.family.effect is LAGGED and law.family.factor == DIRECTION
        names.append(_FALLS if late and theta[at].sum() < 0.0 else law.family.name)
    return " and ".join(names)


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
