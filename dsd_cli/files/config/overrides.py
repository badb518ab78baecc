"""Values from the command line: `--set model.inertia=0.7` and `--effect coulomb_friction:level=0.5`."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from dsd_cli.errors import UsageError
from dsd_cli.files.config.signals import COLUMNS

#: Levels of a key that are looked at.
DEEPEST = 20


def with_values(written: Mapping[str, Any], texts: Iterable[str]) -> dict[str, Any]:
    """A copy of the tables with each `key=value` in place; list items are reached as `simulate.events.0.delay`.

    Raises
    ------
    UsageError : a text that is no `key=value`, a value that is not TOML, a key below something that is no table.
    """
    tables: dict[str, Any] = copy.deepcopy(dict(written))
    for text in texts:
        dotted, equals, value = text.partition("=")
        parts = [part.strip() for part in dotted.split(".")]
        if not equals or not all(parts):
            raise UsageError(f"--set {text}", "write KEY=VALUE, such as model.inertia=0.7")
        if len(parts) > DEEPEST:
            raise UsageError(f"--set {parts[0]}...", f"a key of {len(parts)} levels; a config has at most five")
        column = parts[0] == "signals" and (parts[1:] in ([name] for name in COLUMNS) or dotted.endswith("_unit"))
        _put(tables, parts, _value(value, f"--set {text}", column), f"--set {text}")
    return tables


def with_effects(written: Mapping[str, Any], texts: Iterable[str]) -> dict[str, Any]:
    """A copy of the tables with each `id:parameter=value,...` put into `[model.effects.id]`.

    Raises
    ------
    UsageError : a text of another form, or a value that is not TOML.
    """
    tables: dict[str, Any] = copy.deepcopy(dict(written))
    for text in texts:
        option = f"--effect {text}"
        effect, colon, parameters = text.partition(":")
        if not colon or not effect.strip() or not parameters.strip():
            raise UsageError(option, "write ID:PARAMETER=VALUE[,PARAMETER=VALUE], such as coulomb_friction:level=0.5")
        if "[" in parameters or "{" in parameters:
            key = f"model.effects.{effect.strip()}.{parameters.partition('=')[0].strip()}"
            raise UsageError(option, f"takes numbers only; write --set '{key}=[...]', or [model.effects] in the config")
        for assignment in parameters.split(","):
            name, equals, value = assignment.partition("=")
            if not equals or not name.strip():
                raise UsageError(option, f"'{assignment}' is not PARAMETER=VALUE")
            _put(tables, ["model", "effects", effect.strip(), name.strip()], _value(value, option), option)
    return tables


def _put(tables: dict[str, Any], parts: list[str], value: Any, option: str) -> None:
    here: Any = tables
    for depth, part in enumerate(parts):
        last = depth == len(parts) - 1
        if isinstance(here, list) and part.isdecimal() and int(part) < len(here):
            index: Any = int(part)
        elif isinstance(here, dict):
            index = part
        else:
            raise UsageError(option, f"{'.'.join(parts[:depth])} has no '{part}'")
        if last:
            here[index] = value
        else:
            here = here.setdefault(index, {}) if isinstance(here, dict) else here[index]


def _value(text: str, option: str, column: bool = False) -> Any:
    """A TOML value; a bare word, which TOML would want quoted, is a text, and so is nothing at all; of a `column` any
    words are, as "Voltaje (V)", and its number."""
    text = text.strip() or '""'
    try:
        parsed = tomllib.loads(f"value = {text}")
        if len(parsed) == 1:
            return text if column and type(parsed["value"]) is int else parsed["value"]
    except RecursionError:
        raise UsageError(option.partition("=")[0], "its value is nested too deeply") from None
    except tomllib.TOMLDecodeError:
        if re.fullmatch(r"[A-Za-z_][\w./-]*", text) or (column and re.fullmatch(r"\w.*[^\"']", text)):
            return text
    raise UsageError(option, f"'{text}' is not a TOML value such as 0.7, true, \"text\" or [0.2, 0.3]")
