"""The picture of `dsd tune --plot`: labels before and after, the path smoothed over the whole log, the residual."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dsd_cli.detect.grid import Grid
from dsd_cli.detect.tune.evidence import Evidence
from dsd_cli.detect.tune.expect import state_disturbances
from dsd_cli.detect.tune.tuning import Tuning
from dsd_cli.report.figure import (
    LIMIT,
    MEASURED,
    PREDICTED,
    RESIDUAL,
    SHARE,
    channel_label,
    headline,
    legend_above,
    line,
    sheet,
    shortened,
)
from dsd_cli.report.plots_detection import axis_label
from dsd_cli.report.timeline import origin_of, time_label, zero
from dsd_cli.report.tuning import TuningReport, agreement_line, transition_text
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units


@dataclass(frozen=True)
class Looked:
    """What the picture shows of every sample, shape (n,), NaN where it was not judged.

    Attributes
    ----------
    d_hat, predicted : unit of u: as measured, and of the smoothed state.
    path, before, after : axis of the grid -> value: of that state, and of the labels with the old and the new settings.
    """

    t: Array
    d_hat: Array
    predicted: Array
    path: Mapping[str, Array]
    before: Mapping[str, Array]
    after: Mapping[str, Array]


def looked_at(tuning: Tuning) -> Looked:
    """The numbers of the picture; only samples that the path has are labelled."""
    inputs, at = tuning.evidence.inputs, tuning.path.at
    predicted = np.full(inputs.t.size, np.nan)
    predicted[at] = state_disturbances(tuning.evidence)[at, tuning.path.states]

    def values(grid: Grid, states: Any) -> dict[str, Array]:
        found = {name: np.full(inputs.t.size, np.nan) for name in grid.axes}
        for name, axis in grid.axes.items():
            found[name][at] = np.asarray(axis)[states]
        return found

    def labels(evidence: Evidence, settings: Any) -> dict[str, Array]:
        return values(evidence.engine.grid, evidence.run(settings).state[at])

    return Looked(
        inputs.t,
        inputs.d_hat,
        predicted,
        values(tuning.grid, tuning.path.states),
        labels(tuning.given, tuning.before.settings),
        labels(tuning.evidence, tuning.after.settings),
    )


def draw(report: TuningReport, units: Units) -> Any:
    """The figure."""
    tuning, seen = report.tuning, looked_at(report.tuning)
    axes_of_grid = [name for name, values in tuning.grid.axes.items() if np.unique(values).size > 1]
    figure = sheet(11.0, 4.6 + 1.7 * len(axes_of_grid))
    heights = [1.3, 0.9, *[1.2] * len(axes_of_grid)]
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    headline(figure, f"{shortened(Path(report.log).name, 60)}: {_said(tuning)}\n{agreement_line(tuning)}", 115)
    origin = origin_of(float(seen.t[0]), float(seen.t[-1]))
    t = seen.t - origin
    line(panels[0], t, seen.d_hat, MEASURED, "measured", lw=1.3)
    line(panels[0], t, seen.predicted, PREDICTED, "of the smoothed state")
    panels[0].set_ylabel(channel_label("d_hat", units))
    legend_above(panels[0], 2)
    _draw_left(panels[1], t, seen.d_hat - seen.predicted, tuning, units)
    for panel, name in zip(panels[2:], axes_of_grid, strict=True):
        _draw_axis(panel, t, name, seen, tuning, units)
    panels[-1].set_xlabel(time_label(origin))
    figure.align_ylabels(panels)
    return figure


def _said(tuning: Tuning) -> str:
    old, new = tuning.before.settings, tuning.after.settings
    return (
        f"rho {old.rho:g} -> {new.rho:g}, window {old.window} -> {new.window}, "
        f"transition {transition_text(old)} -> {transition_text(new)}"
    )


def _draw_left(panel: Any, t: Array, left: Array, tuning: Tuning, units: Units) -> None:
    """What the right states leave, beside 2 rho before and after."""
    new, old = 2.0 * tuning.after.settings.rho, 2.0 * tuning.before.settings.rho
    panel.axhspan(-new, new, color=SHARE, alpha=0.55, lw=0, label="within 2 rho, tuned")
    zero(panel)
    line(panel, t, left, RESIDUAL)
    low, high = panel.get_ylim()
    for k, edge in enumerate((-old, old)):
        panel.axhline(edge, color=LIMIT, lw=1.0, ls="--", label=None if k else f"2 rho as given: {old:.3g}")
    reach = 3.0 * max(high, -low)
    panel.set_ylim(max(-reach, min(low, -1.1 * old)), min(reach, max(high, 1.1 * old)))  # a rho far off is out of view
    panel.set_ylabel(f"residual{f' ({units.u})' if units.u else ''}")
    legend_above(panel, 2)


def _draw_axis(panel: Any, t: Array, name: str, seen: Looked, tuning: Tuning, units: Units) -> None:
    """One axis of the grid: a line for each candidate, those that were added named."""
    candidates = np.unique(tuning.grid.axes[name])
    added = [one.value for one in tuning.added if one.axis == name]
    for value in candidates:
        panel.axhline(value, color="0.82", lw=0.7, zorder=1)
    steps: dict[str, Any] = {"drawstyle": "steps-post"}
    line(panel, t, seen.path[name], SHARE, "smoothed over the whole log", lw=5.0, **steps)
    if name in seen.before:
        line(panel, t, seen.before[name], PREDICTED, "label as given", lw=1.1, ls="--", **steps)
    line(panel, t, seen.after[name], MEASURED, "label, tuned", lw=1.6, **steps)
    for value in added:
        panel.annotate("added", (1.0, value), (3, 0), xycoords=panel.get_yaxis_transform(), textcoords="offset points",
                       va="center", fontsize=8.5, color=LIMIT)  # fmt: skip
    if (ticks := apart(candidates)).size <= 9:
        panel.set_yticks(ticks, [f"{value:.4g}" for value in ticks])
    room = 0.12 * float(np.ptp(candidates)) or 0.1 * max(abs(float(candidates[-1])), 1e-9)
    panel.set_ylim(candidates[0] - room, candidates[-1] + room)
    panel.set_ylabel(axis_label(name, units))
    legend_above(panel, 3)


def apart(values: Array) -> Array:
    """Those of ascending values that have room for their text: 7 % of the range from the one before."""
    kept = values[:1]
    for value in values[1:]:
        if value - kept[-1] >= 0.07 * np.ptp(values):
            kept = np.append(kept, value)
    return kept
