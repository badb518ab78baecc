"""`--effects-from FILE`: effects of the user, known to this process before the config is read."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


def use_effects(files: Iterable[Path] | None) -> None:
    """Loads and registers the effects of these files; None and no file do nothing, and cost nothing.

    Raises
    ------
    UsageError : a file that cannot be used, with its name and line.
    """
    for path in files or ():
        from dsd_cli.effects import load_effects, register

        register(load_effects(path))
