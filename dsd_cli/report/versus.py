"""Two configs side by side, as JSON and as tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import PurePath
from typing import Any

from dsd_cli.identify.compare.versus import CHANCE, Contender, Moved, Versus
from dsd_cli.identify.results import Estimate
from dsd_cli.report import terminal
from dsd_cli.report.diagnosis import plain_table
from dsd_cli.report.head import head
from dsd_cli.report.names import error, estimate_text, force_error, in_words, listed, number_or_none
from dsd_cli.report.terminal import escaped
from dsd_cli.signals.units import Units

#: Standard errors from which on a value has moved.
_MOVED = 3.0
#: Blocks from which on the better model on all of them is more than chance.
FEWEST = math.ceil(1.0 - math.log2(CHANCE))
#: Characters that the table of values may take.
_WIDEST = 110


def versus_json(
    names: Sequence[str],
    logs: Sequence[str],
    found: Versus | None,
    differences: Mapping[str, Sequence[Moved]],
    units: Units,
) -> dict[str, Any]:
    """The object of the contract; `models` is null without a log."""
    models = None if found is None else [_contender_json(one) for one in found.contenders]
    return {
        **head("compare", logs),
        "configs": list(names),
        "unit": units.force,
        "blocks": None if found is None else found.blocks,
        "models": models,
        "verdict_text": None if found is None else verdict_line(found),
        "differences": [
            {"config": name, "values": [moved_json(one) for one in values]} for name, values in differences.items()
        ],
    }


def _contender_json(one: Contender) -> dict[str, Any]:
    figures = {key: number_or_none(getattr(one, key)) for key in ("better_by", "chance", "blocks_won")}
    return {"config": one.name, **asdict(one.force), **figures, "differs": one.differs}


def moved_json(one: Moved) -> dict[str, Any]:
    numbers = {k: number_or_none(v) for k, v in asdict(one).items() if isinstance(v, float)}
    return {"name": one.name, "unit": one.unit, **numbers, "sigma": number_or_none(one.sigma)}


def verdict_line(found: Versus) -> str:
    """Which model is better, if any is."""
    first, lines = found.contenders[0], []
    for one in found.contenders[1:]:
        if found.blocks < FEWEST:
            better, worse = (one, first) if one.better_by > 0.0 else (first, one)
            lines.append(
                f"{found.blocks} blocks are too few to distinguish {first.name} from {one.name} (it takes {FEWEST}), a "
                f"longer log, or several, would do: {better.name} leaves {error(better.force.rmse)}, {worse.name} "
                f"{error(worse.force.rmse)}"
            )
            continue
        if not one.differs:
            chance = f"chance makes as much in {100 * one.chance:.0f} of 100"
            lines.append(f"{first.name} and {one.name} are indistinguishable on this log ({chance})")
            continue
        better, worse = (one, first) if one.better_by > 0.0 else (first, one)
        lines.append(
            f"{better.name} is better than {worse.name}: force error {error(better.force.rmse)} against "
            f"{error(worse.force.rmse)}, on {_won(one):.0f} % of {found.blocks} blocks (by chance: {one.chance:.2g})"
        )
    return "; ".join(lines)


def _won(one: Contender) -> float:
    return 100.0 * (one.blocks_won if one.better_by > 0.0 else 1.0 - one.blocks_won)


def print_versus(
    names: Sequence[str], found: Versus | None, differences: Mapping[str, Sequence[Moved]], units: Units, file: Any
) -> None:
    """For a person."""
    console = terminal.console(file)
    if found is not None:
        title = f"{', '.join(found.logs)}: {force_error(found.contenders[0].force.band_hz)} ({units.force})"
        console.print(escaped(title))
        table = plain_table("", "", *names)
        rows = (("rmse", "rmse"), ("fit %", "fit_percent"), ("of u %", "relative_error_percent"), ("floor", "floor"))
        for heading, key in rows:
            figures = (getattr(one.force, key) for one in found.contenders)
            table.add_row(heading, *("-" if x is None else error(x) for x in figures))
        console.print(table)
        console.print(f"[bold]{escaped(verdict_line(found))}[/bold]")
    for name, values in differences.items():
        print_moved(console, names[0], name, values)


def print_moved(console: Any, first: str, second: str, values: Sequence[Moved]) -> None:
    """Value by value, with the difference in standard errors."""
    narrow = console.file.isatty() and console.width < _WIDEST
    heads = (*_short(first, second), "difference", "sigma")
    table = plain_table("values", *(("unit", *heads) if narrow else ("", *heads, "unit")))
    table.columns[0].no_wrap, table.columns[-1].justify = True, "right" if narrow else "left"
    below = "\n" if narrow else " "  # on a narrow terminal cells have two lines
    for one in values:
        change = one.second - one.first
        share = f"{below}({100 * change / abs(one.first):+.1f} %)" if one.first and math.isfinite(change) else ""
        unit = escaped(in_words(one.unit))
        table.add_row(
            f"{escaped(one.name)}\n  {unit}" if narrow else escaped(one.name),
            *(_value(*pair).replace(" +-", f"{below}+-") for pair in one_by_one(one)),
            f"{change:+.3g}{share}" if math.isfinite(change) else "-",
            _sigma(one.sigma).replace(" ", below),
            *([] if narrow else [unit]),
        )
    console.print(table)
    for line in alone_lines(*_short(first, second), values):
        console.print(escaped(line))


def alone_lines(first: str, second: str, values: Sequence[Moved]) -> list[str]:
    """Which effects only one of the two has, and whose errors are not known."""
    lines = []
    for name, other, has, lacks in ((first, second, "first", "second"), (second, first, "second", "first")):
        mine = [v.name for v in values if math.isfinite(getattr(v, has)) and not math.isfinite(getattr(v, lacks))]
        if effects := list(dict.fromkeys(one.partition(".")[0] for one in mine)):
            lines.append(f"only {name} has {listed(effects)}; {other} has no value of {_them(effects)} (-)")
    untold = [name for name, error in ((first, "first_error"), (second, "second_error"))
              if not any(math.isfinite(getattr(v, error)) for v in values)]  # fmt: skip
    if untold:
        lines.append(f"no sigma: how sure the values of {listed(untold)} are is not known (no [[history]] of a fit)")
    return lines


def _them(effects: Sequence[str]) -> str:
    return "it" if len(effects) == 1 else "them"


def one_by_one(moved: Moved) -> tuple[tuple[float, float], tuple[float, float]]:
    """Value and standard error, of the first and of the second."""
    return (moved.first, moved.first_error), (moved.second, moved.second_error)


def _short(first: str, second: str) -> tuple[str, str]:
    """Without folders, where they differ all the same."""
    one, other = PurePath(first).name, PurePath(second).name
    return (one, other) if one != other else (first, second)


def _value(value: float, spread: float) -> str:
    return estimate_text(Estimate(value, spread, "")) if math.isfinite(value) else "-"


def _sigma(sigma: float) -> str:
    return "-" if not math.isfinite(sigma) else f"{sigma:+.1f}{' moved' if abs(sigma) > _MOVED else ''}"
