"""A formula as tables of general effects, so that a config has it without a file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from dsd_cli.effects import Channels, Effect, Values, free_name
from dsd_cli.effects.general import CURVE, FRICTION_CURVE, INERTIA_CURVE, Moved
from dsd_cli.effects.tables import Table
from dsd_cli.learn.dictionary import effect_of
from dsd_cli.learn.families import samples_of
from dsd_cli.learn.formula import Term
from dsd_cli.learn.rows import Balance
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.log import Array

#: Knots of a table over what the log visited; shares of its span by which the formula goes on at either end: another
#: motion may be several times as fast, and driven as much harder, but the travel of an axis is as long as it is.
_KNOTS, _FURTHER = 201, {"velocity": 1.0, "u": 1.0, "position": 0.5}
#: Of the way to the pole of a formula, as far as which it goes on: its force is four times as high there.
_TO_POLE = 0.5
#: Letter of a channel -> that of a table.
_OVER = {"v": "velocity", "q": "position", "u": "u", "t": "time"}
#: Base -> effect and factor of its table, and the channel that it stands over by itself; beyond its ends a gain of u
#: that differs by its sign is held as a gain.
_TABLES: dict[str, tuple[Effect, str, str]] = {
    "dry": (FRICTION_CURVE, "one", "velocity"),
    "load": (FRICTION_CURVE, "u", "u"),
    "viscous": (CURVE, "velocity", "velocity"),
    "force": (CURVE, "one", "position"),
    "drag": (CURVE, "one", "velocity"),
    "root": (CURVE, "one", "velocity"),
    "asymmetry": (CURVE, "one", "velocity"),
    "spring": (CURVE, "one", "position"),
    "square": (CURVE, "one", "position"),
    "cubic": (CURVE, "one", "position"),
    "gain": (CURVE, "u", "u"),
    "size": (CURVE, "u", "u"),
    "inertia": (INERTIA_CURVE, "one", "position"),
}


def tables_of(
    terms: Sequence[Term], strengths: Sequence[Array], model: PlantModel, balance: Balance
) -> dict[str, Values]:
    """Name in the model -> values of a table, for every term with these coefficients."""
    found: dict[str, Values] = {}
    for term, strength in zip(terms, strengths, strict=True):
        effect, factor, own = _TABLES[term.kind.base]
        over = _OVER.get(term.kind.over, own)
        name = free_name(effect.id, {*model.effects, *found})
        x = samples_of(over, balance)
        table = _table(term, strength, (over, factor), x, _ends(term, over, x))
        if effect is INERTIA_CURVE and balance.inertia + min(table.values) <= 0.0:  # no inertia is negative
            table = _table(term, strength, (over, factor), x, (float(x.min()), float(x.max())))
        found[name] = effect.from_columns((1.0,), {"table": table})
    return found


def _table(term: Term, strength: Array, kind: tuple[str, str], x: Array, ends: tuple[float, float]) -> Table:
    """The law at knots between these ends, as dense as over what was visited (`x`), and at 0, where it may bend."""
    (over, factor), (low, high) = kind, ends
    count = round(_KNOTS * (high - low) / float(np.ptp(x))) if over == "position" else _KNOTS
    knots = np.linspace(low, high, count)
    if over in ("velocity", "u") and low < 0.0 < high:  # squares: closer where roots and signs bend
        roots = np.linspace(-math.sqrt(-low), math.sqrt(high), count)
        knots = roots * np.abs(roots)
        knots[int(np.argmin(np.abs(knots)))] = 0.0
    still = np.zeros(count)
    at = {"velocity": still + 1.0, "position": still, "u": still + 1.0, "time": still} | {over: knots}
    channels = Channels(at["time"], at["u"], at["velocity"], at["position"], still)
    values = strength @ np.stack(_columns(term, channels))
    if factor != "one":  # the table is what stands before the factor
        values = values / np.where(at[factor] != 0.0, at[factor], np.nan)
        values = np.interp(knots, knots[np.isfinite(values)], values[np.isfinite(values)])
    seen = ((float(x.min()), float(x.max())),)
    return Table((over,), (tuple(map(float, knots)),), tuple(map(float, values)), factor, seen)


def _ends(term: Term, over: str, x: Array) -> tuple[float, float]:
    """Where the table of a formula begins and ends: beyond what was visited by `_FURTHER`, short of a pole."""
    low, high = float(x.min()), float(x.max())
    more = [_FURTHER.get(over, 0.0) * (high - low)] * 2
    if term.kind.modulation == "inverse":
        place = term.values["place"]
        side = 0 if place < low else 1
        more[side] = min(more[side], _TO_POLE * abs(place - (low, high)[side]))
    return low - more[0], high + more[1]


def _columns(term: Term, channels: Channels) -> list[Array]:
    """Of a force, or what is added to an inertia: its column where the axis accelerates by 1 at rest."""
    effect = effect_of(term.kind)
    if term.kind.base != "inertia":
        return [np.broadcast_to(c, len(channels.t)) for c in effect.columns(channels, term.values)]
    still = channels._replace(velocity=np.zeros(len(channels.t)))
    return [-c for c in effect.columns(still, term.values, Moved(0.0, 0.0, 1.0))[0]]


def strengths_of(estimates: Sequence[Mapping[str, float]]) -> list[Array]:
    """Coefficients of the columns of each term."""
    return [
        np.array([one["coefficient"]])
        if "coefficient" in one
        else one["amplitude"] * np.array([math.cos(one["phase"]), math.sin(one["phase"])])
        for one in estimates
    ]
