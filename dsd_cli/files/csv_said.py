"""What a row above the numbers of a text file says of its channels, where that is not their names."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from dsd_cli.files.csv_cells import MISSING, is_number, number
from dsd_cli.files.names_in import is_unit

#: What a row says of each channel -> what it, or each of its cells, is called.
KEYS: Mapping[str, tuple[str, ...]] = {
    "unit": (
        "unit", "units", "einheit", "einheiten", "y_unit_label", "symbolunit", "vunit", "trace_units", "vertical units",
    ),
    "factor": (
        "scale", "scaling", "scale factor", "scalefactor", "factor", "factors", "gain", "multiplier", "faktor",
        "skalierung", "skalierungsfaktor", "unit scalefactor",
    ),
    "offset": ("offset", "offsets", "unit offset"),
    "type": ("type", "datatype", "data type", "data-type", "datentyp", "interp", "blockpath", "portindex"),
}  # fmt: skip
#: `Type: double`, and what says it of one channel as of all: `dt = 0.001`.
_EACH = re.compile(r"([^\W\d][\w.]*)\s*([:=])\s*(.*)")
#: How numbers are held.
_TYPE = re.compile(
    r"[uif][1248]|u?int(?:8|16|32|64)?|u?[sdl]?int|l?real(?:32|64)?|float(?:32|64)?|double|single|bool(?:ean)?|bit"
    r"|long|short|l?d?word|byte|number|l?time",
    re.IGNORECASE,
)
#: A unit and its quantity: `° (Angle)`.
_OF_QUANTITY = re.compile(r"(\S+)\s+\([^()]*\)")


def key_of(cells: Sequence[str]) -> str:
    """What the first of these says, as the lists of keys have it."""
    return cells[0].strip().strip(':="').casefold() if cells else ""


def labelled(cells: Sequence[str]) -> str:
    """What a row says by its first cell: `Scale, 1, 0.001`; "": nothing, as `Gain, Phase`, which are names."""
    kind, rest = _kind(key_of(cells)), [cell.strip() for cell in cells[1:] if cell.strip() not in MISSING]
    if kind == "type":
        return kind if any(map(_TYPE.fullmatch, rest)) else ""
    return kind if any(map(is_unit if kind == "unit" else is_number, rest)) else ""


def kind_of(cells: Sequence[str]) -> str:
    """What a row says: a key of `KEYS`, "set" or "": it has names, or what was measured.

    By its first cell, by the key in each cell, or, of types and factors, by all of its cells: `TIME, DINT`;
    `1, 0.01, 0.1`.
    """
    there = [cell.strip() for cell in cells if cell.strip()]
    each = {one.group(1, 2) if (one := _EACH.fullmatch(cell)) else ("", "") for cell in there}
    if kind := labelled(cells):
        return kind
    if len(each) == 1 and (key := each.pop())[0]:
        return _kind(key[0].casefold()) if key[1] == ":" else "set" if len(there) > 1 else ""
    if len(there) > 1 and all(map(_TYPE.fullmatch, there)):
        return "type"
    return "factor" if are_tens(cells) else ""


def _kind(key: str) -> str:
    return next((kind for kind, keys in KEYS.items() if key in keys), "")


def are_tens(cells: Sequence[str]) -> bool:
    """Whether these are powers of ten alone and not all the same, as a row of factors without a label has them."""
    there = [number(cell) if is_number(cell) else math.nan for cell in cells if cell.strip()]
    tens = {x for x in there if 0.0 < x < math.inf and abs(math.log10(x) - round(math.log10(x))) < 1e-9}
    return len(there) > 1 + bool(cells[0].strip()) and len(tens) > 1 and tens == set(there)


def of_unit(cell: str) -> str:
    """The unit that a cell names, after its key if it has one."""
    said = _EACH.fullmatch(cell.strip())
    text = "" if key_of([cell]) in KEYS["unit"] else said[3] if said else cell
    text = text.strip().strip("[]").strip()
    quantity = _OF_QUANTITY.fullmatch(text)
    text = quantity[1] if quantity and is_unit(quantity[1]) else text.strip("()")
    return "" if text.casefold() == "none" else text
