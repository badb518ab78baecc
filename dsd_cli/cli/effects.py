"""`dsd effects`: the catalogue of physical effects."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dsd_cli.cli.options import EffectsFromOption, effect_ids
from dsd_cli.errors import printable
from dsd_cli.signals.units import LEGEND, in_words

if TYPE_CHECKING:
    from dsd_cli.effects import Effect, Parameter


class CatalogueFormat(StrEnum):
    """How the catalogue is written."""

    TABLE = "table"
    JSON = "json"
    MARKDOWN = "markdown"


def effects(
    effect: Annotated[
        str | None, typer.Argument(metavar="ID", autocompletion=effect_ids, help="Show only this effect, in full.")
    ] = None,
    form: Annotated[CatalogueFormat, typer.Option("--format", help="Form of the catalogue.")] = CatalogueFormat.TABLE,
    effects_from: EffectsFromOption = None,
) -> None:
    """Show each effect's law, parameters with units, channels needed and the residual pattern that betrays it."""
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.effects import get_effect, named_effects

    use_effects(effects_from)
    chosen = [get_effect(effect)] if effect else list(named_effects().values())
    if form is CatalogueFormat.JSON:
        _print_json(chosen)
    elif form is CatalogueFormat.MARKDOWN:
        typer.echo(markdown(chosen), nl=False)
    elif effect:
        _print_in_full(chosen[0])
    else:
        _print_table(chosen)


def _range(parameter: Parameter) -> str:
    if not parameter.numeric:
        return "list of tables" if parameter.listed else "list or word"
    match (math.isfinite(parameter.lower), math.isfinite(parameter.upper)):
        case (True, True):
            return f"{parameter.lower:g} to {parameter.upper:g}"
        case (True, False):
            return f"{parameter.lower:g} or more"
        case (False, True):
            return f"{parameter.upper:g} or less"
    return "any"


def _channels(effect: Effect) -> str:
    return ", ".join(effect.needs) or "none"


#: Role -> heading of its effects in the table.
_HEADINGS = {
    "applied": "forces on the axis",
    "friction": "friction: holds at rest, and opposes motion",
    "input": "what the command goes through before it acts",
    "structure": "a load that hangs on the motor",
}


def _several(effect: Effect) -> str:
    """How a model has more than one of it."""
    from dsd_cli.effects import kind_of

    kind = kind_of(effect.id)
    return f"several of it are [model.effects.{kind}], [model.effects.{kind}_2], [model.effects.{kind}_3], ..."


def _print_table(chosen: list[Effect]) -> None:
    import sys

    from rich.table import Table
    from rich.text import Text

    from dsd_cli.report.terminal import console

    out = console(sys.stdout)
    for role, heading in _HEADINGS.items():
        table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
        table.add_column(no_wrap=True, min_width=22)
        table.add_column()
        for effect in chosen:
            if effect.role.value == role:
                table.add_row(f"  {printable(effect.id)}", Text(printable(effect.law)))
        if table.row_count:
            out.print(Text(heading, style="bold"))
            out.print(table)
    out.print(Text("J a = u(t - L) + forces; v velocity, q position, sgn its direction; m motor, l load."))
    out.print(Text("`dsd effects ID`: parameters with units, channels needed, and the pattern that betrays it."))


#: How the lines begin whose text stands in a column of its own.
_LABELS = ("  law ", "  parameter ", "  needs ", "  pattern ")


def _print_in_full(effect: Effect) -> None:
    """Lines that hang below their heading where the terminal is narrow."""
    import sys
    from textwrap import fill

    from dsd_cli.report.terminal import console

    out = console(sys.stdout)
    for line in map(printable, _in_full(effect)):
        indent = " " * (12 if line.startswith(_LABELS) else 2)
        wrapped = fill(line, out.width, subsequent_indent=indent) if sys.stdout.isatty() else line
        out.print(wrapped, markup=False)


def _in_full(effect: Effect) -> list[str]:
    lines = [effect.id, f"  {effect.summary}", f"  law       {effect.law}  ({effect.role.value})"]
    lines += [
        f"  parameter {p.name}{_in_brackets(p)}, {_range(p)}: {p.meaning}{'' if p.linear else ' (shape)'}"
        for p in effect.parameters
    ]
    lines += [f"  needs     {_channels(effect)}", f"  pattern   {effect.pattern}", "", "  in dsd.toml:"]
    lines += [f"  [model.effects.{effect.id}]"]
    lines += [f"  {p.name} = ..." for p in effect.parameters]
    lines += ["", f"  {_several(effect)}"] if effect.repeats is not None else []
    return [*lines, "", LEGEND]


def _in_brackets(parameter: Parameter) -> str:
    return f" [{in_words(parameter.unit)}]" if parameter.unit else ""


def _print_json(chosen: list[Effect]) -> None:
    from dsd_cli.report.head import head
    from dsd_cli.report.terminal import json_text

    result = {
        **head("effects", ()),
        "log": None,
        "effects": [_as_json(effect) for effect in chosen],
    }
    typer.echo(json_text(result, indent=2))


def _as_json(effect: Effect) -> dict[str, Any]:
    def parameter(p: Parameter) -> dict[str, Any]:
        bounds = {k: v if math.isfinite(v) else None for k, v in (("lower", p.lower), ("upper", p.upper))}
        return {
            "name": p.name,
            "unit": in_words(p.unit),
            "meaning": p.meaning,
            **bounds,
            "linear": p.linear,
            "listed": not p.numeric,
        }

    return {
        "id": effect.id,
        "law": effect.law,
        "role": effect.role.value,
        "summary": effect.summary,
        "parameters": [parameter(p) for p in effect.parameters],
        "needs": list(effect.needs),
        "pattern": effect.pattern,
        "repeats": effect.repeats is not None,
    }


#: Characters of a line of the page.
_PAGE = 118


def markdown(chosen: list[Effect]) -> str:
    """The catalogue as the page `docs/effects.md`."""
    from textwrap import wrap

    lines = [
        "# Effects",
        "",
        "What `dsd effects --format markdown` prints; a test keeps this page current. An effect is used by naming it",
        "in the config, `[model.effects.<id>]` with a value for each parameter, or with `--effect id:parameter=value`.",
        "Effects with a line *Several* may be there more than once, each under a name and with values of its own.",
        "",
        LEGEND,
        "*applied* is a force on the plant. *friction* is a budget: at rest it holds against any force up to its",
        "level. *input* changes the command before the delay. *structure* hangs a load on the motor, a share s of",
        "the whole inertia J. A *shape* parameter is not a factor of the force. An effect of your own, the same kind",
        "of Python file as ours, is taken with `--effects-from my_effect.py`.",
    ]
    for effect in chosen:
        lines += ["", f"## {effect.id}", "", *wrap(effect.summary, _PAGE), ""]
        lines += [f"- Law: `{effect.law}` ({effect.role.value})", f"- Needs: {_channels(effect)}"]
        lines += wrap(f"- Pattern: {effect.pattern}", _PAGE, subsequent_indent="  ")
        lines += [f"- Several: `{effect.id}`, `{effect.id}_2`, `{effect.id}_3`, ..."] if effect.repeats else []
        lines += ["", "| parameter | unit | range | meaning |", "|---|---|---|---|"]
        lines += [
            f"| `{p.name}` | {in_words(p.unit)} | {_range(p)} | {p.meaning}{'' if p.linear else ' (shape)'} |"
            for p in effect.parameters
        ]
    return "\n".join(lines) + "\n"
