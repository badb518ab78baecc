"""The picture of `dsd diagnose --plot`: how far each candidate brings the error down, what the found ones explain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np

from dsd_cli.identify.results import Candidate, Diagnosis
from dsd_cli.report.diagnosis import DiagnosisReport
from dsd_cli.report.figure import (
    LIMIT,
    MEASURED,
    OTHER,
    PREDICTED,
    RESIDUAL,
    SHARE,
    binned_median,
    channel_label,
    cloud,
    headline,
    legend_above,
    line,
    sheet,
)
from dsd_cli.report.names import error, force_error, listed, percent
from dsd_cli.report.timeline import zero
from dsd_cli.report.verdict import verdict_line
from dsd_cli.report.views_comparison import bins_for
from dsd_cli.report.views_diagnosis import ResidualView
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units

#: Bars; the colour of those in the final set beside the verdict.
MOST_BARS, _MEMBER = 14, "#f6c58f"


def draw(report: DiagnosisReport, views: Sequence[ResidualView]) -> Any:
    """The figure; the first view is the verdict's, the others are those of the rest of the set."""
    result = report.result
    tested = [c for c in result.ranking if not c.untestable and math.isfinite(c.heldout_rmse_after)]
    beside = list(views[1:])
    above = max(4.6, 0.34 * min(len(tested), MOST_BARS) + 2.0)
    figure = sheet(13.0, above + (3.6 if beside else 0.0))
    rows = figure.subfigures(2 if beside else 1, 1, height_ratios=[above, 3.6] if beside else None, squeeze=False)[:, 0]
    bars, residual = rows[0].subplots(1, 2, width_ratios=[1.0, 1.1])
    headline(figure, verdict_line(result, report.given), 125)
    _draw_bars(bars, result, tested[:MOST_BARS])
    draw_residual(residual, views[0], result.units)
    if beside:
        for panel, view in zip(rows[1].subplots(1, len(beside), squeeze=False)[0], beside, strict=True):
            draw_residual(panel, view, result.units)
    return figure


def _draw_bars(axis: Any, result: Diagnosis, tested: Sequence[Candidate]) -> None:
    if not tested:
        axis.text(0.5, 0.5, "no effect could be tested", ha="center", transform=axis.transAxes, color="0.5")
        return
    after = [c.heldout_rmse_after for c in tested]
    colors = [
        PREDICTED if c.effect == result.verdict else _MEMBER if c.effect in result.found else SHARE for c in tested
    ]
    axis.barh(range(len(tested)), after, color=colors, height=0.7)
    before = next((c.heldout_rmse_before for c in tested if math.isfinite(c.heldout_rmse_before)), math.nan)
    top = max([*after, before] if math.isfinite(before) else after)
    for place, one in enumerate(tested):
        text = f"{error(one.heldout_rmse_after)}  ({percent(one.probability)})"
        inside = one.heldout_rmse_after > 0.5 * top  # else right of the bar
        x = one.heldout_rmse_after + (-0.01 if inside else 0.01) * top
        axis.text(x, place, text, va="center", ha="right" if inside else "left", fontsize=9, zorder=4)
    lines = (
        (before, "without another effect", "-", MEASURED),
        (result.ceiling.heldout_rmse, f"ceiling: any function{_of(result)}", "--", LIMIT),
        (result.noise, "noise", ":", RESIDUAL),
        (result.floor, "floor: noise of the sensor alone", "-.", RESIDUAL),
    )
    for x, label, style, color in lines:
        if math.isfinite(x):
            axis.axvline(x, ls=style, color=color, lw=1.4, label=label, zorder=3)
    axis.set_yticks(range(len(tested)), [c.effect for c in tested])
    axis.invert_yaxis()
    axis.set_xlim(0.0, 1.06 * top)
    of = f"held-out {force_error(result.band_hz)} with one effect more ({result.units.force})"
    axis.set_xlabel(f"{of}; in brackets: in the final set")
    legend_above(axis, 2)


def _of(result: Diagnosis) -> str:
    return f" of {', '.join(result.ceiling.on)}" if result.ceiling.on else ""


def draw_residual(axis: Any, view: ResidualView, units: Units) -> None:
    """Medians, so that one sample that is far off bends nothing; along the position by direction of motion."""
    zero(axis)
    if view.on == "t":
        line(axis, view.x, view.residual, RESIDUAL, "residual", lw=0.7)
    else:
        cloud(axis, view.x, view.residual, RESIDUAL)
    if np.ptp(view.x) > 0.0:
        for series, color, style, label in (
            (view.residual if view.on != "t" else None, MEASURED, "-", "median of the residual"),
            (
                view.explained,
                PREDICTED,
                "--",
                f"explained by {view.effect}{' alone' if view.together is not None else ''}",
            ),
            (view.together, OTHER, ":", "explained by the whole set"),
        ):
            if series is not None:
                _draw_medians(axis, view, series, color, style, label)
        legend_above(axis, 2)
    beside = "\n" + fill(f"beside {listed(view.beside)}", 52) if view.beside else ""
    axis.set_xlabel(channel_label(view.on, units) + beside)
    without = f" without {view.effect}" if view.effect else ""
    axis.set_ylabel(f"residual force{without}\n({units.force})")


def _draw_medians(axis: Any, view: ResidualView, series: Array, color: str, style: str, label: str) -> None:
    parts = [np.ones(view.x.size, dtype=bool)]
    if view.on == "position" and view.way is not None:
        parts = [view.way > 0.0, view.way < 0.0]
    for k, part in enumerate(parts):
        x, y = view.x[part], series[part]
        if view.on == "t":
            line(axis, x, y, color, label, ls=style, lw=1.4)
        elif x.size:
            curve = binned_median(x, y, bins_for(x, fine=view.on == "position"), least=min(5, x.size))
            axis.plot(*curve, color=color, ls=style, lw=1.8, alpha=0.55 if k else 1.0, label=None if k else label)
    if len(parts) > 1 and series is view.residual:
        axis.plot([], [], color=color, lw=1.8, alpha=0.55, label="pale: backward")
