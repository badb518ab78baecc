"""`dsd schema`: what the JSON of a command looks like."""

from __future__ import annotations

from importlib.resources import files
from typing import Annotated

import typer


def schema_names(incomplete: str = "") -> list[str]:
    """Commands whose JSON has a schema."""
    found = (entry.name for entry in files("dsd_cli").joinpath("schemas").iterdir())
    return sorted(name.removesuffix(".json") for name in found if name.startswith(incomplete))


def schema(
    command: Annotated[
        str | None,
        typer.Argument(metavar="COMMAND", autocompletion=schema_names, help="Command; none lists those that have one."),
    ] = None,
) -> None:
    """Print the JSON schema (2020-12) of what COMMAND writes under --format json.

    Keys may be added; one that is taken away or changes its meaning raises schema_version. `fleet` is that of
    `dsd fleet summary`; `detect` has the lines of --format jsonl, too.
    """
    from dsd_cli.errors import UsageError

    names = schema_names()
    if command is None:
        typer.echo("\n".join(names))
    elif command in names:
        typer.echo(files("dsd_cli").joinpath("schemas", f"{command}.json").read_text(encoding="utf-8"), nl=False)
    else:
        raise UsageError(f"no schema '{command}'", "there is one for " + ", ".join(names))
