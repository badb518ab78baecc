"""The configs that `dsd init` writes and `dsd simulate --template` runs."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsd_cli.errors import UsageError

if TYPE_CHECKING:
    from dsd_cli.files.config import Config

_FOLDER = Path(__file__).parent / "templates"


def template_names() -> tuple[str, ...]:
    """The names of all templates."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))


def template_text(name: str) -> str:
    """The commented TOML text of a template.

    Raises
    ------
    UsageError : no template of that name.
    """
    if name not in template_names():
        raise UsageError(f"no template '{name}'", "templates are " + ", ".join(template_names()))
    return (_FOLDER / f"{name}.toml").read_text(encoding="utf-8")


def load_template(name: str) -> Config:
    """A template as a config.

    Raises
    ------
    UsageError : no template of that name.
    """
    from dsd_cli.files.config import parse_config

    return parse_config(template_text(name), f"template {name}")


def headed(text: str, path: str) -> str:
    """The template for recordings as proposed from that log."""
    name = json.dumps(path)
    return text.replace(
        "# Your own recording. Change what is marked <-, then:",
        f"# Proposed from {name}. Look over what is marked <-, then:",
    )


def _aligned(setting: str, line: re.Match[str]) -> str:
    comment = line[2].lstrip()
    return f"{setting:<{len(line[0]) - len(comment) - 1}} {comment}" if comment else setting


def with_value(text: str, section: str, key: str, value: str, comment: str = "") -> str:
    """The text with that key set, where the section has it (commented out, too), its comment kept or replaced."""
    head = re.search(rf"^\[{section}\].*$", text, flags=re.MULTILINE)
    if head is None:
        return f"{text.rstrip()}\n\n[{section}]\n{key} = {value}\n"
    end = re.search(r"^\[", text[head.end() :], flags=re.MULTILINE)
    stop = head.end() + end.start() if end else len(text)
    body = text[head.end() : stop]
    line = re.compile(rf"^(?:# )?{key} = (\[[^\]]*\]|\{{[^}}]*\}}|\"[^\"]*\"|[^#\s]+)(.*)$", flags=re.MULTILINE)
    if line.search(body):
        put = f"{key} = {value}"
        body = line.sub(lambda found: f"{put}  {comment}" if comment else _aligned(put, found), body, count=1)
    else:
        body = f"{body.rstrip()}\n{f'{key} = {value}  {comment}'.rstrip()}\n\n"
    if key == "sample_time":
        body = re.sub(r"^time = .*\n", "", body, flags=re.MULTILINE)
    return text[: head.end()] + body + text[stop:]


def with_table(text: str, section: str, key: str, table: Mapping[str, Any]) -> str:
    """The text with what that table of a section says: `[section.key]`, or within what stands in the section in line.

    Raises
    ------
    UsageError : the text is no config any more.
    """
    from dsd_cli.files.config.config import parse_tables
    from dsd_cli.files.config.toml_text import inline, leaves, literal

    there = parse_tables(text, "dsd.toml").get(section, {}).get(key)
    if there is not None:
        whole = {**there, **table} if isinstance(there, dict) else table
        return with_value(text, section, key, inline({path: literal(value) for path, value in leaves(whole).items()}))
    for path, value in leaves(table).items():
        text = with_value(text, ".".join((section, key, *path[:-1])), path[-1], literal(value))
    return text
