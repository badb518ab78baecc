"""What the columns of an unknown log are, from their names and units."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import dropwhile

from dsd_cli.files.names_in import (
    HEX,
    IN_BRACKETS,
    OVER,
    bracketed,
    is_named,
    plain_name,
    unit_in,
    unit_of_object,
    words_in,
)
from dsd_cli.files.words import (
    ACCELERATION,
    ASKED,
    COMMANDS,
    COUNTERS,
    COUNTS_PER_S,
    ELSE,
    ERRORS,
    GENERAL,
    HEAT,
    IDLE,
    MEASURED,
    NAMED,
    OF_ACCELERATION,
    OF_ENCODER,
    OF_FORCE,
    OF_HEAT,
    OF_U,
    OUTER,
    OWNERS,
    QUATERNIONS,
    SHARES,
    SHORT_SETPOINT,
    SUPPLY,
    TIME_UNITS,
    WORDS,
    parts_of,
    plain_unit,
    whole_unit,
)
from dsd_cli.signals.units import POSITION, VELOCITY

#: T_em and T_load are torques, T_amb a temperature; T_ms is a time.
_NO_TIME = re.compile(r"T_(?!([mun]?s|sec)$)[A-Za-z]")
#: Letters of axes that are currents: q_A beside d_A.
_OF_CURRENT = ("_A", "_mA")
_FACTORS = {"position": POSITION, "velocity": VELOCITY}


@dataclass(frozen=True)
class Recognised:
    """A channel's column; `unit` as the log says it, "" where it does not.

    `others`: columns it could be as well, best first; `equals`: those of them whose names say it as clearly.
    """

    channel: str
    column: str
    unit: str = ""
    others: tuple[str, ...] = ()
    equals: tuple[str, ...] = ()

    @property
    def time_unit(self) -> str | None:
        """Of a time, as the config calls it."""
        return TIME_UNITS.get(plain_unit(self.unit.partition(" since ")[0]))

    @property
    def named(self) -> str:
        """Its unit as the config calls it, of u after its factor; "": the log does not say it, or it is not known."""
        if self.channel == "u":
            return OF_U.get(whole_unit(self.unit), ("", 0.0))[0]
        return NAMED.get(self.channel, {}).get(plain_unit(self.unit), "")

    @property
    def spoken(self) -> str:
        """Its unit for people: a torque in nm is in N m; the speed of an object is in what the drive is set to."""
        if self.by_default:
            return f"{self.unit} by default"
        if self.channel != "u" or not self.named:
            return self.unit
        return self.named if self.factor == 1.0 else f"{self.factor:g} {self.named}"

    @property
    def by_default(self) -> bool:
        """Whether it is a speed whose unit only the number of its object says: drives log rpm or 0.1 rpm there, too."""
        return self.channel == "velocity" and self.unit == unit_of_object(self.column) != ""

    @property
    def factor(self) -> float | None:
        """What brings the column to SI; None: the unit is not said, or not known."""
        times, unit = parts_of(self.unit)
        if self.channel == "u":
            return times * OF_U[plain_unit(unit)][1] if plain_unit(unit) in OF_U else None
        return self.of_kind[1] if self.of_kind else None

    @property
    def of_kind(self) -> tuple[str, float] | None:
        """Of a motion, its kind and what brings it to SI; None: the unit is not said, or not known."""
        times, unit = parts_of(self.unit)
        named = NAMED[self.channel].get(plain_unit(unit))
        return (_FACTORS[self.channel][named][0], times * _FACTORS[self.channel][named][1]) if named else None


def recognise(
    columns: Sequence[str], units: Mapping[str, str] | None = None, beside: Collection[str] = ()
) -> dict[str, Recognised]:
    """Channel -> column, for those whose name says it; "reference" is a position that was asked for.

    beside : columns that the log has as well, none of which is any of them.
    """
    units = units or {}
    found: dict[str, Recognised] = {}
    now = as_it_is_now([*columns, *beside])
    for channel in ("time", "d_hat", "u", "velocity", "position", "reference"):
        scored = [
            (score, -at, column)
            for at, column in enumerate(columns)
            if column not in {one.column for one in found.values()}
            and (score := _score(channel, now.get(column, column))) > 0.0
        ]
        if scored:
            (top, _, best), *rest = sorted(scored, reverse=True)
            others = tuple(column for *_, column in rest)
            equals = tuple(column for score, _, column in rest if score == top)
            unit = units.get(best) or unit_in(best, channel) or unit_of_object(best)
            found[channel] = Recognised(channel, best, unit, others, equals)
    return found


def as_it_is_now(columns: Sequence[str]) -> dict[str, str]:
    """Of columns whose `current` is no current but what is so now, what that is: y of current_y beside target_y, where
    no column has the name of a motion; target_q and current_q beside a position are currents."""
    words = {column: words_in(column.rpartition("/")[2]) for column in columns}
    asked = {tuple(one for one in said if one not in ASKED) for said in words.values() if not ASKED.isdisjoint(said)}
    first = {column: said[1:] for column, said in words.items() if said[:1] == ["current"] and said[1:]}
    others = [column for column, said in words.items() if column not in first and ASKED.isdisjoint(said)]
    if any(_score(channel, column) > 0.0 for channel in ("velocity", "position") for column in others):
        return {}
    return {column: "_".join(said) for column, said in first.items() if tuple(said) in asked}


def is_force(name: str, unit: str) -> bool:
    """Whether name or unit say that it is a force, torque or current, and so no motion."""
    volts = {"v", "mv", "volt", "volts"}
    return _unit_of(name, unit) in OF_U.keys() - volts - SHARES or _score("u", name) > 0.0


def role_of_unit(unit: str) -> str:
    """What a channel in that unit is: "u", "velocity", "position" or ""."""
    known = whole_unit(unit)
    if known in OF_U.keys() - SHARES:
        return "u"
    if known in OF_ENCODER:
        return "velocity" if known in COUNTS_PER_S else "position"
    return next((role for role in ("velocity", "position") if known in NAMED[role]), "")


def is_current(name: str, unit: str) -> bool:
    """Whether name or unit say that it is a current."""
    return whole_unit(unit) in {"a", "ma", "amp", "amps"} or _has(name, {"current", "strom", "iq", "amps", "amp"})


def names_force(name: str) -> bool:
    """Whether a name says that it is a torque or a force itself, and no current or voltage that makes one."""
    return _has(name, OF_FORCE) and not (is_current(name, "") or is_voltage(name, "") or _has(name, {"duty", "pwm"}))


def is_voltage(name: str, unit: str) -> bool:
    """Whether name or unit say that it is a voltage."""
    return whole_unit(unit or unit_in(name, "u")) in {"v", "mv", "volt", "volts"} or _has(
        name, {"voltage", "volts", "volt", "spannung", "voltaje"}
    )


def _has(name: str, words: Collection[str]) -> bool:
    return not set(words).isdisjoint(words_in(name))


def is_time(name: str) -> bool:
    """Whether a name is that of a time."""
    return _score("time", name) > 0.0


def is_count(name: str) -> bool:
    """Whether a name is that of a count of the rows."""
    return _has(name, COUNTERS)


def is_command(name: str) -> bool:
    """Whether a name says that it is a command, and not of what: a motion that was asked for, or u."""
    return bool(words := set(words_in(name))) and words <= COMMANDS


def is_motion(name: str, unit: str) -> bool:
    """Whether name or unit say that it is a motion, asked for or measured, or a time, and so makes nothing move."""
    words = set(words_in(name))
    said = any(_score(channel, name) > 0.0 for channel in ("time", "position", "velocity", "reference"))
    in_units = any(_unit_of(name, unit) in NAMED[channel] for channel in NAMED)
    in_units |= whole_unit(unit_in(name, "velocity")) in NAMED["velocity"]  # commanded_deg_s
    return (said or in_units or bool(words & IDLE)) and not _score("u", name) and not is_command(name)


def is_asked(name: str) -> bool:
    """Whether a name says that it was asked for, and so is no motion that was measured."""
    return bool(_asked_of(words_in(name.rpartition("/")[2])))


def _asked_of(words: Sequence[str]) -> set[str]:
    """Those of the words that say so; sp beside another one, for by itself it may be a speed."""
    return {word for word in words if word in ASKED or (word == SHORT_SETPOINT and len(words) > 1)}


def _unit_of(name: str, unit: str) -> str:
    """The unit of a column, which may be in brackets in its name, as the tables have it."""
    return whole_unit(unit or (bracketed(name) or [""])[-1])


def is_error(name: str) -> bool:
    """Whether a name says that it is what is left to go, which a controller makes a control input of, and no motion."""
    return _has(name, ERRORS)


def is_neither(name: str, unit: str) -> bool:
    """Whether name or unit say that it is neither input nor motion: a temperature, what is left to go, acceleration."""
    own, said = name.rpartition("/")[2], whole_unit(unit or unit_in(name, ""))
    if said in OF_ACCELERATION or (_has(own, ACCELERATION) and not _score("u", name)):
        return True
    return _has(own, HEAT) or said in OF_HEAT or is_error(name) or is_supply(name)


def is_supply(name: str) -> bool:
    """Whether a name says that it is what feeds the drive, which follows the motion and makes none."""
    own = name.rpartition("/")[2]
    return _has(own, SUPPLY) or (_has(own, {"pack"}) and _has(own, {"current", "voltage"}))


def _score(channel: str, column: str) -> float:
    """How well the name fits; 0 where it does not."""
    column = OVER.sub(" ", plain_name(column))
    text = IN_BRACKETS.sub(" ", column)
    if not is_named(text):
        text = IN_BRACKETS.sub(lambda one: f" {one[1]} " if is_named(one[1]) else " ", column)
    group, _, last = HEX.sub(" ", text).rpartition("/")
    within, _, own = last.rpartition(".")
    if within and any(_word_score(one, words_in(own), "".join(words_in(own))) > 0.0 for one in WORDS):
        group, last = f"{group}/{within}", own  # axis0.pos_vel_mapper.pos_rel; IL.FB says nothing by its end
    if channel == "time" and _NO_TIME.match(last):
        return 0.0
    words, around = words_in(last), set(words_in(group))
    joined = "".join(words)
    moves = any(_word_score(one, words, joined) > 0.0 for one in ("velocity", "position"))
    if moves and set(words) & GENERAL:
        words = [word for word in words if word not in GENERAL] if channel == "u" else [*words, "setpoint"]
    asked = bool(_asked_of(words) or around & ASKED)
    if set(words) & ELSE or around & ERRORS or not words or (around & QUATERNIONS and len(joined) == 1):
        return 0.0
    if channel in ("position", "velocity", "reference") and (set(words) & ACCELERATION or last.endswith(_OF_CURRENT)):
        return 0.0
    if channel == "reference":
        bare = [word for word in words if word in _asked_of(words)]
        return 2.0 if asked and (_word_score("position", words, joined) > 0.0 or len(bare) == len(words)) else 0.0
    score = _word_score(channel, words, joined)
    if score == 0.0 and joined not in WORDS["time"]:  # drive/velocity/elbow, axis/position/1, but not speed/Time
        score = 0.8 * _word_score(channel, sorted(around & set(WORDS[channel])), "")
    if score == 0.0 or (asked and channel in ("velocity", "position", "d_hat", "time")):
        return 0.0
    outer = channel == "u" and bool(set(words) & OUTER)  # not even what was commanded
    return score - 0.3 * asked - 0.4 * outer + 0.2 * bool(set(words) & MEASURED)


def _word_score(channel: str, words: Sequence[str], joined: str) -> float:
    known = WORDS[channel]
    if joined in known:
        return 3.0 - 0.01 * known.index(joined)
    said = {*MEASURED, *ASKED, *OWNERS} - {"motor"} if channel != "time" else set()
    bare = list(dropwhile(said.__contains__, words))  # actual_q_1, axisQMsr_a1
    others = _words_of_others(channel)
    letter = bare[:1] if others.isdisjoint(bare[1:]) else []  # q_current is none of q
    hits = [known.index(word) for word in words if word in known and (len(word) > 1 or word in letter)]
    if channel == "time" and words[-1:] and words[-1] in TIME_UNITS and not others.isdisjoint(words):
        return 0.0  # VelocityRadPerSec
    return 2.0 - 0.01 * min(hits) if hits else 0.0


@cache
def _words_of_others(channel: str) -> frozenset[str]:
    """What names of the other channels have; no letters, for v_x is the v of an axis."""
    return frozenset(word for other, known in WORDS.items() if other != channel for word in known if len(word) > 1)
