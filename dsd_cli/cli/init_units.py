"""The units of a motion that its log does not say, from how much its velocity is of its position's slope."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dsd_cli.files.recognise import Recognised
from dsd_cli.files.sample import Table
from dsd_cli.signals.facts import slope_of
from dsd_cli.signals.units import POSITION, VELOCITY

#: The velocity is the slope of the position from this share of its square on; two scales nearer than that are the same.
FITS, NEAR = 0.9, 0.03
#: Rows that are looked at.
ROWS = 60_000


class Units(NamedTuple):
    """Keys of [signals] for units or scales, and why."""

    keys: dict[str, str | float]
    why: str = ""


def units_of(
    table: Table | None, found: Mapping[str, Recognised], seconds: float, step: float | None, counted: float = 1.0
) -> Units:
    """What makes the velocity the slope of the position; nothing where both units are said, or nothing can be.

    Parameters
    ----------
    seconds : s per unit of the time column. step : s between rows without one. counted : rad or m per count, where the
        position is in counts of which the user said how many there are.
    """
    p, w = found.get("position"), found.get("velocity")
    if table is None or p is None or (w is not None and w.of_kind and p.of_kind and w.of_kind[0] == p.of_kind[0]):
        return Units({})
    scale = None if w is None else _scale(table, found, seconds, step)
    if w is not None and w.of_kind and p.of_kind:  # the motor turns and its slide moves: the screw is in the factor
        return Units({}) if scale is None else _scaled(w, p, w.of_kind[1] * scale, scale)
    turned = "" if p.unit or (w is not None and w.of_kind) else _turned(table, p.column)
    if turned:
        why = f'"{p.column}" jumps by a turn of {TURNS[turned]:g}'
        beside = Units({}) if scale is None or w is None else _from_one(replace(p, unit=turned), w, scale)
        return Units({"position_unit": turned, **beside.keys}, f"{why}; {beside.why}" if beside.why else why)
    if scale is None or w is None:
        return Units({})
    if p.of_kind or w.of_kind:
        return _from_one(p, w, scale)
    if near(scale, 1.0):
        return Units({})
    if counted != 1.0:
        why = (
            f'"{w.column}" is {scale:.4g} times the slope of "{p.column}" per s: its factor follows that of the counts'
        )
        return Units({"velocity_scale": float(f"{counted / scale:.6g}")}, why)
    for of_p, of_w in _PAIRS:
        if near(scale, POSITION[of_p][1] / VELOCITY[of_w][1]):
            why = f'"{w.column}" is {scale:.4g} times the slope of "{p.column}": {of_p} and {of_w}, if nobody says more'
            return Units({"position_unit": of_p, "velocity_unit": of_w}, why)
    why = f'"{w.column}" is {scale:.4g} times the slope of "{p.column}" per s; taken as rad or m, the velocity follows'
    return Units({"velocity_scale": float(f"{1.0 / scale:.6g}")}, why)


#: Unit of a position -> a turn in it.
TURNS = {"deg": 360.0, "rad": 2.0 * np.pi}


def _turned(table: Table, column: str) -> str:
    """The unit in which a position jumps by a turn and is never more than one from zero; "": it does not."""
    values = next((one.values for one in table.channels if one.name == column), None)
    q = np.zeros(1) if values is None else values[np.isfinite(values)]
    steps = np.abs(np.diff(q))
    for unit, turn in TURNS.items():
        jumps = steps[steps > 0.5 * turn]
        usual = float(np.max(steps, where=steps <= 0.5 * turn, initial=0.0))
        if jumps.size and np.abs(jumps - turn).max() <= 2.0 * usual < 0.5 * turn and np.abs(q).max() <= turn + usual:
            return unit
    return ""


#: Units that are tried where none is said; a factor of 1000 may be mm and m/s as well as um and mm/s, and says nothing.
_PAIRS = (
    ("rad", "deg/s"),
    ("deg", "rad/s"),
    ("turn", "rad/s"),
    ("rad", "turn/s"),
    ("rad", "rpm"),
    ("turn", "rpm"),
    ("deg", "rpm"),
)


def step_of(table: Table | None, found: Mapping[str, Recognised]) -> tuple[float, bool] | None:
    """s between rows that make the velocity the slope of the position, and whether the units of both are said.

    None: the one is not the slope of the other, or only the unit of one is said.
    """
    p, w = found.get("position"), found.get("velocity")
    if table is None or p is None or w is None or bool(p.named) != bool(w.named):
        return None
    scale = _scale(table, found, 1.0, 1.0)
    if scale is None or scale <= 0.0:
        return None
    if not p.named:
        return float(f"{1.0 / scale:.4g}"), False
    (of_p, position), (of_w, velocity) = POSITION[p.named], VELOCITY[w.named]
    return (float(f"{position / (velocity * scale):.4g}"), True) if of_p == of_w else None


def _from_one(p: Recognised, w: Recognised, scale: float) -> Units:
    """The unit of one from that of the other."""
    said = p.of_kind or w.of_kind
    assert said is not None
    kind, known = said
    what = f'"{w.column}" is {scale:.4g} times the slope of "{p.column}"'
    if p.of_kind:
        fits = [name for name, (of, f) in VELOCITY.items() if of == kind and near(scale, known / f)]
        if fits:
            return Units({"velocity_unit": fits[0]}, f"{what}: it is in {fits[0]}")
        return Units({"velocity_scale": float(f"{known / scale:.6g}")}, f"{what}, which makes this its factor")
    fits = [name for name, (of, f) in POSITION.items() if of == kind and near(scale, f / known)]
    if fits:
        return Units({"position_unit": fits[0]}, f"{what}: that is in {fits[0]}")
    return _scaled(w, p, known * scale, scale)


def _scaled(w: Recognised, p: Recognised, factor: float, scale: float) -> Units:
    """The position in what the velocity is the slope of."""
    what = f'"{w.column}" is {scale:.4g} times the slope of "{p.column}"'
    return Units({"position_scale": float(f"{factor:.6g}")}, f"{what}, which makes this its factor")


def near(scale: float, other: float) -> bool:
    return abs(scale / other - 1.0) < NEAR


def _scale(table: Table, found: Mapping[str, Recognised], seconds: float, step: float | None) -> float | None:
    """The velocity over the slope of the position, per s; None: it is not its slope."""
    values = {one.name: one.values for one in table.channels if one.values is not None}
    p, w = (values.get(found[role].column) for role in ("position", "velocity"))
    if p is None or w is None:
        return None
    stamps = values.get(found["time"].column) if "time" in found else None
    t = np.asarray(np.arange(p.size) * (step or 1.0) if stamps is None else stamps * seconds, dtype=np.float64)
    rows = np.flatnonzero(np.isfinite(p) & np.isfinite(w) & np.isfinite(t))[:ROWS]
    rows = rows[np.diff(t[rows], prepend=t[rows[:1]] - 1.0) > 0.0]
    if rows.size < 50:
        return None
    slope = slope_of(t[rows], p[rows], w[rows])
    return slope.scale if slope.share > FITS else None
