"""Laws of any form, which `dsd learn` writes: a table over channels, and hysteresis as a sum of stops.

They are no candidates of a search, for they explain anything; a model has them by their name, further ones as
`curve_2`, `curve_3`, ... What a fit finds anew is their scale, 1 as learnt.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from dsd_cli.effects.base import Channels, Effect, Parameter, Ranges, Role, Shape, Values
from dsd_cli.effects.joint_terms import JointTerms, Ramps, Stop, speed_dependent
from dsd_cli.effects.lagging import LAGGED
from dsd_cli.effects.memory import COMPILED
from dsd_cli.effects.one_state import BOUC_WEN, LUGRE
from dsd_cli.effects.tables import Table, numbers_of, table_of, values_of
from dsd_cli.errors import UsageError
from dsd_cli.signals.log import Array

_CHANNELS = Parameter("channels", "", "one or two of velocity, speed, position, u, time", data=True, linear=False)
_KNOTS = Parameter("knots", "", "a list of increasing numbers for each channel, in its unit", data=True, linear=False)
_VALUES = Parameter("values", "{u}", "the law at the knots; with two channels a row per knot of the first",
                    data=True, linear=False)  # fmt: skip
_FACTOR = Parameter("factor", "", "what the table is multiplied by: one, velocity or u", data=True, linear=False)
_SEEN = Parameter("seen", "", "for each channel the ends of what the law was learnt from, where the knots go on beyond",
                  data=True, linear=False, optional=True)  # fmt: skip
_SCALE = Parameter("scale", "", "what a fit multiplies it by; 1 as learnt")


def _split(effect: str) -> Callable[[Values, float], tuple[tuple[float, ...], Shape]]:
    def split(values: Values, _: float) -> tuple[tuple[float, ...], Shape]:
        return (float(values.get("scale", 1.0)),), {"table": table_of(values, effect)}

    return split


def _join(coefficients: tuple[float, ...], shape: Shape, _: float) -> Values:
    return values_of(shape["table"], coefficients[0])


def _needs(values: Values) -> tuple[str, ...]:
    over = (*values["channels"], values.get("factor", "one"))
    speed = ("velocity",) if {"velocity", "speed"} & set(over) else ()
    return (*speed, *(name for name in ("position", "u") if name in over))


def _needs_of_friction(values: Values) -> tuple[str, ...]:
    """Its direction is that of the speed."""
    return tuple(dict.fromkeys(("velocity", *_needs(values))))


def _columns(channels: Channels, shape: Shape) -> tuple[Any, ...]:
    return (shape["table"](channels),)


def _never(_: Ranges) -> bool:
    return False


def _in_a_joint(values: Values, _: float) -> JointTerms:
    """A force over the velocity, the speed or the position; of two channels or a factor a joint knows nothing."""
    table = _scaled_table(values, CURVE.id)
    over = table.channels[0]
    if len(table.channels) > 1 or table.factor != "one" or over not in ("velocity", "speed", "position"):
        return JointTerms(missing=f"force over {' and '.join(table.channels)}")
    knots, levels = table.knots[0], table.values
    if over == "speed":
        speeds, at = _from_standstill(table)
        knots, levels = (*(-v for v in speeds[:0:-1]), *speeds), (*at[:0:-1], *at)
    return JointTerms(ramps=(Ramps("position" if over == "position" else "velocity", knots, levels),))


def _table_values(ramps: Ramps) -> Values:
    return {"channels": [ramps.over], "knots": [list(ramps.knots)], "values": list(ramps.values), "factor": "one",
            "scale": 1.0}  # fmt: skip


def _friction_in_a_joint(values: Values, _: float) -> JointTerms:
    table = _scaled_table(values, FRICTION_CURVE.id)
    if table.channels != ("speed",) or table.factor != "one":
        return JointTerms(missing=f"dry friction over {' and '.join(table.channels)}")
    return speed_dependent(*_from_standstill(table))


def _scaled_table(values: Values, effect: str) -> Table:
    table = table_of(values, effect)
    return table.holding(float(values.get("scale", 1.0)) * np.ravel(table.values))


def _from_standstill(table: Table) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """(speeds from 0 on, the table there)."""
    speeds = (0.0, *(v for v in table.knots[0] if v > 0.0))
    return speeds, tuple(np.interp(speeds, table.knots[0], table.values).tolist())


def _tabled(name: str, role: Role, law: str, summary: str, needs: tuple[str, ...], **others: Any) -> Effect:
    found = {
        "columns": _columns,
        "parameters": (_CHANNELS, _KNOTS, _VALUES, _FACTOR, _SCALE, _SEEN),
        "needs_of": _needs,
        **others,
    }
    return Effect(
        id=name,
        role=role,
        law=law,
        summary=summary,
        pattern="the residual is a function of these channels that no other effect has",
        needs=needs,
        starts=lambda _: [],
        split=_split(name),
        join=_join,
        repeats=_never,
        rarity=9,
        **found,
    )


CURVE = _tabled(
    "curve",
    Role.APPLIED,
    "f(channels), a table; times v or u",
    "A force that a table gives over one channel or two, as `dsd learn` finds it; beyond the knots it is held.",
    ("velocity", "u"),
    joint=_in_a_joint,
    of_joint=lambda terms, _: [_table_values(ramps) for ramps in terms.ramps],
)

FRICTION_CURVE = _tabled(
    "friction_curve",
    Role.FRICTION,
    "-f(channels) sgn v, a table; sticking at rest",
    "Dry friction whose level a table gives over velocity, position, u or time, as `dsd learn` finds it.",
    ("velocity", "u"),
    needs_of=_needs_of_friction,
    joint=_friction_in_a_joint,
)


class Moved(NamedTuple):
    """Speed and length of the last interval, and the acceleration that it had."""

    velocity: float
    interval: float
    acceleration: float


def inertia_columns(
    channels: Channels, more: Sequence[Any], slopes: Sequence[Any], state: Moved | None
) -> tuple[tuple[Any, ...], Moved]:
    """-(D a + D' v^2 / 2) for every D of `more` with its slope over the position; a is from the speeds of this interval
    and of that before.

    An interval of 0 is this instant: the acceleration is the last one, and nothing moves.
    """
    v, interval = channels.velocity, channels.interval
    first = v if np.ndim(v) == 0 else float(v[0]) if len(v) else 0.0
    before = state or Moved(first, 0.0, 0.0)
    if np.ndim(v) == 0:
        between = 0.5 * (interval + before.interval)
        a = (v - before.velocity) / between if interval > 0.0 and between > 0.0 else before.acceleration
        last = Moved(v, interval, a) if interval > 0.0 else before
    else:
        intervals = np.broadcast_to(interval, np.shape(v))
        between = 0.5 * (intervals + np.concatenate([[before.interval], intervals[:-1]]))
        change = np.diff(v, prepend=before.velocity)
        a = np.where(between > 0.0, change / np.where(between > 0.0, between, 1.0), before.acceleration)
        last = Moved(float(v[-1]), float(intervals[-1]), float(a[-1])) if len(v) else before
    a = a if channels.acceleration is None else channels.acceleration
    return tuple(-(d * a + 0.5 * slope * v * v) for d, slope in zip(more, slopes, strict=True)), last


def _inertia_columns(channels: Channels, shape: Shape, state: Moved | None) -> tuple[tuple[Any, ...], Moved]:
    table = shape["table"]
    return inertia_columns(channels, (table(channels),), (table.slope(channels.position),), state)


INERTIA_CURVE = _tabled(
    "inertia_curve",
    Role.APPLIED,
    "-(D(q) a + D'(q) v^2/2), D a table",
    "An inertia that changes over the position by what a table gives, as `dsd learn` finds it.",
    ("velocity", "position"),
    columns=_inertia_columns,
    memory=True,
    joint=lambda _, __: JointTerms(missing="inertia that changes over the position"),
    parameters=(
        _CHANNELS,
        _KNOTS,
        Parameter("values", "{u}/({v}/s)", "what the inertia has more there", data=True, linear=False),
        _FACTOR,
        _SCALE,
        _SEEN,
    ),
)


@dataclass(frozen=True)
class Stops:
    """Springs that slip (Maxwell slip, Prandtl-Ishlinskii): each holds up to its radius, then it is dragged along.

    radii : rad or m, above 0. stiffnesses : unit of u per rad or m.
    """

    radii: tuple[float, ...]
    stiffnesses: tuple[float, ...]

    def unit(self, i: int) -> Stops:
        """The same with stiffness 1 / radius of stop i alone: it holds up to 1."""
        stiffnesses = [0.0] * len(self.radii)
        stiffnesses[i] = 1.0 / self.radii[i]
        return Stops(self.radii, tuple(stiffnesses))


def stretches(moved: Array, radius: float, before: float, compiled: Any = COMPILED) -> Array:
    """z_k = clip(z_(k-1) + moved_k, -radius, radius), shape (n,): how far a spring that slips is stretched."""
    out = np.empty(len(moved))
    if compiled is not None:
        compiled.slip(np.ascontiguousarray(moved), radius, before, out)
        return out
    z = before
    for k, step in enumerate(moved.tolist()):
        z += step
        z = radius if z > radius else -radius if z < -radius else z
        out[k] = z
    return out


def _slip_columns(
    channels: Channels, shape: Shape, state: tuple[float, ...] | None
) -> tuple[tuple[Any, ...], tuple[float, ...]]:
    """Minus the mean force of the springs over the interval; state: how far each is stretched at its end."""
    stops, moved = shape["stops"], channels.velocity * channels.interval
    before = state or (0.0,) * len(stops.radii)
    total, last = 0.0 * moved, []
    for radius, stiffness, z in zip(stops.radii, stops.stiffnesses, before, strict=True):
        if stiffness == 0.0:
            last.append(z)
        elif np.ndim(moved) == 0:
            last.append(min(max(z + moved, -radius), radius))
            total = total - 0.5 * stiffness * (z + last[-1])
        else:
            ends = stretches(moved, radius, z)
            total = total - 0.5 * stiffness * (np.concatenate([[z], ends[:-1]]) + ends)
            last.append(float(ends[-1]) if len(ends) else z)
    return (total,), tuple(last)


def _stops_of(values: Mapping[str, Any], _: float) -> tuple[tuple[float, ...], Shape]:
    radii = numbers_of(values["radii"], "hysteresis.radii", "numbers above 0, rad or m", above=0.0)
    stiffnesses = numbers_of(values["stiffnesses"], "hysteresis.stiffnesses")
    if len(radii) != len(stiffnesses):
        raise UsageError("hysteresis.stiffnesses", f"must be {len(radii)} numbers, one for each radius")
    return (float(values.get("scale", 1.0)),), {"stops": Stops(radii, stiffnesses)}


def _stop_values(coefficients: tuple[float, ...], shape: Shape, _: float) -> Values:
    stops = shape["stops"]
    return {"radii": stops.radii, "stiffnesses": stops.stiffnesses, "scale": coefficients[0]}


def _slips_in_a_joint(values: Values, _: float) -> JointTerms:
    (scale,), shape = _stops_of(values, 1.0)
    stops = shape["stops"]
    return JointTerms(stops=tuple(Stop(r, scale * k) for r, k in zip(stops.radii, stops.stiffnesses, strict=True)))


def _stop_lists(stops: Sequence[Stop]) -> Values:
    return {"radii": [s.radius for s in stops], "stiffnesses": [s.stiffness for s in stops], "scale": 1.0}


HYSTERESIS = Effect(
    id="hysteresis",
    role=Role.APPLIED,
    law="-sum k_i z_i, z_i' = v while |z_i| < r_i",
    summary="Hysteresis over the position: springs that slip, as `dsd learn` finds them (Maxwell slip).",
    pattern="the residual over position runs in loops, which do not depend on how fast the axis moves",
    parameters=(
        Parameter("radii", "{q}", "the way after which each spring slips", data=True, linear=False),
        Parameter("stiffnesses", "{u}/({q})", "of each spring", data=True, linear=False),
        _SCALE,
    ),
    needs=("velocity",),
    columns=_slip_columns,
    starts=lambda _: [],
    split=_stops_of,
    join=_stop_values,
    memory=True,
    joint=_slips_in_a_joint,
    of_joint=lambda terms, _: [_stop_lists(terms.stops)] if terms.stops else [],
    repeats=_never,
    rarity=9,
)

#: All of them.
GENERAL = {effect.id: effect for effect in (CURVE, FRICTION_CURVE, INERTIA_CURVE, HYSTERESIS, LAGGED, BOUC_WEN, LUGRE)}
