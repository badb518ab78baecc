"""The picture of `dsd improve --plot`: the error falls step by step, and the values that move with it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsd_cli.identify.fit.values import flat
from dsd_cli.identify.results import Estimate, Step
from dsd_cli.report.figure import (
    LIMIT,
    MEASURED,
    OTHER,
    PREDICTED,
    RESIDUAL,
    headline,
    in_picture,
    legend_above,
    sheet,
    shortened,
)
from dsd_cli.report.ladder import LadderReport, final_line
from dsd_cli.report.names import change_text, estimate_text, force_error
from dsd_cli.signals.units import Units

#: Standard errors from which on a value has moved, if that is out of the +- that it had; rows of the table of values.
MOVED, MOST_VALUES = 3.0, 16


@dataclass(frozen=True)
class Cell:
    """A value after a step: as text, and whether it moved ("", "new", "up", "down"); no text where it is not."""

    text: str
    change: str = ""


def values_by_step(steps: Sequence[Step]) -> dict[str, list[Cell]]:
    """Name of a value -> a cell for every step; those of the model as given have no errors yet."""
    models = [flat(step.model) for step in steps]
    names = dict.fromkeys(name for values in models for name in values)
    table: dict[str, list[Cell]] = {}
    for name in names:
        row: list[Cell] = []
        for k, (step, values) in enumerate(zip(steps, models, strict=True)):
            last = models[k - 1].get(name) if k else None
            before = None if last is None else Estimate(last, _error(name, steps[k - 1]), "")
            row.append(_cell(name, step, values.get(name), before, step is steps[-1]))
        table[name] = row
    return table


def _error(name: str, step: Step) -> float:
    known = step.estimates.get(name)
    return known.std_error if known is not None else math.nan


def _cell(name: str, step: Step, value: float | None, before: Estimate | None, last: bool) -> Cell:
    """+- stands at the last step alone: before it more was missing, and the error of the fit ignores that."""
    if value is None:
        return Cell("")
    error = _error(name, step)
    spread = error if step.step and last else math.nan
    text = estimate_text(Estimate(value, spread, "")).replace(" +- ", "\n+- ")
    if before is None:
        return Cell(text, "new" if step.step else "")
    least = max(MOVED * error if math.isfinite(error) else 1e-3 * abs(before.value), 1e-9 * abs(before.value))
    least = max(least, before.std_error) if math.isfinite(before.std_error) else least
    moved = abs(value - before.value) > least
    return Cell(text, ("up" if value > before.value else "down") if moved else "")


def draw(report: LadderReport) -> Any:
    """The figure."""
    result = report.result
    steps, rows = result.steps, values_shown(result.steps)
    width = max(8.5, 1.9 * len(steps) + 3.0)
    figure = sheet(width, 5.0 + 0.46 * rows + 0.9)
    axis, values = figure.subplots(2, 1, sharex=True, height_ratios=[4.2, 0.46 * max(rows, 1) + 0.3])
    logs = ", ".join(shortened(Path(log).name) for log in report.logs)
    headline(figure, f"{logs}: {final_line(result)}", int(10.5 * width))
    draw_steps(axis, steps, result.last.floor, "held-out log" if result.holdout else "held-out blocks")
    _draw_levels(axis, report)
    axis.set_ylabel(f"{force_error(result.last.band_hz)} ({result.last.units.force})")
    axis.tick_params(labelbottom=False)
    legend_above(axis, 3)
    draw_values(values, steps, result.last.units)
    return figure


def values_shown(steps: Sequence[Step]) -> int:
    """Rows of the table of values."""
    return min(len(values_by_step(steps)), MOST_VALUES)


def draw_steps(axis: Any, steps: Sequence[Step], floor: float, named: str) -> None:
    """A scale on which every factor is as far, so that late steps are seen as well as the first.

    named : the data that no fit saw.
    """
    heldout = [step.score.heldout_rmse for step in steps]
    places = list(range(len(steps)))
    positive = [h for h in [*heldout, *(s.score.rmse for s in steps), floor] if h > 0.0]
    if positive:
        axis.set_yscale("log")
        low, high = 0.55 * min(positive), 3.0 * max(positive)
        axis.set_ylim(low, high)
    axis.set_xlim(-0.6, len(steps) - 0.4)
    axis.hlines(heldout, [p - 0.32 for p in places], [p + 0.32 for p in places], color=PREDICTED, lw=5, label=named)
    axis.step(places, heldout, where="mid", color=PREDICTED, lw=1.0, zorder=1)
    axis.plot(places, [s.score.rmse for s in steps], "o", color=MEASURED, ms=6, label="fitted data", zorder=4)
    for place, value in enumerate(heldout):
        fell = f"\n{change_text(heldout[place - 1], value)}" if place else ""
        if math.isfinite(value):
            top = max(value, steps[place].score.rmse)
            text = f"{value:.3g}{fell}"
            axis.annotate(text, (place, top), (0, 5), textcoords="offset points", ha="center", va="bottom")


def _draw_levels(axis: Any, report: LadderReport) -> None:
    last = report.result.last
    on = f" of {', '.join(last.ceiling.on)}" if last.ceiling.on else ""
    levels = [
        (last.ceiling.heldout_rmse, f"ceiling: any function{on}", "--", LIMIT),
        (last.noise, "noise", ":", RESIDUAL),
        (last.floor, "floor: noise of the sensor alone", "-.", RESIDUAL),
    ]
    for level, label, style, color in levels:
        if math.isfinite(level) and level > 0.0:
            axis.axhline(level, ls=style, lw=1.4, color=color, label=label, zorder=3)
    end = len(report.result.steps) - 1
    for k, one in enumerate(report.validation):
        axis.plot([end + 0.2], [one.rmse], "D", color=OTHER, ms=5, zorder=5, label=None if k else "each held-out log")


def draw_values(axis: Any, steps: Sequence[Step], units: Units) -> None:
    """The values after each step: coloured where they are new, or have moved."""
    table = values_by_step(steps)
    shown = list(table)[:MOST_VALUES]
    colors = {"": "none", "new": "#f6c58f", "up": "#bcd5ec", "down": "#bcd5ec"}
    arrows = {"": "", "new": "", "up": "↑ ", "down": "↓ "}
    for row, name in enumerate(shown):
        for place, cell in enumerate(table[name]):
            if cell.change:
                axis.barh(row, 0.94, left=place - 0.47, height=0.9, color=colors[cell.change], zorder=1)
            axis.text(place, row, arrows[cell.change] + cell.text, ha="center", va="center", fontsize=8.5, zorder=2)
    words = {name: units.words(e.unit) for step in steps for name, e in step.estimates.items() if e.unit != "1"}
    labels = [in_picture(name + (f"\n[{words[name]}]" if words.get(name) else "")) for name in shown]
    axis.set_yticks(range(len(shown)), labels, fontsize=8.5)
    axis.set_ylim(max(len(shown), 1) - 0.5, -0.5)
    axis.tick_params(axis="both", length=0)
    for side in ("left", "bottom"):
        axis.spines[side].set_visible(False)
    names = [
        f"{step.step} {step.effect}" + (f"\n{step.kind}" if step.kind in ("taken back", "learnt") else "")
        for step in steps
    ]
    axis.set_xticks(range(len(steps)), [in_picture(text) for text in names], fontsize=9)
    axis.tick_params(axis="x", labeltop=True, labelbottom=False)
    more = len(table) - len(shown)
    moved = "blue: moved by more than 3 standard errors, and out of its +- before; orange: new"
    axis.set_xlabel(f"{moved}{f'; {more} more values in the result' if more > 0 else ''}", fontsize=8.5)
