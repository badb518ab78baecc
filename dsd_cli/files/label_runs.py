"""Rows that words in them split into recordings, one after the other: of several motors, of a direction each."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from dsd_cli.errors import printable, source_name
from dsd_cli.files.arrow_arrays import as_float64, is_number_type, texts_of
from dsd_cli.files.formats.long_form import are_names
from dsd_cli.files.recognise import is_time

#: So many words are shown.
SHOWN = 4


def split_note(path: str, columns: Mapping[str, Any], delimiter: str = "") -> str:
    """What to say where a time begins anew each time that words change; "" where it does not.

    delimiter : of the fields of a text file.
    """
    said = {name: texts_of(column) for name, column in columns.items()}
    labels = {name: [cell or "" for cell in cells] for name, cells in said.items() if cells and are_names(cells)}
    times = [as_float64(column) for name, column in columns.items() if is_time(name) and is_number_type(column.type)]
    labels = {name: cells for name, cells in labels.items() if len(set(cells)) > 1}
    if not labels or not times:
        return ""
    back = np.flatnonzero(np.diff(times[0]) < 0.0)
    new = np.array([a != b for a, b in pairwise(zip(*labels.values(), strict=True))])
    if not back.size or not new[back].all():
        return ""
    words = {name: list(dict.fromkeys(cells)) for name, cells in labels.items()}
    listed = [f"{name} ({', '.join(found[:SHOWN])}{', ...' * (len(found) > SHOWN)})" for name, found in words.items()]
    name, (first, *_) = next(iter(words.items()))
    one = f'NR == 1 || ${list(columns).index(name) + 1} == "{first}"'
    command = f"awk -F {shlex.quote(delimiter)} {shlex.quote(one)} {shlex.quote(source_name(path))} > one.csv"
    how = f"; of one axis alone: {command}" if _is_plain(path, columns, delimiter) else ""
    return printable(f"{' and '.join(listed)} split its rows into {back.size + 1} recordings, read as of one axis{how}")


def _is_plain(path: str, columns: Mapping[str, Any], delimiter: str) -> bool:
    """Whether the names are the first line of a text file, and nothing is in quotes: a filter by lines says so."""
    try:
        with open(path, encoding="utf-8") as file:
            names, row = file.readline(), file.readline()
    except (OSError, UnicodeDecodeError):
        return False
    return delimiter in (",", ";") and names.rstrip("\r\n") == delimiter.join(columns) and '"' not in row
