"""Tiers of what loggers do to the logs of the other tiers: values written again until the next comes, filtered speeds,
stamps of another clock.

u stays as it acted; what a sensor said stands in the row in which it came, and again in those after it.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from tests.oracle import tiers_axes, tiers_rig
from tests.oracle.questions import Question, Tier
from tests.oracle.rig_cases import Array

Rng = np.random.Generator
Channels = dict[str, Array]

#: Tiers whose logs are taken, one after the other.
FROM = (
    *("speed and 40,000 counts", "geared joint", "point to point", "nothing missing, speed"),
    *("speed loop", "4096 counts", "nothing missing, 4096 counts"),
)
#: Rows that a value stays, about, and those over which a drive averages its speed.
STAYS, AVERAGED = 5, 20


def written_again(x: Array, comes: Array) -> Array:
    """The value of the last row in which one came; comes : shape (n,), True where it does."""
    return x[np.maximum.accumulate(np.where(comes, np.arange(x.size), 0))]


def evenly(rng: Rng, rows: int) -> Array:
    comes = np.zeros(rows, dtype=bool)
    comes[0] = True
    comes[int(rng.integers(STAYS)) :: STAYS] = True
    return comes


def unevenly(rng: Rng, rows: int) -> Array:
    """Three to seven rows."""
    at = np.cumsum(rng.integers(STAYS - 2, STAYS + 3, size=rows))
    comes = np.zeros(rows, dtype=bool)
    comes[0] = True
    comes[at[at < rows]] = True
    return comes


def _together(channels: Channels, rng: Rng, pace: Callable[[Rng, int], Array]) -> Channels:
    comes = pace(rng, channels["u"].size)
    return {name: written_again(channels[name], comes) for name in ("position", "velocity") if name in channels}


def _in_turn(channels: Channels, rng: Rng) -> Channels:
    """Position and speed come in different rows."""
    rows = channels["u"].size
    names = [name for name in ("position", "velocity") if name in channels]
    return {name: written_again(channels[name], evenly(rng, rows)) for name in names}


def _averaged(channels: Channels, rng: Rng) -> Channels:
    if "velocity" not in channels:
        return {}
    v = channels["velocity"]
    padded = np.concatenate([np.full(AVERAGED - 1, v[0]), v])
    return {"velocity": np.convolve(padded, np.full(AVERAGED, 1.0 / AVERAGED), "valid")}


def _by_a_pc(channels: Channels, rng: Rng) -> Channels:
    """Even samples that a computer stamps when they arrive, late by 0.4 of a sample (a half normal)."""
    t = channels["t"]
    late = 0.4 * float(np.median(np.diff(t))) * np.abs(rng.standard_normal(t.size))
    return {"t": np.sort(t + late)}


def _differenced(channels: Channels, rng: Rng) -> Channels:
    """A drive that takes its speed as the difference of its encoder's counts, and logs no position."""
    q, t = channels["position"], channels["t"]
    return {"velocity": np.diff(q, prepend=q[:1]) / float(np.median(np.diff(t)))}


def _logged(seed: int, how: Callable[[Channels, Rng], Channels], without: str = "") -> Question:
    base = {tier.name: tier for tier in (*tiers_rig.tiers(), *tiers_axes.tiers())}
    question = base[FROM[seed % len(FROM)]].draw(seed)
    spoiled = how(dict(question.channels), np.random.default_rng([seed, 20261126]))
    channels = {name: x for name, x in {**question.channels, **spoiled}.items() if name != without}
    # over a position without a zero what is believed of places is wrong as well
    also = tuple(set(question.believed["effects"]) & {"gravity", "cogging", "stiffness"}) if without else ()
    return replace(question, channels=channels, also=(*question.also, *also))


def tiers() -> list[Tier]:
    """All of them."""
    ways: dict[str, Callable[[Channels, Rng], Channels]] = {
        "sensors read in every fifth row": partial(_together, pace=evenly),
        "sensors read unevenly": partial(_together, pace=unevenly),
        "position and speed in turn": _in_turn,
        "speed averaged over 20 rows": _averaged,
        "stamped on arrival": _by_a_pc,
    }
    found = [Tier(name, partial(_logged, how=how), 0.5) for name, how in ways.items()]
    return [*found, Tier("speed by differences of counts", partial(_logged, how=_differenced, without="position"), 0.5)]
