"""The units of the channels in words: {u}, {v} and {q} of `Parameter.unit` and `Estimate.unit`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

#: What the words mean; for the foot of a table.
LEGEND = "Units: u is the unit of the control input; v is rad/s or m/s; q is rad or m."

#: s; no sample time is shorter, given or found: times in samples stay numbers that can be counted.
SHORTEST = 1e-9

#: Unit of a position column -> (the SI unit that it is read in, factor).
POSITION = {
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    "deg": ("rad", math.pi / 180.0),
    "turn": ("rad", 2.0 * math.pi),
    "m": ("m", 1.0),
    "cm": ("m", 1e-2),
    "mm": ("m", 1e-3),
    "um": ("m", 1e-6),
    "counts": ("", 1.0),
    "unknown": ("", 1.0),
}
#: The same of a velocity column, per s.
VELOCITY = {
    "rad/s": ("rad", 1.0),
    "mrad/s": ("rad", 1e-3),
    "deg/s": ("rad", math.pi / 180.0),
    "turn/s": ("rad", 2.0 * math.pi),
    "rpm": ("rad", 2.0 * math.pi / 60.0),
    "m/s": ("m", 1.0),
    "cm/s": ("m", 1e-2),
    "mm/s": ("m", 1e-3),
    "um/s": ("m", 1e-6),
    "m/min": ("m", 1.0 / 60.0),
    "mm/min": ("m", 1e-3 / 60.0),
    "counts/s": ("", 1.0),
    "unknown": ("", 1.0),
}
#: What u / (q/s^2) is called where it has a name.
_INERTIAS = {("N m", "rad"): "kg m^2", ("Nm", "rad"): "kg m^2", ("N", "m"): "kg"}

#: Names of u that say it is a torque or a force.
FORCES = frozenset(f"{prefix}{unit}" for prefix in ("", "m", "k") for unit in ("N m", "Nm", "N*m", "N.m", "N"))

#: Advice where u may be in volts or amperes.
PER_UNIT = (
    "inertia and forces are per unit of u: where u is no torque or force (volts, amperes), J is known only up "
    "to the gain of the drive, and a wrong gain looks just like a wrong inertia"
)


@dataclass(frozen=True)
class Units:
    """The user's units: of u as he names it, of positions in SI; "" where he did not say.

    `assumed`: positions are taken as SI, and may be in degrees, turns or mm: nothing says it. `by_name`: the column of
    u, whose unit is not said, is called a torque or a force.
    """

    u: str = ""
    position: str = ""
    assumed: bool = False
    by_name: bool = False

    @property
    def is_force(self) -> bool:
        """Whether u is a torque or a force, and no volts or amperes that make one."""
        return self.u in FORCES if self.u else self.by_name

    @property
    def force(self) -> str:
        """Of an error of the balance of forces."""
        return self.u or "unit of u"

    @property
    def of_position(self) -> str:
        """Of a position."""
        return self.position or "rad or m"

    @property
    def of_velocity(self) -> str:
        """Of a velocity."""
        return f"{self.position}/s" if self.position else "rad/s or m/s"

    def words(self, unit: str) -> str:
        """`{u}/({v})` -> `N s/m` where the units are known, `u/v` where not; whatever else is in it stays."""
        if unit == "{u}/({v}/s)" and (self.u, self.position) in _INERTIAS:
            return _INERTIAS[self.u, self.position]
        u = self.u or "u"
        u = f"({u})" if " " in u and "/" in unit else u
        v = f"{self.position}/s" if self.position else "v"
        grouped = f"({v})" if self.position else v
        unit = unit.replace("({v}/s)", f"({self.position}/s^2)" if self.position else "(v/s)")
        for placeholder, word in (
            ("({v})", grouped),
            ("({q})", self.position or "q"),
            ("{u}", u),
            ("{v}^2", f"{grouped}^2"),
            ("{v}", v),
            ("{q}", self.position or "q"),
        ):
            unit = unit.replace(placeholder, word)
        return unit

    @classmethod
    def of_inertia(cls, text: str) -> Units:
        """The units by that of an inertia, as `words` writes it: the way back; nothing is known where it is another."""
        for units, word in _INERTIAS.items():
            if text == word:
                return cls(units[0].replace("Nm", "N m"), units[1])
        found = re.fullmatch(r"(?:\((.+)\)|([^()]+))/\((?:(m|rad)/s\^2|v/s)\)", text)
        if found is None:
            return cls()
        u = found[1] or found[2]
        return cls("" if u == "u" else u, found[3] or "")

    @property
    def legend(self) -> str:
        """What the words that are left mean; "" where there are none."""
        if not self.u and not self.position:
            return LEGEND
        words = [] if self.u else ["u is the unit of the control input"]
        words += [] if self.position else ["v is rad/s or m/s; q is rad or m"]
        return f"Units: {'; '.join(words)}." if words else ""


def in_words(unit: str) -> str:
    """`{u}/({v})` -> `u/v`; whatever else is in it stays."""
    return Units().words(unit)


#: Channel -> what its column is to be multiplied by -> what keys of [signals] must be for that.
KeysOf = Callable[[Mapping[str, float]], Sequence[str]]


def scales(applied: Mapping[str, float], more: Mapping[str, float]) -> list[str]:
    """Those keys where nothing but factors is in [signals]."""
    keys = {name: f"{name}_{'sign' if name == 'u' else 'scale'}" for name in more}
    return [f"signals.{keys[name]} = {applied.get(name, 1.0) * factor:.6g}" for name, factor in more.items()]
