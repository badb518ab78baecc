"""The picture of `dsd improve --plot`: the held-out error falls, step by step."""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import Any

from dsd_cli.identify.results import Step
from dsd_cli.report.figure import in_picture, png
from dsd_cli.report.ladder import LadderReport, final_line, own
from dsd_cli.report.names import change_text, force_error, values_text
from dsd_cli.report.plots_comparison import MEASURED, PREDICTED, RESIDUAL, SHARE

#: Values named below a step.
_MOST_VALUES = 3


def draw(report: LadderReport) -> bytes:
    """The PNG."""
    from matplotlib.figure import Figure

    steps = report.result.steps
    figure = Figure(figsize=(max(8.0, 2.1 * len(steps) + 1.5), 5.6), layout="constrained")
    axis = figure.subplots()
    logs = ", ".join(Path(log).name for log in report.logs)
    title = textwrap.fill(f"{logs}: {final_line(report.result)}", 95 if len(steps) < 5 else 130)
    figure.suptitle(in_picture(title), fontsize=11)
    _draw_steps(axis, steps)
    _draw_levels(axis, report)
    axis.set_ylabel(f"held-out {force_error(report.result.last.band_hz)} ({report.result.last.units.force})")
    axis.set_xlim(-0.6, len(steps) - 0.4)
    axis.spines[["top", "right"]].set_visible(False)
    return png(figure)


def _draw_steps(axis: Any, steps: tuple[Step, ...]) -> None:
    heldout = [step.score.heldout_rmse for step in steps]
    colors = [SHARE, *[PREDICTED] * (len(steps) - 1)]
    places = list(range(len(steps)))
    axis.bar(places, heldout, color=colors, width=0.62, zorder=2)
    axis.plot(places, [s.score.rmse for s in steps], "o", color=MEASURED, ms=6, label="on the fitted data", zorder=4)
    top = max((h for h in heldout if math.isfinite(h)), default=1.0)
    for place, value in enumerate(heldout):
        fell = f"\n{change_text(heldout[place - 1], value)}" if place else ""
        if math.isfinite(value):
            height = max(value, steps[place].score.rmse)
            axis.text(place, height + 0.025 * top, f"{value:.3g}{fell}", ha="center", va="bottom", fontsize=10)
    axis.set_xticks(places, [_name(step) for step in steps], fontsize=9)
    axis.set_ylim(0.0, 1.2 * top if top > 0.0 else 1.0)


def _name(step: Step) -> str:
    """The effect, and below it its values."""
    mine = own(step)
    values = [values_text({name: estimate}) for name, estimate in list(mine.items())[:_MOST_VALUES]]
    more = [f"and {len(mine) - _MOST_VALUES} more"] if len(mine) > _MOST_VALUES else []
    return "\n".join([step.effect, *values, *more])


def _draw_levels(axis: Any, report: LadderReport) -> None:
    last = report.result.last
    on = f" of {', '.join(last.ceiling.on)}" if last.ceiling.on else ""
    levels = (
        (last.ceiling.heldout_rmse, f"ceiling: any function{on}", "--", "#b2182b"),
        (last.noise, "noise", ":", RESIDUAL),
        (last.floor, "what the sensor alone leaves", "-.", RESIDUAL),
    )
    for level, label, style, color in levels:
        if math.isfinite(level):
            axis.axhline(level, ls=style, lw=1.4, color=color, label=label, zorder=3)
    axis.legend(loc="upper right", frameon=False, fontsize=9)
