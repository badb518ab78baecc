"""Tables, and what of them is looked at: usable channels; those in several tables, each with its clock, of which units
and names say what they are, as nothing else can be said."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from dsd_cli.files.first_look import FirstLook
from dsd_cli.files.joints import numbered_as, other_joints, other_trials
from dsd_cli.files.names_in import words_in
from dsd_cli.files.recognise import (
    Recognised,
    is_asked,
    is_force,
    is_motion,
    is_neither,
    is_voltage,
    recognise,
    role_of_unit,
    unit_in,
)
from dsd_cli.files.sample import Table
from dsd_cli.files.words import MEASURED, NAMED, OF_ENCODER, PLACES, quaternions, whole_unit
from dsd_cli.signals.facts import Channel, facts_of

#: How evenly a clock rises that has another name.
EVEN = 1e-3


def is_part(table: Table, other: Table) -> bool:
    """Whether a table is one of the tests that another has one after the other."""
    names = {one.name for one in other.channels}
    return bool(table.name and not other.name) and names >= {
        one.name.removeprefix(f"{table.name}/") for one in table.channels
    }


#: Share of itself that a supply's voltage keeps, which never changes its sign.
_SAGS = 0.75


def usable(table: Table, given: Collection[str] = ()) -> Table:
    """Without what never changes, is yes or no, or no number, supplies, and orientations in space, but for what is
    asked for; two levels may be a step or a relay, which are u."""
    turned = quaternions([one.name for one in table.channels]) - set(given)

    def kept(one: Channel) -> bool:
        facts = facts_of(one)
        levels = facts.kind == "boolean" and not one.boolean and (facts.low, facts.high) != (0.0, 1.0)
        asked = one.name in given
        idle = ("empty", "text") if asked else ("empty", "text", "constant", *(() if levels else ("boolean",)))
        supply = not asked and is_voltage(one.name, one.unit) and facts.low > _SAGS * facts.high
        return facts.kind not in idle and one.name not in turned and not supply

    names = frozenset(one.name for one in table.channels)
    return replace(table, channels=tuple(filter(kept, table.channels)), beside=names)


def idle(tables: Sequence[Table], missing: str) -> list[str]:
    """What columns do whose names make them what is missing, and that cannot be it."""
    roles = {"u": ("u",), "position": ("position", "velocity")}.get(missing, ())
    said = []
    for c in (c for one in tables for c in one.channels):
        facts = facts_of(c)
        if facts.kind in _DOES and not {*roles}.isdisjoint(recognise([c.name], {c.name: c.unit})):
            does = "is all there is, in one row" if c.values is not None and c.values.size == 1 else _DOES[facts.kind]
            said.append(f'"{c.name}" {does.format(facts.low)}')
    return said[:3]


#: What a column does that is no signal.
_DOES = {
    "constant": "is {:g} in all rows",
    "empty": "has no number in any row",
    "text": "holds no numbers",
    "boolean": "is yes or no",
}


def of_other_joints(path: str, tables: Sequence[Table], given: Mapping[str, str]) -> tuple[set[str], list[str]]:
    """Columns of all trials and joints but one, not looked at, and what to say; joints that rest are joints, too."""
    away, said = other_trials([c.name for one in tables for c in one.channels], given.values())
    channels = [c for one in tables for c in one.channels if c.name not in away]
    units = {c.name: c.unit for c in channels if c.values is not None and not is_clock(c)}
    found = recognise(list(units), units)
    for role, column in given.items():
        if role not in found or column not in (found[role].column, *found[role].equals):
            found[role] = Recognised(role, column, equals=numbered_as(column, units))  # m2 is called as m1
    joints, told = other_joints(path, FirstLook(tuple(units), units, found), given.values())
    return away | joints, [*said, *told]


def union_of(tables: Sequence[Table]) -> Table:
    channels = tuple(c for one in tables for c in one.channels)
    beside = frozenset[str]().union(*(one.beside for one in tables))
    return Table("", channels, None, any(one.clock for one in tables), beside)


def by_units(look: FirstLook) -> FirstLook:
    """With the roles whose unit one column alone has: of channels in several tables nothing else says what they do."""
    found = dict(look.found)
    for role in ("u", "velocity", "position"):
        taken = {one.column for one in found.values()}
        one = _only(role, {name: look.units[name] for name in look.columns if name not in taken})
        if role not in found and one is not None:
            found[role] = one
    return replace(look, found=found)


def _only(role: str, units: Mapping[str, str]) -> Recognised | None:
    """The column that alone has a unit of that role."""
    mine = [(name, unit) for name, unit in units.items() if role_of_unit(unit) == role]
    return Recognised(role, *mine[0]) if len(mine) == 1 else None


def of_encoder(look: FirstLook, taken: Collection[str]) -> dict[str, Recognised]:
    """The velocity and the position that have no name of one, where one column alone is in counts; of degrees and hertz
    there are more than motions."""
    found = {}
    for role in ("velocity", "position"):
        units = {c: look.units[c] or unit_in(c, role) for c in look.columns if c not in taken and not is_asked(c)}
        counts = {c: unit for c, unit in units.items() if whole_unit(unit) in OF_ENCODER and not is_force(c, unit)}
        if (one := _only(role, counts)) is not None:
            found[role] = one
    return found


def of_kind(look: FirstLook) -> FirstLook:
    """With the motion that no name says, where the unit, else the whole name, of one column that was measured does."""
    taken = {one.column for one in look.found.values()}
    free = [c for c in look.columns if c not in taken and not is_asked(c) and not is_force(c, look.units[c])]
    units = {c: kind for c in free if not is_neither(c, look.units[c]) and (kind := _kind_of(c, look.units[c]))}
    if look.found.keys() & {"position", "velocity"} or not units:
        return look
    of_role = {role: [c for c, kind in units.items() if kind[0] == role] for role in ("velocity", "position")}
    found = {role: Recognised(role, cs[0], units[cs[0]][1]) for role, cs in of_role.items() if len(cs) == 1}
    return look if any(len(cs) > 1 for cs in of_role.values()) else replace(look, found={**look.found, **found})


def _kind_of(name: str, unit: str) -> tuple[str, str] | None:
    """Of a column its role, velocity or position, and its unit; None: neither unit nor name says it.

    Of hertz there are more than motions, and the m of i_m is that of a motor.
    """
    *_, last = name.split("/")
    for role in ("velocity", "position"):
        said = unit or unit_in(name, role)
        if whole_unit(said) in NAMED[role].keys() - {"hz"} and not (not unit and re.fullmatch(r"._m", last)):
            return role, said
    (*more, word) = [one for one in words_in(last) if one not in MEASURED] or [""]
    return ("position", "") if word in PLACES and not (unit or more) else None


def forces_in(tables: Sequence[Table], found: Mapping[str, Recognised]) -> tuple[str, ...]:
    """Columns of all tables that are no motion, those whose unit is that of a force first."""
    taken = {one.column for one in found.values()}
    free = [(c.name, c.unit) for one in tables for c in one.channels if c.name not in taken and not is_clock(c)]
    free = [(name, unit) for name, unit in free if not is_motion(name, unit) and not is_neither(name, unit)]
    return tuple(name for name, unit in sorted(free, key=lambda item: role_of_unit(item[1]) != "u"))


def clock_of(tables: Sequence[Table], found: Mapping[str, Recognised]) -> dict[str, Recognised]:
    """The time of u's table, where every table that a role is in has one clock, and all call it alike."""
    used = [one for one in tables if {c.name for c in one.channels} & {role.column for role in found.values()}]
    clocks = [[c.name for c in one.channels if is_clock(c)] for one in used]
    called = {name.rpartition("/")[2] for names in clocks for name in names}
    if "time" in found or len(called) != 1 or any(len(names) != 1 for names in clocks):
        return {}
    of_u = next(at for at, one in enumerate(used) if found["u"].column in {c.name for c in one.channels})
    return {"time": Recognised("time", clocks[of_u][0])}


def is_clock(channel: Channel) -> bool:
    facts = facts_of(channel)
    return facts.kind == "counter" or (facts.kind == "clock" and facts.even < EVEN)
