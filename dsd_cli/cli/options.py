"""Arguments and options that several commands share, so that they are named and explained alike."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Format(StrEnum):
    """How a result is written to stdout."""

    TABLE = "table"
    JSON = "json"


LogArgument = Annotated[str, typer.Argument(metavar="LOG", help="Log file (CSV, Parquet, MF4, ...); - is stdin.")]

ConfigOption = Annotated[Path, typer.Option("-c", "--config", metavar="FILE", help="Config file of the rig.")]

OutputOption = Annotated[
    str | None, typer.Option("-o", "--output", metavar="FILE", help="File to write (.csv or .parquet); - is stdout.")
]

FormatOption = Annotated[Format, typer.Option("--format", help="Form of the result on stdout.")]

QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="No messages and no progress.")]

SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Config value for this run, e.g. model.inertia=0.7; repeatable."),
]

EffectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--effect",
        metavar="ID:PARAM=VALUE",
        help="Effect put into [model] for this run, e.g. coulomb_friction:level=0.5; repeatable.",
    ),
]

EffectsFromOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--effects-from",
        metavar="FILE",
        help="Python file that defines an effect of your own (EFFECT = Effect(...)); it is run. Repeatable.",
    ),
]

#: Default of `ConfigOption`.
CONFIG_FILE = Path("dsd.toml")
