"""Arguments and options that several commands share, so that they are named and explained alike."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from dsd_cli.errors import printable


class Format(StrEnum):
    """How a result is written to stdout."""

    TABLE = "table"
    JSON = "json"


def effect_ids(incomplete: str) -> list[str]:
    """For the completion of a shell."""
    from dsd_cli.effects import catalogue

    return [name for name in catalogue() if name.startswith(incomplete)]


def template_names(incomplete: str) -> list[str]:
    """For the completion of a shell."""
    from dsd_cli.files.template import template_names as names

    return [name for name in names() if name.startswith(incomplete)]


def set_keys(incomplete: str) -> list[str]:
    """For the completion of a shell: `model.inertia=`, the values of each effect included."""
    from dsd_cli.effects import catalogue
    from dsd_cli.files.config import Config

    keys = _keys_below(Config, "")
    effects = [f"model.effects.{name}.{p.name}" for name, one in catalogue().items() for p in one.parameters]
    return [f"{key}=" for key in (*keys, *effects) if key.startswith(incomplete)]


def _keys_below(section: Any, path: str) -> list[str]:
    found = []
    for name, spec in section.keys.items():
        inner = [key for one in spec.rule.sections for key in _keys_below(one, f"{path}{name}.")]
        found += inner or [f"{path}{name}"]
    return list(dict.fromkeys(found))


LogArgument = Annotated[str, typer.Argument(metavar="LOG", help="Log file (CSV, Parquet, MF4, ...); - is stdin.")]

#: Default of `ConfigOption`.
CONFIG_FILE = Path("dsd.toml")


def nearest_config(path: Path, quiet: bool) -> Path:
    """`dsd.toml` of the working folder, or of the nearest folder above that has one, which is then said on stderr."""
    import os
    import sys

    if path != CONFIG_FILE or path.exists():
        return path
    for folder in Path.cwd().parents:
        if (folder / path).is_file():
            found = Path(os.path.relpath(folder / path))
            if not quiet:
                print(printable(f"dsd: config: {found}"), file=sys.stderr)
            return found
    return path


def _config_option(context: typer.Context, path: Path) -> Path:
    return path if context.resilient_parsing else nearest_config(path, bool(context.params.get("quiet")))


def config_options(context: typer.Context, paths: list[Path] | None) -> list[Path]:
    """Those given, or the one that `ConfigOption` would take."""
    return list(paths or ()) or [_config_option(context, CONFIG_FILE)]


ConfigOption = Annotated[
    Path,
    typer.Option(
        "-c",
        "--config",
        metavar="FILE",
        callback=_config_option,
        help="Config file of the rig; the default is looked for in the folders above, too.",
    ),
]

OutputOption = Annotated[
    str | None, typer.Option("-o", "--output", metavar="FILE", help="File to write (.csv or .parquet); - is stdout.")
]

FormatOption = Annotated[Format, typer.Option("--format", help="Form of the result on stdout.")]

# eager: what is said while the other options are read is silenced, too
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", is_eager=True, help="No messages and no progress.")]

SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        autocompletion=set_keys,
        help="Config value for this run, e.g. model.inertia=0.7; repeatable.",
    ),
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
