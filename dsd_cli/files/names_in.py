"""The words and the unit in the name of a column."""

from __future__ import annotations

import re
from collections.abc import Collection

from dsd_cli.files.words import (
    ANGLES,
    ASKED,
    COUNTS,
    ELSE,
    MEASURED,
    NAMED,
    OBJECTS,
    OF_U,
    OTHER_UNITS,
    TIME_UNITS,
    WORDS,
    plain_unit,
    whole_unit,
)

IN_BRACKETS = re.compile(r"[\[(<]\s*([^\])>]*?)\s*[\])>]")
_NUMBER = re.compile(r"(?:/\d+|\s*[\[(]\d+[\])])+$")
#: What a simulator of circuits calls a voltage or current that stands for something else: V(torque).
_PROBE = re.compile(r"[VI]\(([A-Za-z_]\w*)\)")
#: Columns of several levels as pandas writes them to Parquet: ('motor', 'iq_A').
_LEVEL = re.compile("'([^']*)'")
_LEVELS = re.compile(rf"\({_LEVEL.pattern}(?:, {_LEVEL.pattern})+\)")
#: A number in hexadecimal, as of an object: 0x6077, 6077h.
HEX = re.compile(r"0x[0-9a-fA-F]+|\b[0-9a-fA-F]{4}h\b")
#: Letters and short words have no plural that says anything.
_LETTERS = 3
#: At the end of a name it measures something.
_METERS = (["meter"], ["metre"])
#: What the time of one channel is called below it.
_CLOCK = "time"
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|°|[\u3041-\u30ff\u4e00-\u9fff]+")
#: `quantity in unit`
_IN = re.compile(r" in (\S+)\s*$")
#: `quantity / unit`, as standards write it.
OVER = re.compile(r"\s/\s*(\S.*?)\s*$")
#: Words written together: of languages without blanks the known ones, of German what it is that is asked for or is so.
_TOGETHER = re.compile(
    "|".join(word for words in (*WORDS.values(), ASKED, MEASURED, ELSE) for word in words if not word.isascii())
)
_COMPOUND = re.compile(
    r"(ist|soll)?\w*?(drehmoment|kraft|strom|drehzahl|geschwindigkeit|winkel|position|lage|zeit)(?:(ist|soll)wert)?"
)


def is_unit(text: str) -> bool:
    """Whether a text is the name of a unit, in brackets or not."""
    unit = whole_unit(text.strip().strip("[]()"))
    known = (TIME_UNITS, OF_U, *NAMED.values(), OTHER_UNITS)
    return any(unit in table for table in known)


#: Words that have a plural in names of arrays: torques, velocities.
_KNOWN = {word for words in (*WORDS.values(), ASKED, MEASURED, ELSE) for word in words}


def words_in(name: str) -> list[str]:
    """The words in a name, small, and as one of what they are the names of."""
    found: list[str] = []
    for word in map(str.lower, _WORD.findall(name)):
        parts = _COMPOUND.fullmatch(word)
        one = _singular(word)
        found += _TOGETHER.findall(word) or ([part for part in parts.groups() if part] if parts else [one])
    return found


def _singular(word: str) -> str:
    if word in _KNOWN or not word.endswith("s"):
        return word
    ones = (word[:-1], f"{word[:-3]}y" if word.endswith("ies") else "")
    return next((one for one in ones if one in _KNOWN and len(one) > _LETTERS), word)


def unit_in(name: str, channel: str) -> str:
    """The unit at the end of a name: in brackets, or as its last words; empty without one.

    The number of a column of a matrix is no part of it: pos_deg/1, pos_deg[1]; nor is the unit of a channel that of
    its clock: torque [Nm]/time.
    """
    if channel == "time" and name.endswith(f"/{_CLOCK}"):
        return ""
    name = _NUMBER.sub("", plain_name(name))
    inside = bracketed(name)
    if (said := _IN.search(name)) and is_unit(said[1]):
        return str(said[1]).strip("[]()")
    if inside:
        return str(inside[-1])
    if (over := OVER.search(name)) and is_unit(over[1].partition(" ")[0]):
        return str(over[1]).partition(" ")[0]
    moves = COUNTS | NAMED.get(channel, {}).keys()
    known: Collection[str] = TIME_UNITS if channel == "time" else OF_U if channel == "u" else moves
    *path, last = name.split("/")
    if len(path) > 1 and (whole := plain_unit(last.replace("-per-", "/"))) in known:  # actual/vel/mm-per-min of ctrlX
        return whole
    if re.search(r"\.\w$", last):
        return ""  # IqCmd.a of a controller is an address
    if channel != "time" and len(last) > 1 and plain_unit(last) in known:
        return last  # rpm, volt, counts: nothing but a unit; one letter is a name
    *before, unit = re.split(r"[_\s]", last)
    if channel == "u" and any(before) and unit.lower() in OF_U:
        return unit  # mNm is one word
    words = [word for word in words_in(last) if word != "per"]
    if words[-1:] in _METERS or (words[-1:] == ["m"] and not ANGLES.isdisjoint(words)):
        return ""
    for many in (2, 1):
        if len(words) > many and (last := plain_unit("/".join(words[-many:]))) in known:  # RadPerSec
            return last
    return words[-1] if words and words[-1] == "rpm" and channel == "velocity" else ""


def unit_of_object(name: str) -> str:
    """The unit of the object of a drive whose number stands in the name."""
    numbers = (one.removeprefix("0x").removesuffix("h").lower() for one in HEX.findall(name))
    return next((OBJECTS[one] for one in numbers if one in OBJECTS), "")


def bracketed(name: str) -> list[str]:
    """What may be a unit of what stands in brackets: no number, no word, no object, and nothing ahead of a name.

    r79[0] (Lage); [0x6077]; [ID:001] Present Position.
    """
    found = [one for one in IN_BRACKETS.finditer(name) if one.start() > 0 or one.end() == len(name)]
    return [one[1] for one in found if not (one[1].isdigit() or is_named(one[1]) or HEX.match(one[1]))]


def is_named(text: str) -> bool:
    """Whether there is a word of a channel in it: `r63 (Drehzahlistwert)`."""
    words = {word for word in words_in(text) if len(word) > 2}
    return not is_unit(text) and any(
        not words.isdisjoint(WORDS[channel]) for channel in ("time", "u", "velocity", "position")
    )


def plain_name(name: str) -> str:
    """The name, of a probe of a circuit what is probed, of columns of pandas below others their path."""
    if _LEVELS.fullmatch(name):
        return "/".join(one for one in _LEVEL.findall(name) if one)
    probe = _PROBE.fullmatch(name.strip())
    return probe[1] if probe and not is_unit(probe[1]) else name
