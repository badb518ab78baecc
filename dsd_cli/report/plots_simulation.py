"""The picture of `dsd compare --horizon simulation --plot`: the model run free beside what was measured."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dsd_cli.identify.compare.forward import Forward, Trace
from dsd_cli.report.comparison import Report
from dsd_cli.report.conclusions import simulation_conclusion
from dsd_cli.report.figure import (
    MEASURED,
    OTHER,
    PREDICTED,
    channel_label,
    headline,
    legend_above,
    line,
    sheet,
    shortened,
)
from dsd_cli.report.timeline import TimedPiece, Timeline, timeline, zero
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units

#: A run that leaves the range of the log is drawn up to so many times that range.
_BEYOND = 1.5


def draw(report: Report, units: Units) -> Any:
    """The figure: each channel with both loops, and below it what they are off.

    `report.result` must be a simulation.
    """
    result = report.result
    assert isinstance(result, Forward)
    traces = [*result.traces, *(report.holdout.traces if report.holdout is not None else ())]
    held = len(traces) - len(result.traces)
    time = timeline([TimedPiece(one.name, one.t, i >= len(traces) - held) for i, one in enumerate(traces)])
    channels = list(traces[0].measured)
    figure = sheet(11.0, 4.1 * len(channels) + 0.8)
    axes = figure.subplots(2 * len(channels), 1, sharex=True, height_ratios=[1.4, 0.8] * len(channels))
    headline(figure, f"{_title(result, report.holdout)}\n{simulation_conclusion(result)}", 110)
    for k, channel in enumerate(channels):
        _draw_channel(axes[2 * k : 2 * k + 2], channel, traces, time, units, result.horizon)
        legend_above(axes[2 * k], 3, lift=0.0 if k or len(time.logs) < 2 else 1.0)
    time.mark(axes)
    figure.align_ylabels(axes)
    return figure


def _title(result: Forward, holdout: Forward | None) -> str:
    loop, main = result.main
    logs = ", ".join(shortened(Path(log).name) for log in result.logs)
    title = f"{logs}: {main.channel} in {loop.replace('_', ' ')}, rmse {main.rmse:.3g} {main.unit}"
    return title if holdout is None else f"{title}; hold-out {holdout.main[1].rmse:.3g}"


def _draw_channel(panels: Any, channel: str, traces: list[Trace], time: Timeline, units: Units, horizon: float) -> None:
    above, below = panels

    def series(of: Callable[[Trace], Mapping[str, Array]]) -> tuple[Array, Array]:
        return time.joined([of(one)[channel] for one in traces])

    measured = series(lambda one: one.measured)
    line(above, *measured, MEASURED, "measured", lw=1.6)
    again = "" if math.isinf(horizon) else f", begun anew every {horizon:g} s"
    loops = [(f"open loop{again}", series(lambda one: one.open_loop), PREDICTED, "-")]
    if all(one.closed_loop for one in traces):
        loops.append(("closed loop", series(lambda one: one.closed_loop), OTHER, "--"))
    zero(below)
    for label, (t, x), color, style in loops:
        line(above, t, x, color, label, ls=style)
        line(below, t, measured[1] - x, color, ls=style)
    _keep_in_view(above, measured[1])
    above.set_ylabel(channel_label(channel, units))
    unit = {"position": units.of_position, "velocity": units.of_velocity}[channel]
    below.set_ylabel(f"off by ({unit})")


def _keep_in_view(axis: Any, measured: Array) -> None:
    """An open loop that drifts far away does not flatten the rest."""
    low, high = float(np.nanmin(measured)), float(np.nanmax(measured))
    room = _BEYOND * max(high - low, 1e-12)
    seen_low, seen_high = axis.get_ylim()
    if seen_low < low - room or seen_high > high + room:
        axis.set_ylim(max(seen_low, low - room), min(seen_high, high + room))
        axis.text(0.005, 0.97, "cut: a run goes far beyond the log", transform=axis.transAxes, va="top", fontsize=8.5)
