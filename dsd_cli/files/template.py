"""The configs that `dsd init` writes and `dsd simulate --template` runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

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
