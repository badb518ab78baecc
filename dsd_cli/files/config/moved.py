"""A config that goes to another folder: the files that it names by relative paths are still the same files."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path as File
from typing import Any

from dsd_cli.files.config.placing import without
from dsd_cli.files.config.toml_text import Path, literal, statements, strings

#: Keys that name files, relative to the folder of the config.
_FILES = (("effects", "from"), ("detector", "transition", "file"), ("simulate", "reference", "file"))


def moved(text: str, old: File, new: File) -> str:
    """The text of a config of folder `old` as it has to be in folder `new`; what is written absolutely stays."""
    here, there = os.path.realpath(old), os.path.realpath(new)
    if here == there:
        return text
    found, changed = statements(text), {}
    for i, statement in enumerate(found):
        for path in _FILES:
            if statement.kind != "=" or path[: len(statement.path)] != statement.path:
                continue
            raw = statement.raw(text)
            now = _replaced(raw, path[len(statement.path) :], partial(_from, here, there))
            if now != raw:
                begin, end = statement.value
                changed[i] = text[statement.start : begin] + now + text[end : statement.end]
    return without(text, found, (), changed) if changed else text


def _replaced(raw: str, path: Path, change: Callable[[str], str]) -> str:
    """A value as it is written, in which the file, or each file of a list, at this path in it is changed."""
    for begin, end in reversed(strings(raw)):
        before, old, after = raw[:begin], raw[begin:end], raw[end:]
        marked = _at(_value(f"{before}0{after}"), path)  # a file is a text: a 0 stands there if this one is it
        if marked == 0 or (isinstance(marked, list) and 0 in marked):
            file = _value(old)
            now = change(file)
            raw = raw if now == file else before + literal(now) + after
    return raw


def _value(raw: str) -> Any:
    return tomllib.loads(f"x = {raw}")["x"]


def _at(value: Any, path: Path) -> Any:
    """What stands at this path in a value; None where nothing does."""
    for name in path:
        value = value.get(name) if isinstance(value, Mapping) else None
    return value


def _from(here: str, there: str, file: str) -> str:
    """A file of the folder `here` as seen from `there`."""
    if os.path.isabs(file):
        return file
    return File(os.path.relpath(os.path.join(here, file), there)).as_posix()
