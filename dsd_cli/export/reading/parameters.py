"""Values by name: the CSV of `dsd export --to parameters`, and lines such as `coulomb_friction.level = 0.15`, as the
parameter files of grey-box models (MATLAB's idnlgrey) have them."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dsd_cli.effects import find_effect
from dsd_cli.errors import DataError, UsageError
from dsd_cli.export.base import DELAY, INERTIA
from dsd_cli.export.reading.found import Found
from dsd_cli.plant.model import PlantModel
from dsd_cli.signals.units import Units

#: `name = value`, `name: value` or `name, value`, with a unit or a comment behind; a structure's name in front is cut.
_LINE = re.compile(r"\s*([A-Za-z_][\w.]*)\s*[=:,;\t]\s*([^\s;,%#]+)\s*[;,]?\s*(?:[%#/\[(A-Za-z].*)?")


def read(path: Path, text: str) -> Found:
    """Raises DataError : no value of a model in it, no inertia, or values that cannot be."""
    rows = list(_table(path, text) if text.startswith("part,parameter,value") else _lines(text))
    own: dict[str, float] = {}
    effects: dict[str, dict[str, Any]] = {}
    missed = []
    for where, name, value in rows:
        effect, _, parameter = name.rpartition(".")
        effect = effect.rpartition(".")[2]
        known = find_effect(effect)
        if parameter in (INERTIA, DELAY) and known is None:
            if not isinstance(value, int | float):
                raise DataError(f"{path}: {where}: {name[:60]}", "must be a number")
            own[parameter] = float(value)
        elif known is not None and parameter in {p.name for p in known.parameters}:
            numeric = known.parameter(parameter).numeric
            if not (isinstance(value, int | float) if numeric else isinstance(value, list | str)):
                wanted = "a number" if numeric else "a list or a word, as the table of `dsd export` has it"
                raise DataError(f"{path}: {where}: {name[:60]}", f"must be {wanted}")
            effects.setdefault(effect, {})[parameter] = value
        else:
            missed.append(f"{where}: {name[:60]}")
    if INERTIA not in own:
        raise DataError(f"{path}: no inertia in it", "one line must be: inertia = VALUE")
    try:
        model = PlantModel(own[INERTIA], own.get(DELAY, 0.0), effects)
    except (UsageError, TypeError, ValueError) as error:
        raise DataError(f"{path}: {error}") from None
    units = _units(text)
    notes = () if units.position else ("it does not say whether the axis slides (m) or turns (rad): taken to turn",)
    return Found(path.stem, units.position == "m", model, notes, tuple(missed), units)


def _units(text: str) -> Units:
    """Those of the inertia in the table of `dsd export`."""
    rows = csv.reader(text.splitlines()) if text.startswith("part,parameter,value,unit") else ()
    return next((Units.of_inertia(row[3].strip()) for row in rows if len(row) > 3 and row[0] == INERTIA), Units())


def _table(path: Path, text: str) -> Iterator[tuple[str, str, Any]]:
    for i, row in enumerate(csv.reader(text.splitlines()[1:]), 2):
        if len(row) < 3:
            raise DataError(f"{path}: line {i}", "must be part,parameter,value,unit,meaning")
        yield f"line {i}", f"{row[0]}.{row[1]}" if row[1] else row[0], _value(row[2])


def _lines(text: str) -> Iterator[tuple[str, str, Any]]:
    for i, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip()[0] in "%#/[":
            continue
        found = _LINE.fullmatch(line)
        yield f"line {i}", found[1] if found else line.strip(), _value(found[2]) if found else None


def _value(text: str) -> Any:
    """A number or a list (JSON); None where it is neither."""
    try:
        return json.loads(text, parse_constant=lambda _: None)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError:
        return None
