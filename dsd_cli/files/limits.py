"""The limits of a passport: `limits.toml`, and the values of delivery that they are around."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dsd_cli.effects import is_angle
from dsd_cli.errors import UsageError
from dsd_cli.files.config import config_text, parse_tables
from dsd_cli.files.config.fitting import limits_of, named_values
from dsd_cli.files.config.rules import Place, Section, key, number, read_section, text
from dsd_cli.passport import RMSE, Limit, Reference

_WITHIN = 'a share of the value of delivery such as "20 %", or a number in the unit of the value'
_LIMIT = 'a text with at least one of within, min and max, such as "within 20 %, max 0.3"'
_WORD = re.compile(r"\s*(within|min|max)\s+(\S+?)\s*(%?)\s*")
#: Key of a passport that holds the hash of all others.
HASH = "sha256"


def _read_limit(value: Any, at: Place, name: str) -> Limit:
    """ "within 20 %", "min 0, max 0.3", "within 0.02": the words in any order."""
    low, high = (0.0, math.inf) if name == RMSE else limits_of(name, at)
    parts = [_WORD.fullmatch(part) for part in value.split(",")] if isinstance(value, str) else [None]
    found: dict[str, float] = {}
    relative = False
    for part in parts:
        if part is None or part[1] in found:
            raise at.wrong(value, _LIMIT)
        try:
            size = float(part[2])
        except ValueError:
            raise at.wrong(value, _LIMIT) from None
        if part[3] and part[1] != "within":
            raise at.refused(value, f"{part[1]} is a number in the unit of the value, without %")
        relative = relative or bool(part[3])
        found[part[1]] = float(number(lower=0.0 if part[1] == "within" else -math.inf).read(size, at))
    if relative and is_angle(name):
        raise at.refused(value, f'{name} is an angle: write the change in rad, such as "within 0.2"')
    limit = Limit(
        found.get("within", math.inf) / (100.0 if relative else 1.0),
        relative,
        found.get("min", -math.inf),
        found.get("max", math.inf),
    )
    if not (limit.lower <= limit.upper and limit.lower <= high and limit.upper >= low):
        raise at.refused(value, "no value is within")
    return limit


class Limits(Section):
    """`limits.toml`."""

    limits: Mapping[str, Limit] = named_values("what each value may be", _LIMIT, _read_limit)
    reference: str | None = key(
        text(), "the delivery: a passport (.json) or a config, as seen from this file; else the config", default=None
    )

    def check(self, at: Place) -> None:
        if not self.limits:
            raise UsageError(f"{at.file}: [limits] is missing or empty", 'such as: inertia = "within 10 %"')


def load_limits(path: Path) -> Limits:
    """Raises UsageError : no such file, not TOML, or not valid limits."""
    hint = "docs/passport.md says what is in it"
    tables = parse_tables(config_text(path, "file of limits", hint), str(path))
    return read_section(Limits, tables, Place(str(path)))


def load_passport(path: Path) -> dict[str, Any]:
    """A passport that was written before.

    Raises
    ------
    UsageError : no such file, no passport, or one that was changed after it was written.
    """
    try:
        found = json.loads(config_text(path, "passport"))
    except (ValueError, RecursionError):
        raise UsageError(f"{path}: is no passport", "`dsd passport -o FILE` writes one") from None
    if not isinstance(found, dict) or found.get("command") != "passport" or HASH not in found:
        raise UsageError(f"{path}: is no passport", "`dsd passport -o FILE` writes one")
    if found[HASH] != content_hash(found):
        raise UsageError(f"{path}: was changed after it was written", "its content does not give its sha256")
    return found


def content_hash(passport: Mapping[str, Any]) -> str:
    """SHA-256 (hex) of all keys but the hash itself: as JSON with sorted keys, without spaces, ASCII only."""
    rest = {name: value for name, value in passport.items() if name != HASH}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode("ascii")).hexdigest()


def delivered(passport: Mapping[str, Any], name: str) -> dict[str, Reference]:
    """The values of the newest log of a passport, and its force error.

    Raises
    ------
    UsageError : the passport lacks them.
    """
    try:
        newest = passport["readings"][-1]
        values = {n: (one["value"], one["std_error"]) for n, one in newest["values"].items()}
        values[RMSE] = (newest["heldout_rmse"], None)
        return {
            n: Reference(float(value), math.nan if error is None else float(error))
            for n, (value, error) in values.items()
            if value is not None
        }
    except (KeyError, IndexError, TypeError, ValueError, AttributeError):
        raise UsageError(f"{name}: lacks values", "is it of another version of dsd?") from None
