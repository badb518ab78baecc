"""The picture of `dsd simulate --plot` and `dsd observe --plot`: the channels of a log over time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dsd_cli.report.figure import MEASURED, PREDICTED, channel_label, headline, legend_above, line, sheet, shortened
from dsd_cli.report.timeline import TimedPiece, timeline
from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.units import Units

#: Panel -> the channels in it; a panel is drawn if the log has its first channel.
_PANELS = {
    "u": ("u",),
    "d_hat": ("d_hat",),
    "velocity": ("velocity",),
    "position": ("position", "reference"),
    "delay": ("true_delay", "adopted_delay"),
    "inertia": ("true_inertia", "adopted_inertia"),
}
_LABELS = {
    "position": "position",
    "reference": "reference",
    "true_delay": "true",
    "true_inertia": "true",
    "adopted_delay": "as the controller believes",
    "adopted_inertia": "as the controller believes",
}
_LINES: tuple[dict[str, Any], ...] = ({"color": MEASURED}, {"color": PREDICTED, "ls": "--"})


def panels_of(log: Log) -> dict[str, tuple[str, ...]]:
    """Panel -> channels; a truth that never changes, and that nobody believes otherwise, is no panel (`constants`)."""
    found = {}
    for panel, channels in _PANELS.items():
        here = tuple(name for name in channels if name in log)
        if here and here[0] == channels[0] and panel not in constants(log):
            found[panel] = here
    return found


def constants(log: Log) -> dict[str, float]:
    """Delay and inertia of a simulated log in which they stay as they are."""
    names = (name for name in ("delay", "inertia") if f"true_{name}" in log and f"adopted_{name}" not in log)
    return {name: float(log[f"true_{name}"][0]) for name in names if _still(log[f"true_{name}"])}


def _still(x: Array) -> bool:
    """Constant, but for the rounding of samples that were bridged."""
    return bool(np.ptp(x) <= 1e-9 * np.abs(x).max())


def draw(name: str, log: Log, restarts: Sequence[int], units: Units) -> Any:
    """The figure. `restarts` : rows at which another recording, or another stretch, begins."""
    edges = [0, *(at for at in restarts if 0 < at < len(log)), len(log)]
    times: Array = log["t"] if "t" in log else np.asarray(log.sample_time * np.arange(len(log)))
    time = timeline([TimedPiece(name, times[a:b]) for a, b in pairwise(edges)])
    shown = panels_of(log)
    figure = sheet(11.0, 1.65 * len(shown) + 1.1)
    axes = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    still = "".join(f", {what} {value:g}{' s' if what == 'delay' else ''}" for what, value in constants(log).items())
    source = "" if log.d_hat_source == "logged" else f", d_hat computed from {log.d_hat_source}"
    title = f"{len(log):,} samples, {log.sample_time * 1e3:.4g} ms apart{still}{source}"
    headline(figure, f"{shortened(Path(name).name)}: {title}", 110)
    for axis, (panel, channels) in zip(axes, shown.items(), strict=True):
        for channel, style in zip(channels, _LINES, strict=False):
            t, x = time.joined([log[channel][a:b] for a, b in pairwise(edges)])
            line(axis, t, x, label=_LABELS.get(channel), **style)
        axis.set_ylabel(channel_label(panel, units))
        if len(channels) > 1:
            legend_above(axis, 2)
    time.mark(axes)
    for a, b in pairwise(time.times):
        if b[0] == a[-1]:  # stamps that began anew
            for axis in axes:
                axis.axvline(b[0], color="0.25", lw=0.9, ls=(0, (4, 2)))
    figure.align_ylabels(axes)
    return figure
