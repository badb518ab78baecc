"""What channels and units are called in logs: the words of trades and languages."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

#: Channel -> words that name it, best first.
WORDS: Mapping[str, tuple[str, ...]] = {
    "time": (
        "t", "time", "timestamp", "stamp", "zeit", "seconds", "sec", "clock", "ms", "millis", "us", "micros",
        "temps", "tempo", "tiempo", "時間", "时间", "ts",
    ),
    "d_hat": ("dhat", "disturbance", "dist", "dob", "stoerung"),
    "u": (
        "u", "iq", "torque", "trq", "effort", "current", "amps", "force", "voltage", "moment", "strom", "drehmoment",
        "kraft", "tau", "control", "input", "thrust", "volts", "duty", "pwm", "couple", "courant", "coppia", "corrente",
        "corriente", "voltaje", "トルク", "電流", "推力", "转矩", "扭矩", "电流",
    ),
    "velocity": (
        "velocity", "vel", "speed", "v", "omega", "w", "rpm", "qd", "dq", "dtheta", "thetadot", "drehzahl",
        "geschwindigkeit", "rate", "erpm", "vitesse", "velocita", "velocidad", "速度", "回転数", "转速",
        "qvel",
    ),
    "position": (
        "position", "pos", "q", "theta", "angle", "encoder", "enc", "phi", "x", "winkel", "lage", "displacement",
        "posizione", "posicion", "位置", "角度", "qpos",
    ),
}  # fmt: skip
#: Those of a position that are an angle, which has no unit of length: theta_m is that of the motor.
ANGLES = {"q", "theta", "angle", "phi", "winkel", "角度"}
#: Those of u that are a torque or a force, and nothing that makes one.
OF_FORCE = {
    "torque", "trq", "effort", "force", "moment", "drehmoment", "kraft", "tau", "thrust", "couple", "coppia",
    "トルク", "推力", "转矩", "扭矩",
}  # fmt: skip
#: Words of what was asked for, not measured.
ASKED = {
    "ref", "reference", "set", "setpoint", "target", "desired", "des", "soll", "cmd", "command", "demand", "goal",
    "commanded", "demanded", "requested",
    "指令",
}  # fmt: skip
#: And one of them in short, of a name with more words.
SHORT_SETPOINT = "sp"
#: Words of u that with a motion in the name say whose input it is: input_pos is asked for.
GENERAL = {"u", "control", "input"}
#: Those of them that by themselves may be u as well.
COMMANDS = {"cmd", "command", "demand"}
#: Of what was measured.
MEASURED = {
    "act",
    "actual",
    "meas",
    "measured",
    "msr",
    "ist",
    "fb",
    "fbk",
    "feedback",
    "real",
    "motor",
    "filtered",
    "filt",
    "实际",
}
#: Words of whose a motion is, before its letter.
OWNERS = {"axis", "joint", "achse", "gelenk"}
#: Of a force that comes from outside, as a robot estimates it: less of a u than the torque of its drive.
OUTER = {"ext", "external"}
#: Words that make a column of another thing whatever else it is called: errors, limits, other axes' business.
ELSE = {"limit", "max", "min", "status", "id", "index", "count", "mode", "true"}
#: Of what a controller is to take away.
ERRORS = {"error", "err", "deviation", "droop", "regelabweichung", "schleppabstand", "schleppfehler", "偏差"}
#: Words and units of what neither moves an axis nor is its motion.
HEAT, OF_HEAT = {"temp", "temperature", "temperatur", "temperatura"}, {"c", "°c", "degc", "°f", "degf", "k"}
#: Words and units of what a force makes of a motion.
ACCELERATION = {"acc", "accel", "acceleration", "beschleunigung", "qdd", "ddq", "accelerazione", "加速度"}
OF_ACCELERATION = {f"{unit}/s{square}" for unit in ("m", "mm", "rad", "deg", "°") for square in ("²", "^2", "2")} | {
    "g"
}
#: Words of what feeds a drive, which no motion follows.
SUPPLY = {"battery", "batt", "bms", "bus", "vbus", "supply", "psu", "vcc", "vdc", "zwischenkreis"}
ELSE |= ERRORS | SUPPLY | HEAT

#: What axes are called after where they point or stand: the whole name of a position, and of nothing else a part.
PLACES = {"pan", "tilt", "yaw", "pitch", "roll", "azimuth", "elevation", "heading", "height", "stroke"}

#: Words of a column that counts the rows.
COUNTERS = {"n", "k", "i", "nr", "no", "row", "index", "idx", "count", "counter", "sample", "samples", "id", "cycle"}
#: What holds quaternions, and what their parts are called where nothing says so: no places and no speeds.
QUATERNIONS, PARTS = {"orientation", "quaternion", "quat", "rotation"}, {"qx", "qy", "qz", "qw"}
#: More words of columns that make nothing move: places and stamps.
IDLE = {"pose", "translation", "stamp"}

#: Unit of a time -> its name in the config.
TIME_UNITS = {"100ns": "100ns"} | {
    word: unit
    for unit, short, long in (("s", "", ""), ("ms", "m", "milli"), ("us", "u", "micro"), ("ns", "n", "nano"))
    for word in (unit, f"{short}sec", f"{long}s", *(f"{long}{one}" for one in ("sec", "secs", "second", "seconds")))
}
#: Channel -> unit in a log -> what the config calls it; of u with what its column is multiplied by.
NAMED: Mapping[str, Mapping[str, str]] = {
    "position": {
        "rad": "rad", "m": "m", "deg": "deg", "°": "deg", "degree": "deg", "degrees": "deg", "mm": "mm", "um": "um",
        "rev": "turn", "turn": "turn", "turns": "turn", "grad": "deg", "umdr": "turn", "mrad": "mrad", "cm": "cm",
        "rot": "turn",
    },
    "velocity": {
        "rad/s": "rad/s", "m/s": "m/s", "deg/s": "deg/s", "°/s": "deg/s", "mm/s": "mm/s", "um/s": "um/s", "rpm": "rpm",
        "r/min": "rpm", "1/min": "rpm", "rev/s": "turn/s", "turn/s": "turn/s", "turns/s": "turn/s", "hz": "turn/s",
        "grad/s": "deg/s", "u/min": "rpm", "umdr/min": "rpm", "min-1": "rpm", "min^-1": "rpm", "u/s": "turn/s",
        "mrad/s": "mrad/s", "cm/s": "cm/s", "tr/min": "rpm", "giri/min": "rpm", "rev/min": "rpm", "rot/s": "turn/s",
        "m/min": "m/min", "mm/min": "mm/min",
    },
}  # fmt: skip
OF_U: Mapping[str, tuple[str, float]] = {
    "a": ("A", 1.0), "ma": ("A", 1e-3), "nm": ("N m", 1.0), "n m": ("N m", 1.0), "n*m": ("N m", 1.0),
    "mnm": ("N m", 1e-3), "n": ("N", 1.0), "v": ("V", 1.0), "mv": ("V", 1e-3), "kn": ("N", 1e3), "knm": ("N m", 1e3),
    "volt": ("V", 1.0), "volts": ("V", 1.0), "amp": ("A", 1.0), "amps": ("A", 1.0),
    "ampere": ("A", 1.0), "amperes": ("A", 1.0), "arms": ("A", 1.0), "apk": ("A", 1.0),
    "%": ("%", 1.0), "‰": ("%", 0.1),
}  # fmt: skip
#: What says nothing of what it is a share of; `% of rated torque`, and `0.1 %` of a drive's own scale.
SHARES = {"%", "‰"}
_OF_RATED = r"( ?(of )?(the )?\(?(rated|nominal|max|peak|full|fs|nenn|in\b|mn\b).*)?"
_SHARE = re.compile(r"(%|‰|0[.,]1 ?%|per ?mille?|1/1000)" + _OF_RATED)
#: Objects of a drive (CiA 402) -> their unit: shares of what it is rated for, and places and speeds, which are in
#: increments where nobody changed that.
OBJECTS = {f"60{end}": "‰" for end in ("71", "72", "73", "74", "77", "78")}
OBJECTS |= {f"60{end}": "inc" for end in ("62", "64", "67", "7a")} | {f"60{end}": "inc/s" for end in ("6b", "6c", "ff")}
#: Units of an encoder, whose resolution no log says.
COUNTS = {
    "inc", "incr", "increments", "inkr", "count", "counts", "cnt", "cts", "qc", "pulse", "pulses", "ticks", "steps",
}  # fmt: skip
COUNTS_PER_S = {"cps", *(f"{one}/s" for one in COUNTS)}
COUNTS |= COUNTS_PER_S
#: Those that a converter of voltages does not count in.
OF_ENCODER = COUNTS - {"count", "counts", "cnt", "cts"}
#: What else stands in a row of units.
OTHER_UNITS = COUNTS | {
    "%", "-", "1", "c", "°c", "degc", "k", "w", "kw", "bar", "kg", "hz", "khz", "min", "h", "g", "db", "bit", "bool",
    "m/s^2", "m/s²", "m/s2", "mm/s²", "mm/s^2", "rad/s²", "rad/s^2", "deg/s²", "°/s²", "mdeg", "in", "ft", "lbf", "arb",
    "sequence", "second", "seconds", "milliseconds", "[-]",
}  # fmt: skip


#: `0.1 r/min`, as drives call what they count in.
_PART = re.compile(r"(?:(0?[.,]\d+|1e-\d+)|1/(10+))\s*\*?\s*([^\d\s].*)")


def parts_of(unit: str) -> tuple[float, str]:
    """What of which a unit is: 0.1 and r/min of `0.1 r/min`, as of `1/10 r/min`."""
    found = None if _SHARE.fullmatch(unit.strip().lower()) else _PART.fullmatch(unit.strip())
    if found is None:
        return 1.0, unit
    return (1.0 / float(found[2]) if found[2] else float(found[1].replace(",", "."))), found[3]


def whole_unit(unit: str) -> str:
    """The unit of which this one is a part, as the tables have it."""
    return plain_unit(parts_of(unit)[1])


#: Units in whole words -> their signs; a prefix stands before those of metres and of what u is.
_PREFIXES = {"micro": "u", "milli": "m", "centi": "c", "kilo": "k", "": ""}
_SPELLED = {"newton": "n", "ampere": "a", "amp": "a", "volt": "v", "meter": "m", "metre": "m", "radian": "rad"}
_SIGNS = {f"{prefix}{word}": f"{_PREFIXES[prefix]}{sign}" for prefix in _PREFIXES for word, sign in _SPELLED.items()}
_SIGNS |= {"degree": "deg", "revolution": "rev", "rotation": "rot", "micron": "um"}
_IN_WORDS = re.compile(rf"({'|'.join(sorted(_SIGNS, key=len, reverse=True))})s?")
_PER = re.compile(r"\s*(?:/|\bper\b)\s*(?:(s|secs?|seconds?)|(min|minutes?))\b")


def _in_signs(text: str) -> str:
    """`micrometers` as um, `newton-metres` as nm, `revolutions per minute` as rev/min."""
    whole, per = _PER.sub("", text, count=1), _PER.search(text)  # a second one stays: an acceleration is no speed
    words = re.split(r"[\s*-]+", whole)
    if not all(map(_IN_WORDS.fullmatch, words)):
        return _PER.sub(lambda one: "/s" if one[1] else "/min", text) if per else text
    signs = "".join(_SIGNS[one if one in _SIGNS else one.removesuffix("s")] for one in words)
    return signs + ("" if per is None else "/s" if per[1] else "/min")


def plain_unit(unit: str) -> str:
    """A unit as the tables have it, whose key it may be: `N·m` and `N.m` are n*m, `µm` is um, `rad/sec` rad/s.

    `0.1 %` and `‰ of rated torque` are ‰.
    """
    text = unit.strip().lower().replace("·", "*").replace("⋅", "*").replace("n.m", "n*m")
    if share := _SHARE.fullmatch(text):
        return "%" if share[1] == "%" else "‰"
    return _in_signs(text.replace("µ", "u").replace("μ", "u")).replace("/sec", "/s")


def quaternions(names: Collection[str]) -> set[str]:
    """Those that are the four numbers of an orientation, all of which are there: none is the angle of an axis."""
    parts: dict[str, dict[str, str]] = {}
    for name in names:
        group, _, last = name.lower().rpartition("/")
        if last in PARTS or (len(last) == 1 and last in "xyzw" and group.rpartition("/")[2] in QUATERNIONS):
            parts.setdefault(group, {})[last[-1]] = name
    return {name for part in parts.values() if len(part) == len(PARTS) for name in part.values()}
