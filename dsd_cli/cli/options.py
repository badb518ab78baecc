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

FromOption = Annotated[
    float | None, typer.Option("--from", metavar="T", help="Read LOG from this stamp on, s (signals.start).")
]
ToOption = Annotated[
    float | None, typer.Option("--to", metavar="T", help="Read LOG up to this stamp, s (signals.end).")
]

FixOption = Annotated[
    list[str] | None,
    typer.Option(
        "--fix",
        metavar="NAME[=VALUE]",
        help="Value that no fit changes, e.g. inertia=0.35; without a value as [model] has it. Repeatable.",
    ),
]
BoundsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--bounds",
        metavar="NAME=LOW:HIGH",
        help="Limits of a value, e.g. viscous_friction.coefficient=0:5. Repeatable.",
    ),
]
PriorOption = Annotated[
    list[str] | None,
    typer.Option(
        "--prior",
        metavar="NAME=VALUE+-SPREAD",
        help="A data sheet's value and its standard deviation, e.g. inertia=0.35+-0.02. Repeatable.",
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


def with_window(override: list[str] | None, start: float | None, end: float | None) -> list[str]:
    """The texts of --set with those of --from and --to."""
    given = [("start", start), ("end", end)]
    return [*(override or ()), *(f"signals.{name}={value!r}" for name, value in given if value is not None)]
