"""The picture of `dsd add --plot`: the error before and after, the values that moved, and what the effect takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from dsd_cli.identify.results import DELAY, INERTIA, Step
from dsd_cli.plant.model import PlantModel
from dsd_cli.report.addition import AdditionReport, added_step, addition_line
from dsd_cli.report.figure import OTHER, RESIDUAL, headline, legend_above, sheet
from dsd_cli.report.names import force_error
from dsd_cli.report.plots_diagnosis import draw_residual
from dsd_cli.report.plots_ladder import draw_steps, draw_values, values_shown
from dsd_cli.report.views_diagnosis import ResidualView


def rungs(report: AdditionReport, given: PlantModel) -> Sequence[Step]:
    """The model as given, and with the effect."""
    return Step(0, "as given", report.result.before, {}, given), added_step(report.result)


def draw(report: AdditionReport, given: PlantModel, view: ResidualView) -> Any:
    """The figure; `given` : the model of the config, without the effect."""
    result, steps = report.result, rungs(report, given)
    below = 0.46 * max(values_shown(steps), 1) + 0.3
    figure = sheet(13.0, 5.2 + below)
    axes = figure.subplot_mosaic(
        [["steps", "residual"], ["values", "residual"]], width_ratios=[1.0, 1.1], height_ratios=[4.4, below]
    )
    headline(figure, addition_line(report), 120)
    above = axes["steps"]
    axes["values"].sharex(above)
    draw_steps(above, steps, report.floor, "held-out log" if report.holdout else "held-out blocks")
    refitted = math.nan if result.refitted is None else result.refitted.heldout_rmse
    if result.effect in (INERTIA, DELAY):  # the values of the model are what is fitted
        refitted = math.nan
    for level, label, style, color in (
        (refitted, "without it, own values fitted", "--", OTHER),
        (report.floor, "floor: noise of the sensor alone", "-.", RESIDUAL),
    ):
        if math.isfinite(level) and level > 0.0:
            above.axhline(level, ls=style, lw=1.4, color=color, label=label, zorder=3)
    above.set_ylabel(f"{force_error(report.band_hz)} ({result.units.force})")
    above.tick_params(labelbottom=False)
    legend_above(above, 2)
    draw_values(axes["values"], steps, result.units)
    draw_residual(axes["residual"], view, result.units)
    return figure
