"""Single values of `dsd.toml` changed where they stand; comments, order and every other byte stay."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from typing import Any

from dsd_cli.errors import UsageError
from dsd_cli.files.config.placing import newline
from dsd_cli.files.config.toml_text import Path, literal, statements


def with_keys(text: str, values: Mapping[Path, Any]) -> str:
    """The config with these values, (table, key) -> value; a key that is not there is added below its table's header.

    Raises
    ------
    UsageError : a key is written in a way that cannot be changed in place (inline or dotted tables).
    """
    changed = text
    for path, value in values.items():
        changed = _with_key(changed, path, literal(value))
    meant = merged(tomllib.loads(text), values)
    try:
        now = tomllib.loads(changed)
    except tomllib.TOMLDecodeError:
        now = {}
    if now != meant:
        tables = ", ".join(f"[{table}]" for table in dict.fromkeys(path[0] for path in values))
        raise UsageError(f"{tables} cannot be changed in place", "write each as a table of its own, key by key")
    return changed


def _with_key(text: str, path: Path, raw: str) -> str:
    all_of_it = statements(text)
    for s in all_of_it:
        if s.kind == "=" and s.path == path:
            begin, end = s.value
            return text[:begin] + raw + text[end:]
    line = f"{path[-1]} = {raw}{newline(text)}"
    header = next((i for i, s in enumerate(all_of_it) if s.kind == "[" and s.path == path[:-1]), None)
    if header is None:
        gap = "" if not text or text.endswith("\n") else newline(text)
        return f"{text}{gap}{newline(text)}[{'.'.join(path[:-1])}]{newline(text)}{line}"
    last = header
    for i, s in enumerate(all_of_it[header + 1 :], header + 1):
        if s.kind in ("[", "[["):
            break
        last = i if s.kind == "=" else last
    at = all_of_it[last].end
    return text[:at] + ("" if text[:at].endswith("\n") else newline(text)) + line + text[at:]


def merged(tables: dict[str, Any], values: Mapping[Path, Any]) -> dict[str, Any]:
    """Nested tables with these values in them; changed in place."""
    for path, value in values.items():
        here = tables
        for part in path[:-1]:
            here = here.setdefault(part, {})
        here[path[-1]] = list(value) if isinstance(value, tuple) else value
    return tables
