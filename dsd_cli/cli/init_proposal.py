"""What `dsd init` will write, key by key, and the units in it: named, or by a factor, or open."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from dsd_cli.cli.init_roles import Chosen
from dsd_cli.cli.init_units import Units
from dsd_cli.errors import UsageError
from dsd_cli.files.config import Signals
from dsd_cli.files.config.signals import UNKNOWN
from dsd_cli.files.names_in import words_in
from dsd_cli.files.recognise import Recognised
from dsd_cli.files.words import COUNTS, plain_unit
from dsd_cli.signals.units import POSITION, VELOCITY

#: Units that a person is asked to choose from.
UNITS = ("rad", "deg", "turn", "m", "mm")
_SCALE_KEYS = {"u": "u_scale", "velocity": "velocity_scale", "position": "position_scale"}


class OpenUnit(NamedTuple):
    """What the log says of the unit of a column, and whether its name is the answer: of counts it is not."""

    known: str
    by_name: bool


@dataclass
class Proposal:
    """(section, key) -> TOML value, one line for each thing that was found or guessed, and what is left open.

    `asked`: position or velocity -> what is known of its unit, where that is not enough. `comments`: of keys whose
    lines say why they are so.
    """

    values: dict[tuple[str, str], str] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)
    asked: dict[str, OpenUnit] = field(default_factory=dict)
    comments: dict[tuple[str, str], str] = field(default_factory=dict)

    def put(self, section: str, key: str, value: object, why: str = "") -> None:
        """Set a key; `why`, where it is worth a line, in the place of one that was there."""
        self.values[section, key] = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else _toml(value)
        if why:
            self.said = [line for line in self.said if not line.startswith(f"{key} = ")]
            self.said.append(f"{key} = {self.values[section, key]}: {why}")


def as_told(chosen: Chosen, values: Mapping[tuple[str, str], object]) -> Chosen:
    """With the units that the user gave, and without what he says is not to be looked for."""
    told = {key: value for (section, key), value in values.items() if section == "signals"}
    if "sample_time" in told and not told.get("time"):
        told["time"] = ""
    found = {role: one for role, one in chosen.found.items() if told.get(role) != ""}
    for role in ("time", "position", "velocity"):
        unit = told.get(f"{role}_unit")
        if role in found and isinstance(unit, str) and unit != UNKNOWN:
            found[role] = replace(found[role], unit=unit)
    return replace(chosen, found=found)


def name_unit(channel: str, one: Recognised, out: Proposal) -> None:
    """Units by name, so that every table and picture has them; a factor where the name has none."""
    if channel not in _SCALE_KEYS:
        return
    if one.named and _one_kind(channel, one.named, out):
        out.put("signals", f"{channel}_unit", one.named)
    factor = one.factor or 1.0
    if factor != 1.0 and (channel == "u" or ("signals", f"{channel}_unit") not in out.values):
        out.put("signals", _SCALE_KEYS[channel], float(f"{factor:.6g}"), f'"{one.column}" is in {one.unit}')
    if channel != "u" and one.factor is None:
        known = "is not said" if not one.unit else f'is "{one.unit}", which is not known'
        if counts := plain_unit(one.unit) in COUNTS:
            unit = "counts/s" if channel == "velocity" else "counts"
            known = f'is counts: {channel}_unit = "{unit}" and counts_per_turn (or counts_per_metre) say how much'
        if one.by_default:
            known += '; or velocity_unit = "rpm", or velocity_scale = 0.010472 for 0.1 rpm, if the drive is set to that'
        if electrical := channel == "velocity" and not one.unit and "erpm" in words_in(one.column):
            known = "is electrical rpm: velocity_scale = 0.10472 / pole pairs says how much"
        out.put("signals", f"{channel}_unit", UNKNOWN)
        out.asked[channel] = OpenUnit(f'the unit of "{one.column}" {known}', not (counts or electrical))


def _one_kind(channel: str, unit: str, out: Proposal) -> bool:
    """Not turns beside metres: a config has one kind. The velocity comes first."""
    velocity = None if is_open(out, "velocity") else out.values.get(("signals", "velocity_unit"))
    return channel != "position" or velocity is None or POSITION[unit][0] == VELOCITY[json.loads(velocity)][0]


def settle_units(units: Units, out: Proposal) -> None:
    for at, (key, value) in enumerate(units.keys.items()):
        channel = key.partition("_")[0]
        follows = key == "velocity_scale" and is_open(out, "position")
        if is_open(out, channel) and not follows:
            del out.values["signals", f"{channel}_unit"]
        out.put("signals", key, value, units.why if at == 0 else "")
        out.asked.pop(channel, None)


def answer_unit(out: Proposal, unit: str) -> None:
    """The unit of the position as the user gives it."""
    out.put("signals", "position_unit", unit)
    out.asked.pop("position", None)


def questions(out: Proposal) -> list[str]:
    """A line for each unit that is left open, and what it is taken as.

    A velocity whose unit is open has that of the position, per s: it is not asked for beside it.
    """
    lines = []
    for channel, one in out.asked.items():
        if not is_open(out, channel) or (channel == "velocity" and is_open(out, "position")):
            continue
        taken = "rad or m"
        if channel == "velocity":
            unit = json.loads(out.values.get(("signals", "position_unit"), '""'))
            taken = f"{unit}/s" if unit else "rad/s or m/s"
            if not one.by_name and unit == "counts":
                continue  # counts per s are what it says
        answer = f"; if it is another: --set signals.{channel}_unit=UNIT" if one.by_name else ""
        lines.append(f"{channel}: {one.known}; it is taken as {taken}{answer}")
    return lines


def drop_open(out: Proposal, channels: Collection[str] = ("position", "velocity")) -> None:
    """Without units of these that are unknown: SI it is, or a factor of the user's makes it that."""
    for channel in channels:
        if is_open(out, channel):
            del out.values["signals", f"{channel}_unit"]
            out.asked.pop(channel, None)


def count_open(out: Proposal) -> None:
    """With the counts of the encoder, of which the user said how many there are, as the unit that nothing says.

    Raises
    ------
    UsageError : the name of the column says another.
    """
    told = next((key for key in ("counts_per_turn", "counts_per_metre") if ("signals", key) in out.values), "")
    channel = "position" if ("signals", "position") in out.values else "velocity"
    unit = json.loads(out.values.get(("signals", f"{channel}_unit"), '""'))
    if not told or unit.startswith("counts"):
        return
    counts = "counts" if channel == "position" else "counts/s"
    if unit not in ("", UNKNOWN):
        column = out.values["signals", channel]
        how = f"leave it out, or say --set signals.{channel}_unit={counts}"
        raise UsageError(f"signals.{told} is given, and {column} is in {unit}", how)
    out.put("signals", f"{channel}_unit", counts, f"{told} is given")
    out.asked.pop(channel, None)


def is_open(out: Proposal, channel: str) -> bool:
    return out.values.get(("signals", f"{channel}_unit")) == json.dumps(UNKNOWN)


def signals_of(out: Proposal) -> Signals:
    """[signals] as the config will have it."""
    written: dict[str, Any] = {
        key: json.loads(text) for (section, key), text in out.values.items() if section == "signals"
    }
    told = {key: value for key, value in written.items() if key in Signals.keys and key != "sample_time"}
    return Signals(**told)


def factors_of(out: Proposal) -> dict[str, float]:
    """Channel -> factor, as the config will have it."""
    return {channel: value for channel, value in signals_of(out).factors().items() if channel in _SCALE_KEYS}


def _toml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)
