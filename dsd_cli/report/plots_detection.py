"""The picture of `dsd detect --plot`: what was measured and predicted, which state held, and how sure that is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dsd_cli.detect.grid import Grid
from dsd_cli.detect.plan import Plan
from dsd_cli.detect.watched import Seen
from dsd_cli.effects import get_effect
from dsd_cli.report.detection import Detection
from dsd_cli.report.figure import (
    LIMIT,
    MEASURED,
    OTHER,
    PREDICTED,
    RESIDUAL,
    SHARE,
    channel_label,
    headline,
    legend_above,
    line,
    nothing,
    sheet,
    shortened,
)
from dsd_cli.report.timeline import gaps, origin_of, time_label, zero
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units

#: Rows of the ribbon; of more states those that were likely for longest.
MOST_STATES = 18
#: Labels below this share of confident ones in a column are shaded.
_SURE = 0.5


def draw(result: Detection, seen: Seen, plan: Plan, units: Units) -> Any:
    """The figure."""
    start = min(times[0] for times, _ in seen.lines.values() if times.size)
    end = max(times[-1] for times, _ in seen.lines.values() if times.size)
    origin = origin_of(start, end)
    seen, grid = seen.since(origin), plan.grid
    axes_of_grid = [name for name, values in grid.axes.items() if np.unique(values).size > 1] or ["delay"]
    states = likely_states(seen, MOST_STATES)
    heights = [0.9, 1.3, 0.8, *[0.9] * len(axes_of_grid), 0.5 + 0.13 * len(states)]
    figure = sheet(11.0, 1.7 * sum(heights) + 0.8)
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    headline(figure, f"{shortened(Path(result.log).name, 60)}\n{_said(result, units)}", 120)
    _draw_signals(panels[:3], result, seen, units)
    for panel, name in zip(panels[3:-1], axes_of_grid, strict=True):
        _draw_axis(panel, name, seen, grid, units)
    _draw_ribbon(panels[-1], seen, states, grid)
    for panel in panels:
        for at in seen.restarts:
            panel.axvline(at, color="0.25", lw=0.9, ls=(0, (4, 2)))
        panel.set_xlim(start - origin, end - origin)
    panels[-1].set_xlabel(time_label(origin) + (", recordings one after the other" if seen.restarts else ""))
    figure.align_ylabels(panels)
    return figure


def _said(result: Detection, units: Units) -> str:
    summary = result.summary
    sure = "confident" if summary.final_confident else "not confident"
    final = ", ".join(f"{name} {value:g}" for name, value in summary.final.items())
    left = "" if summary.residual_rms is None else f"; unexplained {summary.residual_rms:.3g} {units.force} (rms)"
    return f"at the end {final} ({sure}); {100 * summary.confident_share:.0f} % confident{left}"


def likely_states(seen: Seen, most: int) -> list[int]:
    """The states that were likely for longest, at most `most`, in the order of the grid."""
    share = np.nan_to_num(seen.likelihoods[1]).sum(axis=0)
    return sorted(np.argsort(-share, kind="stable")[:most].tolist())


def unsure(times: Array, share: Array) -> list[tuple[float, float]]:
    """Stretches of time in which less than half of the labels are confident."""
    if not times.size:
        return []
    low = np.concatenate([[False], share < _SURE, [False]]).astype(int)
    edges = np.append(times, times[-1])
    starts, ends = np.flatnonzero(np.diff(low) > 0), np.flatnonzero(np.diff(low) < 0)
    return [(float(edges[a]), float(edges[b])) for a, b in zip(starts, ends, strict=True)]


def _draw_signals(panels: Any, result: Detection, seen: Seen, units: Units) -> None:
    commanded, measured, left = panels
    if "u" not in seen.lines:
        for panel in panels:
            nothing(panel, "no sample")
        return
    line(commanded, *seen.lines["u"], MEASURED)
    commanded.set_ylabel(channel_label("u", units))
    source = "measured" if result.d_hat_source == "logged" else f"computed from {result.d_hat_source}"
    line(measured, *seen.lines["d_hat"], MEASURED, source, lw=1.3)
    line(measured, *seen.lines["predicted"], PREDICTED, "of the state chosen", lw=1.0)
    measured.set_ylabel(channel_label("d_hat", units) if result.output == "d_hat" else "d(d_hat)/dt")
    legend_above(measured, 2)
    _draw_left(left, seen, result.rho, units)


def _draw_left(panel: Any, seen: Seen, rho: float, units: Units) -> None:
    panel.axhspan(-2.0 * rho, 2.0 * rho, color=SHARE, alpha=0.55, lw=0, label="within 2 rho")
    zero(panel)
    line(panel, *seen.lines["unexplained"], RESIDUAL)
    panel.set_ylabel(f"unexplained{f' ({units.u})' if units.u else ''}")
    legend_above(panel, 1)


def _draw_axis(panel: Any, name: str, seen: Seen, grid: Grid, units: Units) -> None:
    candidates = np.unique(grid.axes[name])
    for value in candidates:
        panel.axhline(value, color="0.82", lw=0.7, zorder=1)
    for k, (a, b) in enumerate(unsure(*seen.confident)):
        panel.axvspan(a, b, color=SHARE, alpha=0.7, lw=0, zorder=0, label="not confident" if k == 0 else None)
    estimate = seen.lines.get(f"{name}_estimate")
    if estimate is not None:
        line(panel, *estimate, OTHER, "estimate +- 2 std", lw=1.4)
        for edge in ("low", "high"):
            line(panel, *seen.lines[f"{name}_{edge}"], OTHER, lw=0.7, ls=":")
    line(panel, *seen.lines[name], MEASURED, "label", lw=1.7, drawstyle="steps-post")
    truth = seen.lines.get(f"true_{name}")
    if truth is not None and np.isfinite(truth[1]).any():
        line(panel, *truth, LIMIT, "truth in the log", lw=1.2, ls="--", drawstyle="steps-post")
    known = np.zeros(0) if truth is None else np.unique(truth[1][np.isfinite(truth[1])])
    values = np.unique([*candidates, *known])
    if values.size <= 7:
        panel.set_yticks(values, [f"{value:.4g}" for value in values])
    low, high = values[0], values[-1]
    room = 0.12 * (high - low) or 0.1 * max(abs(high), 1e-9)
    panel.set_ylim(low - room, high + room)
    panel.set_ylabel(axis_label(name, units))
    legend_above(panel, 4)


def axis_label(name: str, units: Units) -> str:
    """What stands beside an axis of the grid."""
    effect, _, parameter = name.partition(".")
    if not parameter:
        return channel_label(name, units)
    unit = get_effect(effect).parameter(parameter).unit
    known = units.u and units.position and unit not in ("", "1")
    return f"{effect}\n{parameter}{f' ({units.words(unit)})' if known else ''}"


def ribbon(times: Array, share: Array) -> tuple[Array, Array]:
    """(edges of columns, shape (m + 1,), values (m, states)): a column of NaN wherever time does not go on."""
    steps = np.diff(times)
    usual = float(np.median(steps))
    where = gaps(times)
    edges = np.insert(np.append(times, times[-1] + usual), where, times[where - 1] + usual)
    return edges, np.insert(share, where, np.nan, axis=0)


def _draw_ribbon(panel: Any, seen: Seen, states: list[int], grid: Grid) -> None:
    """Dark is likely: each row a state."""
    if seen.likelihoods[0].size < 2:
        nothing(panel, "no likelihoods")
        return
    edges, share = ribbon(*seen.likelihoods)
    image = np.ma.masked_invalid(share[:, states].T)
    rows = np.arange(len(states) + 1) - 0.5
    shades = panel.pcolormesh(edges, rows, image, cmap="Blues", vmin=0.0, vmax=1.0, rasterized=True)
    panel.set_facecolor("0.88")
    names = [name for name, values in grid.axes.items() if np.unique(values).size > 1] or ["delay"]
    labels = [", ".join(f"{grid.axes[name][state]:.4g}" for name in names) for state in states]
    panel.set_yticks(range(len(states)), labels, fontsize=8)
    panel.invert_yaxis()
    more = "" if len(states) == len(grid) else f"\n{len(states)} likeliest of {len(grid)}"
    panel.set_ylabel("\n".join(["states:", *(name.replace(".", "\n") for name in names)]) + more)
    bar = panel.figure.colorbar(shades, ax=panel, location="bottom", fraction=0.09, pad=0.01, aspect=50, shrink=0.5)
    bar.set_label("likelihood of the state over its window, of all states (grey: not judged)", fontsize=8.5)
    bar.ax.tick_params(labelsize=8)
