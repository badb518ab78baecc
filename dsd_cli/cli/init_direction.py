"""The u that has a direction, beside a current that has none."""

from __future__ import annotations

import numpy as np

from dsd_cli.files.first_look import FirstLook
from dsd_cli.files.recognise import Recognised, is_current, is_voltage, unit_in
from dsd_cli.files.sample import Table
from dsd_cli.signals.log import Array

#: What goes both ways does so by more than this share of its largest; a current without direction comes down to that.
BOTH_WAYS = 0.01
#: From this correlation on it follows the size of a voltage, or of another current.
FOLLOWS = 0.5


def _both_ways(x: Array) -> bool:
    return bool(min(-np.nanmin(x), np.nanmax(x)) > BOTH_WAYS * np.nanmax(np.abs(x)))


def with_direction(look: FirstLook, table: Table) -> Recognised | None:
    """The voltage or current that is u where this current has no direction, as a supply's or a size; None: nothing
    shows that."""
    values = {one.name: one.values for one in table.channels if one.values is not None}
    u, motion = look.found["u"], next((look.found[one] for one in ("velocity", "position") if one in look.found), None)
    if motion is None or not is_current(u.column, u.unit) or not {u.column, motion.column} <= values.keys():
        return None
    x, moved = values[u.column], values[motion.column]
    speed = moved if motion.channel == "velocity" else np.diff(moved)
    if not 0.0 <= np.nanmin(x) < BOTH_WAYS * np.nanmax(x) or not _both_ways(speed):
        return None
    alike: dict[str, float] = {}
    for name in u.others:
        y = values.get(name)
        drives = is_current(name, look.units[name]) or is_voltage(name, look.units[name])
        if y is None or not drives or not _both_ways(y):
            continue
        both = np.isfinite(x) & np.isfinite(y)
        alike[name] = float(np.corrcoef(x[both], np.abs(y[both]))[0, 1])
    best = max(alike, key=alike.__getitem__, default="")
    if not alike.get(best, 0.0) > FOLLOWS:
        return None
    return Recognised("u", best, look.units[best] or unit_in(best, "u"), (u.column,))
