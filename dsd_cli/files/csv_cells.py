"""What a cell of a text file says: numbers in the ways people and tools write them, stamps, and nothing."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dsd_cli.files.names_in import is_unit
from dsd_cli.signals.log import Array

#: What loggers write where there is no value; "nan" and "inf" are numbers to both parsers.
MISSING = frozenset(
    f"{pad}{token}"
    for pad in ("", " ")
    for token in (
        "", "NA", "N/A", "n/a", "na", "#N/A", "null", "NULL", "Null", "None", "none", "-", "--", "?",
        "-nan", "-NaN", "-nan(ind)", "nan(ind)", "1.#QNAN", "-1.#IND", "1.#INF", "-1.#INF",
    )
)  # fmt: skip
#: Digits of the numbers of 16, 32 and 64 bits in base 16: only these have a sign.
WIDTHS = (4, 8, 16)
#: The sign of typesetters.
MINUS = "\u2212"
_HEX = re.compile(r"0[xX][0-9a-fA-F]{1,16}")
#: A number with or without thousands apart, and a unit; and one that may be of some thousands.
_BLANK = " \u00a0\u202f"
_SPELT = re.compile(
    rf"([-+]?(?:\d[\d.,'\u2019{_BLANK}]*|[.,]\d+)(?:[eE][-+]?\d+)?)[{_BLANK}]*([^\s\d.,'\u2019+-].*)?", re.ASCII
)
LARGE = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}")
_LONE = re.compile(r"\s*([-+]?\d*([.,])\d+(?:[eE][-+]?\d+)?)(?![\d.,])")
DECIMAL_COMMA = re.compile(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*")
#: A zone behind another one, as mosquitto_sub writes it: 12:00:00.5Z+0000 is of that offset.
TWO_ZONES = re.compile(r"Z(?=[-+]\d)")
ISO_TIME = re.compile(r"\s*\d{4}-\d\d-\d\d[ T]\d\d:\d\d")
SPOKEN_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "min": 60.0, "hr": 3600.0}
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
#: `0.004 sec`; [31.12.2024, 12/31/2024, 2024/12/31, 31-Dec-2024 or 2 days] 23:59:59.999 [PM].
SPOKEN_TIME = re.compile(
    r"\s*(?:([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s?(s|sec|ms|msec|us|min|hr)"
    r"|(?:(\d{1,2}\.\d{1,2}\.\d{4})[ T]|(\d{1,2}/\d{1,2}/\d{4}) |(\d{4}/\d{1,2}/\d{1,2}) "
    r"|(\d{1,2}-[A-Za-z]{3}-\d{4}) )?"
    r"(?:(\d+) days? )?(\d{1,3}):(\d\d):(\d\d(?:[.,;]\d+)?) ?([AaPp][Mm])?)\s*"
)


class Written(NamedTuple):
    """How a column writes its numbers: what stands between thousands, the decimal sign, and a unit behind them.

    `digits`: in base 16, of so many digits as two's complement where that is a width of numbers; 0: in base 10.
    """

    thousands: str = ""
    decimal: str = "."
    unit: str = ""
    digits: int = 0

    def __str__(self) -> str:
        if self.digits:
            return "in base 16"
        large, unit = f"1{self.thousands}234{self.decimal}5" if self.thousands else f"1234{self.decimal}5", self.unit
        return f"as {large}{unit and f' {unit}'}"

    def value(self, text: str) -> float:
        """Of a cell, NaN where there is none.

        Raises
        ------
        ValueError : it is not written so.
        """
        text = _signed(text)
        if text in MISSING:
            return math.nan
        if self.digits:
            if _HEX.fullmatch(text) is None:
                raise ValueError(text)
            value, bits = int(text, 16), 4 * self.digits
            return float(value - (1 << bits) * (self.digits in WIDTHS and value >> (bits - 1)))
        found = _SPELT.fullmatch(text)
        if found is None or (found[2] or "") != self.unit or not self._grouped.fullmatch(found[1].strip()):
            raise ValueError(text)
        return float(found[1].strip().replace(self.thousands, "").replace(self.decimal, "."))

    @property
    def _grouped(self) -> re.Pattern[str]:
        return _grouped(self.thousands, self.decimal)


#: Of a file whose decimals are commas.
THOUSANDS = Written(".", ",")


def _signed(text: str) -> str:
    """With a sign as programs write it, right before the digits: `+ 1.5` of a recorder has it apart."""
    text = text.strip().replace(MINUS, "-")
    return text[0] + text[1:].lstrip() if text[:1] in ("+", "-") else text


@cache
def _grouped(thousands: str, decimal: str) -> re.Pattern[str]:
    whole = rf"(?:\d{{1,3}}(?:{re.escape(thousands)}\d{{3}})+|\d+)" if thousands else r"\d+"
    sign = re.escape(decimal)
    return re.compile(rf"[-+]?(?:{whole}(?:{sign}\d*)?|{sign}\d+)(?:[eE][-+]?\d+)?")


def decimal_signs(cells: Iterable[str]) -> set[str]:
    """The signs that can stand between no thousands: of a file these are decimal in every column of it."""
    found = filter(None, map(_LONE.match, cells))
    return {one[2] for one in found if not LARGE.fullmatch(one[1])}


def written(cells: Iterable[str], decimal: Collection[str] = ()) -> Written | None:
    """How numbers are written that have a unit, thousands apart or base 16; None: they have not, or are none.

    `decimal`: signs that are decimal where one alone could be either, see `decimal_signs`.
    """
    given = [text for cell in cells if (text := cell.strip()) not in MISSING]
    there = [*map(_signed, given)]
    with suppress(ValueError):
        if all(math.isfinite(float(text)) for text in there):  # nearly all columns
            return None if there == given else Written()
    if there and all(map(_HEX.fullmatch, there)):
        digits = max(len(text) - 2 for text in there)
        return Written(digits=digits if digits in WIDTHS and _goes_below_zero(there, 4 * digits) else 1)
    found = [_SPELT.fullmatch(text) for text in there]
    units = {one[2] or "" for one in found if one is not None}
    if None in found or len(units) != 1:
        return None
    (unit,) = units
    if unit and (not is_unit(unit) or unit.lower() in SPOKEN_UNITS):  # a time is in s
        return None
    how = Written(*_signs([one[1].strip() for one in found if one is not None], decimal), unit)
    try:
        for text in there:
            how.value(text)
    except ValueError:
        return None
    return how if unit or how.thousands or there != given else None


def _goes_below_zero(there: Sequence[str], bits: int) -> bool:
    """Whether numbers in base 16, with or without zeros before them, make no larger steps as two's complement."""
    plain = [int(text, 16) for text in there]
    signed = [value - (1 << bits) * (value >> (bits - 1)) for value in plain]
    usual, other = (max((abs(b - a) for a, b in pairwise(one)), default=0) for one in (signed, plain))
    return usual <= other


def _signs(numbers: Sequence[str], decimal: Collection[str]) -> tuple[str, str]:
    """(what stands between thousands, the decimal sign); a lone sign is decimal, if not only larger numbers have it.

    A step from 0 to 1,125 is no other than that where other columns say what the sign is.
    """
    blank = next((sign for text in numbers for sign in text if sign in f"'\u2019{_BLANK}"), "")
    if blank:
        return blank, "," if any("," in text for text in numbers) else "."
    for text in numbers:
        if "." in text and "," in text:
            return (",", ".") if text.rindex(".") > text.rindex(",") else (".", ",")
        for sign, other in ((",", "."), (".", ",")):
            if text.count(sign) > 1:
                return sign, other
    for sign, other in ((",", "."), (".", ",")):
        large = [text for text in numbers if sign in text]
        small = [text.lstrip("+-") for text in numbers if sign not in text]
        if sign in decimal:
            continue
        if large and all(LARGE.fullmatch(text) for text in large) and small and all(len(text) < 4 for text in small):
            return sign, other
    return "", "," if any("," in text for text in numbers) else "."


def number(text: str) -> float:
    """The value of a cell by itself, NaN for a missing one: a stamp in s, or a number in whatever way it is written.

    Raises
    ------
    ValueError : it is neither.
    """
    try:
        return seconds(text)
    except ValueError:
        if (how := written([text])) is None:
            raise
        return how.value(text)


def plain_number(text: str) -> float:
    """The value of digits with a decimal sign alone, point or comma; NaN for a missing one.

    Raises
    ------
    ValueError : it is not a number.
    """
    try:
        if "_" in text or not text.isascii():  # 1_000 is a number to Python, and to nobody who writes logs
            raise ValueError
        return float(text)
    except ValueError:
        if text.strip() in MISSING:
            return math.nan
        if DECIMAL_COMMA.fullmatch(text):
            return float(text.replace(",", "."))
        raise


def seconds(text: str) -> float:
    """A time stamp: a number, or a date and time (taken as UTC without a zone) as seconds since 1970.

    Dates are ISO 8601, 31.12.2024, 12/31/2024, 2024/12/31 or 31-Dec-2024; hours with minutes and seconds alone, and
    `0.004 sec`, are durations.

    Raises
    ------
    ValueError : it is none of these.
    """
    if ISO_TIME.match(text):
        stamp = _iso(text)
        return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    if (found := SPOKEN_TIME.fullmatch(text)) is None:
        return plain_number(text)
    value, unit, dotted, slashed, from_year, spelt, days, hours, minutes, rest, half = found.groups()
    if unit:
        return (how.value if (how := written([value])) else plain_number)(value) * SPOKEN_UNITS[unit.lower()]
    day = 86400.0 * int(days or 0)
    if date := dotted or slashed or from_year or spelt:
        parts = [MONTHS.index(one.lower()) + 1 if one.isalpha() else int(one) for one in re.split(r"[./-]", date)]
        parts = parts if from_year else [parts[2], parts[0], parts[1]] if slashed else parts[::-1]
        year, month, of_month = parts
        day = datetime(year, month, of_month, tzinfo=UTC).timestamp()
    hour = int(hours) % 12 + 12 * (half.lower() == "pm") if half else int(hours)
    return day + 3600.0 * hour + 60.0 * int(minutes) + plain_number(rest.replace(";", "."))


def _iso(text: str) -> datetime:
    return datetime.fromisoformat(TWO_ZONES.sub("", text.strip()))


def is_stamp(text: str) -> bool:
    """Whether a cell says of itself that it is a time, which is read in s."""
    return ISO_TIME.match(text) is not None or SPOKEN_TIME.fullmatch(text) is not None


def has_zone(text: str) -> bool:
    """Whether a time stamp says its time zone; what looks like one and is no time (23:59:60) does not."""
    try:
        return _iso(text).tzinfo is not None
    except ValueError:
        return False


def is_number(text: str) -> bool:
    try:
        number(text)
    except ValueError:
        return False
    return True


def is_plain(cell: str) -> bool:
    """Whether it is a number and no date, nor a number with its unit."""
    try:
        return math.isfinite(plain_number(cell))
    except ValueError:
        return False


def is_large(cell: str) -> bool:
    """Whether a point stands before three digits in it, as between thousands."""
    try:
        return "." in cell and math.isfinite(THOUSANDS.value(cell))
    except ValueError:
        return False


def stamps_in(texts: Sequence[str | None], spoiled: float = 0.0) -> Array | None:
    """Stamps in words as s, and numbers; None: they are something else.

    spoiled : share of the texts, behind the first, that may be anything; NaN.
    """
    there = [text for text in texts if text is not None and text.strip() not in MISSING]
    if not there or not all(map(is_number, there[:20])):
        return None
    how = written(there)
    read = seconds if how is None else how.value
    found, wrong = np.full(len(texts), np.nan), 0
    for k, text in enumerate(texts):
        try:
            found[k] = math.nan if text is None else read(text)
        except ValueError:
            wrong += 1
    return found if wrong <= spoiled * len(there) else None
