"""Which channel of an unknown log is what: as the user says, by names and units, else by what the channels do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dsd_cli.cli.init_direction import with_direction
from dsd_cli.cli.init_stamps import unit_of_stamps, with_even_stamps
from dsd_cli.cli.init_union import (
    by_units,
    clock_of,
    forces_in,
    idle,
    is_clock,
    is_part,
    of_encoder,
    of_kind,
    of_other_joints,
    union_of,
    usable,
)
from dsd_cli.errors import DataError, UsageError
from dsd_cli.files.first_look import FirstLook
from dsd_cli.files.joints import apart
from dsd_cli.files.recognise import (
    Recognised,
    as_it_is_now,
    is_asked,
    is_command,
    is_force,
    is_motion,
    is_neither,
    is_voltage,
    recognise,
    role_of_unit,
    unit_in,
)
from dsd_cli.files.sample import Sample, Table
from dsd_cli.roles import Guess, Roles, facts_of, guess_roles
from dsd_cli.signals.clock import TIME_SCALE

#: Roles that the user can name, and those of which one is needed.
GIVEN = ("time", "u", "position", "velocity")
MOTION = ("d_hat", "velocity", "position")
#: Tables whose channels are looked at one by one.
TABLES = 4


class Coarse(NamedTuple):
    """Stamps that are coarser than the rows: what to say of them, and s from row to row if these are even."""

    what: str
    apart: float


@dataclass(frozen=True, eq=False)
class Chosen:
    """The columns of the channels, with their units, and why; `table` has them all, None: they are in several.

    `missing`: "u", "position" or "" for nothing; `candidates`: columns that it may be, likeliest first. `elsewhere`:
    there are columns of other joints, too. `again`: columns that are the motion once more. `idle`: what columns do
    whose names make them what is missing, and that cannot be it. `left`: columns that change and have no role.
    """

    found: Mapping[str, Recognised]
    reasons: Mapping[str, Guess]
    clock: bool
    table: Table | None
    said: tuple[str, ...]
    missing: str = ""
    candidates: tuple[str, ...] = ()
    coarse: Coarse | None = None
    elsewhere: bool = False
    again: frozenset[str] = frozenset()
    idle: tuple[str, ...] = ()
    left: tuple[str, ...] = ()

    @property
    def none_left(self) -> bool:
        """What is missing is in no column, of another table neither: all are something else."""
        columns = {one.column for one in self.found.values()} | self.again
        others = self.elsewhere or bool(self.candidates)
        return self.table is not None and not others and {c.name for c in self.table.channels} <= columns


def choose(path: str, sample: Sample, given: Mapping[str, str]) -> Chosen:
    """What every channel is, as far as it can be said.

    Raises
    ------
    UsageError : a column that was given is not there. DataError : no column holds numbers.
    """
    if all(facts_of(one).kind in ("empty", "text") for table in sample.tables for one in table.channels):
        told = "a row is numbers with a delimiter between them; `dsd columns` shows what was read"
        raise DataError(f"{path}: no column holds numbers", told)
    given = {role: _named(path, sample, name) for role, name in given.items()}
    parts = [one for one in sample.tables if not given and any(is_part(one, other) for other in sample.tables)]
    tables = [one for one in sample.tables if one not in parts]
    away, said = of_other_joints(path, tables, given)
    tables = [replace(one, channels=tuple(c for c in one.channels if c.name not in away)) for one in tables]
    tables = [usable(table, given.values()) for table in tables]
    mine = [one for one in tables if set(given.values()) <= {c.name for c in one.channels}] or tables
    chosen = _chosen_of(mine, given)
    if chosen.missing and given and len(mine) < len(tables):  # the rest may be in a table with another clock
        joined = _chosen_of(tables, given)
        chosen, mine = (chosen, mine) if joined.missing else (joined, tables)
    why = tuple(idle(sample.tables, chosen.missing))
    taken = {one.column for one in chosen.found.values()}
    left = tuple(c.name for one in tables for c in one.channels if c.name not in taken and not is_clock(c))
    chosen = replace(chosen, said=(*said, *chosen.said), elsewhere=bool(away), idle=why, left=left)
    return _of_one_axis(chosen, mine, given)


def _chosen_of(tables: Sequence[Table], given: Mapping[str, str]) -> Chosen:
    looks = [(by_names(table, given), table) for table in tables]
    best, table = max(looks, key=lambda item: _worth(*item))
    if _whole(best.found):
        return _completed(best, table, given)
    union = by_units(by_names(union_of(tables), given))
    if _whole(union.found):
        found = union.found if union.clock else {**union.found, **clock_of(tables, union.found)}
        return Chosen(found, {}, union.clock, None, ())
    deeds = _by_deeds(sorted(looks, key=lambda item: -_worth(*item))[:TABLES], given)
    listed = deeds.missing != "u" or deeds.candidates or deeds.again
    return deeds if listed else replace(deeds, candidates=forces_in(tables, deeds.found))


def _of_one_axis(chosen: Chosen, tables: Sequence[Table], given: Mapping[str, str]) -> Chosen:
    """With u, or the motion beside a u that the user named, to be asked for where names make them of two joints."""
    asked = "position" if "u" in given else "u"
    columns = {c.name for one in tables for c in one.channels}
    for role in MOTION:
        if not {"u", role} <= chosen.found.keys() or {"u", role} <= given.keys():
            continue
        doubted, sure = (chosen.found[one] for one in ((role, "u") if "u" in given else ("u", role)))
        if other := apart(columns, doubted.column, sure.column):
            left = ("u",) if asked == "u" else MOTION
            found = {role: one for role, one in chosen.found.items() if role not in left}
            likely = tuple(dict.fromkeys([other, doubted.column, *doubted.others]))
            return replace(chosen, found=found, missing=asked, candidates=likely)
    return chosen


def _named(path: str, sample: Sample, name: str) -> str:
    """The whole name of a column that was given by its name, the end of it, or its number."""
    names = [channel.name for table in sample.tables for channel in table.channels]
    found = [one for one in names if one == name] or [one for one in names if one.endswith(f"/{name}")]
    if not found and name.isascii() and name.isdigit() and 0 < int(name) <= len(names):
        return names[int(name) - 1]
    if len(found) != 1:
        listed = ", ".join((found or names)[:12])
        what = "no column" if not found else f"{len(found)} columns"
        raise UsageError(f'{path}: {what} "{name}"', f"{'it has' if not found else 'write which:'} {listed}")
    return found[0]


def by_names(table: Table, given: Mapping[str, str]) -> FirstLook:
    """What names and units say, and the user."""
    units = {one.name: one.unit for one in table.channels}
    names = list(units)
    nameless = beside_a_clock(table)
    names_left = [name for name in names if name not in given.values() and name not in nameless]
    found = recognise(names_left, units, table.beside)
    if not table.clock and "time" not in {**found, **given}:  # what rises evenly is the time, also as "X"
        evenly = {one.name for one in table.channels if is_clock(one)}
        found = recognise([name for name in names_left if name not in evenly], units, table.beside)
    found = {role: one for role, one in found.items() if role not in given}
    for role, column in given.items():
        if column in units:
            found[role] = Recognised(role, column, units[column] or unit_in(column, role))
    if table.clock and "time" not in given:
        found.pop("time", None)
    return of_kind(FirstLook(tuple(names), units, found, table.clock))


def beside_a_clock(table: Table) -> set[str]:
    """Columns of matrices that have the time and several signals in them: the name of the matrix is that of none."""
    of_matrices = {one.name: one.name.rpartition("/") for one in table.channels}
    matrix = {name: stem for name, (stem, _, at) in of_matrices.items() if stem and at.isdigit()}
    timed = {matrix[one.name] for one in table.channels if one.name in matrix and is_clock(one)}
    return {name for name, stem in matrix.items() if stem in timed and [*matrix.values()].count(stem) > 2}


def _whole(found: Mapping[str, Recognised]) -> bool:
    return "u" in found and any(one in found for one in MOTION)


def _worth(look: FirstLook, table: Table) -> float:
    """How much of a log a table is."""
    roles = 2.0 * ("u" in look.found) + 2.0 * any(one in look.found for one in MOTION)
    moving = min(len(table.channels), 5) / 5.0
    return roles + (look.clock or "time" in look.found) + moving + 0.1 * np.log10(_rows(table) + 1)


def _rows(table: Table) -> int:
    return max((one.values.size for one in table.channels if one.values is not None), default=0)


def _completed(look: FirstLook, table: Table, given: Mapping[str, str]) -> Chosen:
    """With the time, the position or the velocity that the names do not say."""
    said: tuple[str, ...] = ()
    if "u" in look.found and "u" not in given and (other := with_direction(look, table)) is not None:
        size, look = look.found["u"].column, replace(look, found={**look.found, "u": other})
        said = (*said, f'"{size}" has no direction though the axis turns: "{other.column}", which it follows, is u')
    if "time" not in given:
        look, told = with_even_stamps(look, table)
        said = (*said, *told)
    roles = roles_of(look, table, given)
    if "u" in look.found and "u" not in roles.found:
        shares = (f"{100 * share:.0f} % of {name}" for name, share in roles.causes.items() if share > 0.0)
        said = (*said, f"several are called as u is; the motion explains {', '.join([*shares][:4])}: none clearly best")
    chosen = _chosen(look, table, roles)
    return replace(chosen, said=(*said, *chosen.said))


def roles_of(look: FirstLook, table: Table, given: Mapping[str, str]) -> Roles:
    """What its channels are by what they do, as far as the look does not say it."""
    named = {role: one.column for role, one in look.found.items()}
    if "u" not in named and is_command(named.get("reference", "")):
        del named["reference"]  # only what it does says of what
    neither = {one.name for one in table.channels if is_neither(one.name, one.unit)} - set(given.values())
    forces = neither | {one.name for one in table.channels if is_force(one.name, one.unit)} - set(given.values())
    u = look.found.get("u")
    if u is not None and u.equals and "u" not in given and not any(one in named for one in MOTION):
        del named["u"]  # Voltage_0, Voltage_1: whose name says nothing
        forces -= {u.column, *u.equals}
    p = look.found.get("position")
    if p is not None and p.of_kind:  # measured as an angle or a way: a voltage that follows its speed is what drives it
        forces |= {one.name for one in table.channels if is_voltage(one.name, one.unit)} - set(given.values())
    motions = {one.name for one in table.channels if is_motion(one.name, one.unit)}
    moved = neither | motions - set(given.values()) - beside_a_clock(table)
    others = {role: one.others for role, one in look.found.items() if role not in given}
    sure = (frozenset(forces), frozenset(moved))
    asked = frozenset({one.name for one in table.channels if is_asked(one.name)} - set(given.values()))
    return guess_roles(
        table.channels, named, *sure, told=given, rivals=others, asked=asked, scale=_seconds(look, table)
    )


def _seconds(look: FirstLook, table: Table) -> float:
    """s per unit of the time column, where one is named; 1 else."""
    time = look.found.get("time")
    return 1.0 if time is None else TIME_SCALE[unit_of_stamps(time, table)]


def _by_deeds(looks: Sequence[tuple[FirstLook, Table]], given: Mapping[str, str]) -> Chosen:
    """The table in which most is found."""
    best = max((_chosen(look, table, roles_of(look, table, given)) for look, table in looks), key=_found)
    return best


def _found(chosen: Chosen) -> float:
    roles = set(chosen.found)
    return 2.0 * ("u" in roles) + 2.0 * bool(roles & set(MOTION)) + (chosen.clock or "time" in roles)


def _chosen(look: FirstLook, table: Table, roles: Roles) -> Chosen:
    found = {}
    for role, guess in roles.found.items():
        mine = look.found.get(role)
        positions = look.found["position"].others if "position" in look.found else ()
        if role == "velocity" and mine is None and guess.column in positions:
            continue
        unit = look.units.get(guess.column) or unit_in(guess.column, role)
        found[role] = mine if mine is not None and mine.column == guess.column else Recognised(role, guess.column, unit)
    clocks = {name for name, one in roles.facts.items() if one.kind in ("clock", "counter")}
    counted = {} if found.keys() & set(MOTION) else of_encoder(look, clocks | {one.column for one in found.values()})
    found |= counted
    if "position" not in found:
        found.pop("reference", None)  # of a speed, or of what is not in the log
    if look.clock:
        found.pop("time", None)
    elif "time" in found and "time" not in look.found and roles.facts[found["time"].column].kind == "counter":
        del found["time"]
    missing = "u" if "u" not in found else "" if any(one in found for one in MOTION) else "position"
    taken = {one.column for one in found.values()}
    likely = [name for name in roles.causes if name not in taken]
    rest = [one.name for one in table.channels if one.name not in taken and one.name not in likely]
    rest = [name for name in rest if roles.facts[name].kind in ("signal", "drift", "boolean")]
    may = [name for name in (*likely, *rest) if not is_neither(name, look.units[name]) and name not in roles.again]
    now = as_it_is_now([*look.columns, *table.beside])  # of which there is one that was asked for
    no_u = {name for name in may if is_motion(name, look.units[name]) or (name in now and not is_force(now[name], ""))}
    no_motion = {name for name in may if is_asked(name) or is_force(name, look.units[name])}
    candidates = tuple(name for name in may if name not in (no_u if missing == "u" else no_motion))
    said = tuple(
        f'"{name}" goes as the motion does: it was asked for, or measured again' for name in sorted(roles.again)
    )
    if missing == "u" and [role_of_unit(look.units[c] or unit_in(c, "u")) for c in candidates] == ["u"]:
        by_unit = {"u": Recognised("u", candidates[0], look.units[candidates[0]] or unit_in(candidates[0], "u"))}
        counted, found = counted | by_unit, found | by_unit
        missing = "" if any(one in found for one in MOTION) else "position"
        candidates = candidates[1:]
    candidates = candidates if missing else ()
    reasons = {**roles.found, **{role: Guess(one.column, "by its unit") for role, one in counted.items()}}
    return Chosen(found, reasons, look.clock, table, said, missing, candidates, again=roles.again)
