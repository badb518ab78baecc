"""Effects of the user, known to this process before a config is read: `--effects-from FILE`, `[effects] from`."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from dsd_cli.errors import UsageError, printable

#: File -> ids of its effects: what this process has registered, written only by `use_effects`.
_LOADED: dict[Path, tuple[str, ...]] = {}


def use_effects(files: Iterable[Path] | None) -> None:
    """Loads and registers the effects of these files; None and no file do nothing, and cost nothing.

    Raises
    ------
    UsageError : a file that cannot be used, with its name and line.
    """
    for path in files or ():
        from dsd_cli.effects import load_effects, register

        found = load_effects(path)
        register(found)
        _LOADED[path.resolve()] = tuple(effect.id for effect in found)


def not_loaded(files: Iterable[Path]) -> list[Path]:
    """Those of the files whose effects this process does not know yet."""
    from dsd_cli.effects import catalogue

    known = catalogue()
    return [path for path in files if not all(effect in known for effect in _LOADED.get(path.resolve(), ("",)))]


def _allow(context: typer.Context, trusted: bool) -> bool:
    """As long as the command runs, configs may name effects: with --trust, or if whoever is asked says so."""
    from dsd_cli.files.config.own_effects import allowing

    if not context.resilient_parsing:
        context.with_resource(allowing(partial(_read, trusted, context)))
    return trusted


TrustOption = Annotated[
    bool,
    typer.Option(
        "--trust",
        is_eager=True,
        callback=_allow,
        help="Run the Python files that [effects] of the config names, without a question.",
    ),
]


def _read(trusted: bool, context: typer.Context, config: str, files: tuple[Path, ...]) -> None:
    new = not_loaded(files)
    if not new:
        return
    names = ", ".join(str(path) for path in new)
    if not trusted:
        _ask(config, names)
    use_effects(new)
    if not context.params.get("quiet"):
        typer.echo(printable(f"dsd: {config}: ran {names} for its effects"), err=True)


def _ask(config: str, names: str) -> None:
    """Asks on a terminal whether these files may be run.

    Raises
    ------
    UsageError : there is no terminal, or the answer is no.
    """
    import sys

    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError(f"{config}: [effects] from: {names} is Python that would be run", "--trust runs it")
    if not typer.confirm(printable(f"{config} wants to run {names} (Python). Run it?"), err=True):
        raise UsageError(f"{config}: [effects] from: {names} was not run", "--trust runs it without a question")
