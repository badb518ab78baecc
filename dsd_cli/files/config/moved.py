"""A config that goes to another folder: the files that it names by relative paths are still the same files."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from dsd_cli.files.config.placing import without
from dsd_cli.files.config.toml_text import literal, statements

#: Keys that name files, relative to the folder of the config.
_FILES = (("effects", "from"), ("detector", "transition", "file"), ("simulate", "reference", "file"))


def moved(text: str, old: Path, new: Path) -> str:
    """The text of a config of folder `old` as it has to be in folder `new`; what is written absolutely stays."""
    here, there = os.path.realpath(old), os.path.realpath(new)
    if here == there:
        return text
    found, changed = statements(text), {}
    for i, statement in enumerate(found):
        for path in _FILES:
            if statement.kind != "=" or path[: len(statement.path)] != statement.path:
                continue
            value = tomllib.loads(f"x = {statement.raw(text)}")["x"]
            now = _replaced(value, path[len(statement.path) :], partial(_from, here, there))
            if now != value:
                begin, end = statement.value
                changed[i] = text[statement.start : begin] + literal(now) + text[end : statement.end]
    return without(text, found, (), changed) if changed else text


def _replaced(value: Any, path: tuple[str, ...], change: Any) -> Any:
    """A value with the file, or each file of a list, changed that stands at this path in it, if one does."""
    if path:
        inside = isinstance(value, Mapping) and path[0] in value
        return {**value, path[0]: _replaced(value[path[0]], path[1:], change)} if inside else value
    return [change(one) for one in value] if isinstance(value, list) else change(value)


def _from(here: str, there: str, file: str) -> str:
    """A file of the folder `here` as seen from `there`."""
    if os.path.isabs(file):
        return file
    return Path(os.path.relpath(os.path.join(here, file), there)).as_posix()
