"""`dsd columns`: every channel of a log, and what it may be."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.options import Format, FormatOption

if TYPE_CHECKING:
    from dsd_cli.files.sample import Table
    from dsd_cli.report.columns import Column

LogArgument = Annotated[str, typer.Argument(metavar="LOG", help="Log file (CSV, Parquet, MAT, JSON, ...); - is stdin.")]


def columns(
    log: LogArgument,
    override: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Where the rows of a text file are, e.g. csv.header=4."),
    ] = None,
    form: FormatOption = Format.TABLE,
) -> None:
    """Show every channel of LOG: its unit, rate, range and first values, how it runs, and what it may be.

    No config is needed. What a channel may be comes from its name and unit, else from what it does; `dsd init LOG`
    writes a config with these guesses.
    """
    import sys

    from dsd_cli.cli.identification import print_json
    from dsd_cli.cli.init_ import as_file
    from dsd_cli.errors import source_name
    from dsd_cli.files.config import parse_config
    from dsd_cli.files.sample import sample
    from dsd_cli.report.columns import print_table, to_json

    layout = parse_config("").override(override or ()).csv.layout
    with as_file(log) as path:
        found = sample(path, layout)
    listed = [one for table in found.tables for one in _described(table)]
    if form is Format.JSON:
        print_json(to_json(source_name(log), listed, found.notes))
    else:
        print_table(source_name(log), listed, found.notes, sys.stdout)


def _described(table: Table) -> list[Column]:
    """The channels of a table, with what each may be."""
    from dsd_cli.cli.init_roles import by_names, roles_of
    from dsd_cli.cli.init_union import usable
    from dsd_cli.report.columns import Column
    from dsd_cli.roles import Guess, facts_of

    moving = usable(table)
    look = by_names(moving, {})
    roles = roles_of(look, moving, {})
    guesses: dict[str, tuple[str, Guess]] = {one.column: (role, one) for role, one in roles.found.items()}
    step = roles.facts[roles.found["time"].column].step if "time" in roles.found else 0.0
    found = []
    for channel in table.channels:
        role, guess = guesses.get(channel.name, ("", None))
        unit = look.found[role].unit if role in look.found else channel.unit
        rows = table.rows if table.rows is not None or channel.values is None else channel.values.size
        reason = "" if guess is None else "; ".join(filter(None, (guess.reason, guess.doubt)))
        found.append(Column.of(channel, facts_of(channel), unit or channel.unit, rows, step, role, reason))
    return found
