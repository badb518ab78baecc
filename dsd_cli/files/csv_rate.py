"""How far apart the rows of a text file are, as the lines above its numbers say it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from dsd_cli.files.csv_cells import MISSING, is_number, number
from dsd_cli.files.csv_layout import Found
from dsd_cli.files.words import TIME_UNITS, plain_unit
from dsd_cli.signals.clock import FASTEST, SLOWEST, TIME_SCALE

_TIME = f"(?:{'|'.join(sorted({*TIME_UNITS, 'µs', 'µsec'} - {'100ns'}, reverse=True))})"
#: What a preamble calls the time from row to row, or how many there are in a second; the unit before or after a number.
_VALUE = r"[ _a-z]*[\[(]?({0})?[\])]?[\"\s:;,=]+([.,]?\d+(?:[.,]\d+)*(?:e[-+]?\d+)?)(?:[\s\"\'\[(,;]*({0})\b)?"
_INTERVAL, _RATE = (
    re.compile(names + _VALUE.format(units), re.IGNORECASE)
    for names, units in (
        (
            r"(?:sampl\w*[ _]?(?:time|interval|period|cycle)|abtastzeit|trace period|delta_?x|h_?resolution|\binterval"
            rf"|\bsampling(?=\W+(?:[\d.,]+\s*)?{_TIME}\b))",
            _TIME,
        ),
        (
            r"(?:sampl\w*[ _]?(?:rate|freq\w*)|abtast(?:rate|frequenz)|\bfs(?=\W.*hz)|\bsampling(?=\W+[\d.,]+\s*k?hz))",
            "hz|khz",
        ),
    )
)
_HERTZ = {"hz": 1.0, "khz": 1e3}


def sample_time_of(lines: Sequence[str], found: Found) -> float | None:
    """s from row to row, as what stands above the numbers says it; None: it does not."""
    units = dict(zip(map(str.casefold, found.header.names), found.units or (), strict=False))
    if is_number(text := units.get("increment", "-")) and text.strip() not in MISSING:
        return float(text)
    for line in lines[: found.skip]:
        for kind in (_INTERVAL, _RATE):
            if (said := kind.search(line)) and is_number(said[2]) and (value := number(said[2])) > 0.0:
                unit = said[1] or said[3]
                named = plain_unit(unit or ("s" if kind is _INTERVAL else "hz"))
                seconds = value * TIME_SCALE[TIME_UNITS[named]] if kind is _INTERVAL else 1.0 / (value * _HERTZ[named])
                if unit or FASTEST <= seconds <= SLOWEST:  # `Sampling time; 500` may be us
                    return seconds
    return None
