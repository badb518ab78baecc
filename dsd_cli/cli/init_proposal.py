"""What `dsd init` will write, key by key, and the units in it: named, or by a factor, or open."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from dsd_cli.cli.init_roles import Chosen
from dsd_cli.cli.init_units import Units
from dsd_cli.files.config import Signals
from dsd_cli.files.config.signals import UNKNOWN
from dsd_cli.files.recognise import Recognised
from dsd_cli.files.words import COUNTS, plain_unit
from dsd_cli.signals.units import POSITION, VELOCITY

#: Units that a person is asked to choose from.
UNITS = ("rad", "deg", "turn", "m", "mm")
_SCALE_KEYS = {"u": "u_scale", "velocity": "velocity_scale", "position": "position_scale"}


@dataclass
class Proposal:
    """(section, key) -> TOML value, and one line for each thing that was found or guessed."""

    values: dict[tuple[str, str], str] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)

    def put(self, section: str, key: str, value: object, why: str = "") -> None:
        """Set a key; `why`, where it is worth a line."""
        self.values[section, key] = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else _toml(value)
        if why:
            self.said.append(f"{key} = {self.values[section, key]}: {why}")


def with_units(chosen: Chosen, values: Mapping[tuple[str, str], object]) -> Chosen:
    """With the units that the user gave for position and velocity."""
    found = dict(chosen.found)
    for role in ("position", "velocity"):
        unit = values.get(("signals", f"{role}_unit"))
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
    if channel != "u" and not one.named:
        si = "rad/s or m/s" if channel == "velocity" else "rad or m"
        known = "is not said" if not one.unit else f'is "{one.unit}", which is not known'
        if plain_unit(one.unit) in COUNTS:
            unit = "counts/s" if channel == "velocity" else "counts"
            known = f'is counts: {channel}_unit = "{unit}" and counts_per_turn (or counts_per_metre) say how much'
        out.put("signals", f"{channel}_unit", UNKNOWN)
        answer = "" if plain_unit(one.unit) in COUNTS else f"; if it is another: --set signals.{channel}_unit=UNIT"
        out.said.append(f'{channel}: the unit of "{one.column}" {known}; it is taken as {si}{answer}')


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
        out.said = [line for line in out.said if not is_answered(line, channel)]


def answer_unit(out: Proposal, unit: str) -> None:
    """The unit of the position as the user gives it."""
    out.put("signals", "position_unit", unit)
    out.said = [line for line in out.said if not is_answered(line, "position")]


def let_velocity_follow(out: Proposal) -> None:
    """A velocity whose unit is open has that of the position, per s: it is not asked for, or said to be that."""
    if is_open(out, "position"):
        out.said = [line for line in out.said if not is_answered(line, "velocity")]
    elif is_open(out, "velocity") and (unit := json.loads(out.values.get(("signals", "position_unit"), '""'))):
        out.said = [
            line.replace("rad/s or m/s", f"{unit}/s") if is_answered(line, "velocity") else line for line in out.said
        ]


def drop_open(out: Proposal) -> None:
    """Without units that are unknown: SI it is."""
    for channel in ("position", "velocity"):
        if is_open(out, channel):
            del out.values["signals", f"{channel}_unit"]
            out.said = [line for line in out.said if not is_answered(line, channel)]


def is_question(line: str) -> bool:
    """Whether what was said is left open."""
    return "; it is taken as" in line


def is_open(out: Proposal, channel: str) -> bool:
    return out.values.get(("signals", f"{channel}_unit")) == json.dumps(UNKNOWN)


def is_answered(line: str, channel: str) -> bool:
    """Whether it asks for the unit of a channel, which another has said by now."""
    return line.startswith(f"{channel}: ") and ("is not said" in line or "is counts" in line)


def factors_of(out: Proposal) -> dict[str, float]:
    """Channel -> factor, as the config will have it."""
    written: dict[str, Any] = {
        key: json.loads(text) for (section, key), text in out.values.items() if section == "signals"
    }
    told = {key: value for key, value in written.items() if key in Signals.keys and key != "sample_time"}
    factors = Signals(**told).factors()
    return {channel: value for channel, value in factors.items() if channel in _SCALE_KEYS}


def _toml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)
