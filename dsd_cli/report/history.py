"""The history of a config, as JSON and as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from dsd_cli.identify.results import Estimate
from dsd_cli.report import terminal
from dsd_cli.report.diagnosis import named, plain_table
from dsd_cli.report.head import head
from dsd_cli.report.names import change_text, error
from dsd_cli.report.terminal import escaped


def history_json(config: str, steps: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The steps that a config remembers; `steps` as its [[history]] has them."""
    return {**head("improve", ()), "config": config, "history": list(steps)}


def print_history(config: str, steps: Sequence[Mapping[str, Any]], file: Any) -> None:
    """For a person."""
    console = terminal.console(file)
    if not steps:
        console.print(escaped(f"{config}: no steps yet"))
        return
    table = plain_table(f"{config}: steps, newest last", "step", "date", "held-out error")
    for step in steps:
        newest = step is steps[-1]  # of an older one the standard errors hold only if nothing else had been missing
        before, after = (_given(step.get(f"heldout_rmse_{when}")) for when in ("before", "after"))
        gone = " taken back" if step.get("taken_back") else ""
        table.add_row(
            named(
                str(step["effect"]) + gone,
                {} if gone else _recorded(step, newest),
                [f"from {x}" for x in step.get("logs", ())],
            ),
            escaped(str(step["date"]).replace("T", " ")[:16]),
            f"{error(before)} -> {error(after)}{_of_errors(step)} ({change_text(before, after)})",
        )
    console.print(table)


def _of_errors(step: Mapping[str, Any]) -> str:
    unit = step.get("units", {}).get("rmse", "")
    return f" {unit}" if unit else ""


def _given(value: float | None) -> float:
    return math.nan if value is None else value


def _recorded(step: Mapping[str, Any], with_errors: bool) -> dict[str, Estimate]:
    errors = step.get("std_errors", {}) if with_errors else {}
    numbers = {name: v for name, v in step.get("values", {}).items() if isinstance(v, int | float)}
    units, effect = step.get("units", {}), step["effect"]
    unit = {name: units.get(name, units.get(f"{effect}.{name}", "")) for name in numbers}
    return {name: Estimate(v, errors.get(name, math.nan), unit[name]) for name, v in numbers.items()}
