"""The picture of `dsd check --plot`: the channels, what is wrong with them, and which values the logs identify."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dsd_cli.identify.checks import CheckResult
from dsd_cli.report.checks import verdict
from dsd_cli.report.figure import (
    LIMIT,
    MEASURED,
    PREDICTED,
    RESIDUAL,
    channel_label,
    headline,
    in_picture,
    line,
    nothing,
    sheet,
    shortened,
)
from dsd_cli.report.timeline import TimedPiece, timeline
from dsd_cli.signals.log import Array, Log
from dsd_cli.signals.units import Units

_CHANNELS = ("u", "d_hat", "velocity", "position")
#: Findings that are written out, for each log.
MOST_FINDINGS = 4
#: Relative standard errors below which a value is identified, and told at all; where what is not told is drawn.
IDENTIFIED, WEAK, BEYOND, LEAST = 10.0, 50.0, 300.0, 0.01
_COLORS = {"identified": MEASURED, "weak": PREDICTED, "not": LIMIT}


@dataclass(frozen=True)
class Checked:
    """A log as it was read, where other recordings begin in it, and what the check says of it."""

    log: Log
    restarts: tuple[int, ...]
    result: CheckResult


def relative_errors(result: CheckResult) -> dict[str, tuple[float, str]]:
    """Value of the model -> (standard error in % of it, at most `BEYOND`; its grade)."""
    found: dict[str, tuple[float, str]] = {}
    for one in result.parameters:
        share = 100.0 * one.std_error / abs(one.value) if one.value else math.inf
        found[one.name] = (min(share, BEYOND) if math.isfinite(share) else BEYOND, one.identified)
    return found


def draw(checked: Sequence[Checked], units: Units) -> Any:
    """The figure."""
    channels = [name for name in _CHANNELS if any(name in one.log for one in checked)]
    names = list(dict.fromkeys(name for one in checked for name in relative_errors(one.result)))
    below = 0.8 + 0.32 * max(len(names), 1)
    figure = sheet(11.0, 1.45 * len(channels) + below + 0.4 + 0.2 * sum(map(_lines, checked)))
    panels = figure.subplots(len(channels) + 1, 1, height_ratios=[1.45] * len(channels) + [below], squeeze=False)[:, 0]
    headline(figure, "\n".join(_said(one.result) for one in checked), 118)
    _draw_channels(panels[:-1], channels, checked, units)
    _draw_values(panels[-1], names, checked)
    return figure


def _lines(one: Checked) -> int:
    return 1 + min(len(one.result.findings), MOST_FINDINGS)


def _said(result: CheckResult) -> str:
    """The verdict, and the findings, gravest first."""
    lines = [f"{shortened(Path(result.log).name)}: {verdict(result).partition(':')[0]}"]
    lines += [f"{one.severity}: {one.what}" for one in result.findings[:MOST_FINDINGS]]
    more = len(result.findings) - MOST_FINDINGS
    return "\n".join([*lines, f"and {more} more" if more > 0 else ""]).rstrip()


def _draw_channels(panels: Any, channels: Sequence[str], checked: Sequence[Checked], units: Units) -> None:
    """A channel that a finding is about is drawn in the colour of faults."""
    pieces = [(one, part) for one in checked for part in _pieces(one)]
    time = timeline([TimedPiece(one.log.source, _stamps(one.log)[part]) for one, part in pieces])
    for panel, name in zip(panels, channels, strict=True):
        panel.sharex(panels[0])
        wrong = any(f.channel == name and f.severity == "error" for one in checked for f in one.result.findings)
        missing = np.full(1, np.nan)
        series = [
            one.log[name][part] if name in one.log else np.broadcast_to(missing, t.size)
            for (one, part), t in zip(pieces, time.times, strict=True)
        ]
        line(panel, *time.joined(series), LIMIT if wrong else MEASURED)
        panel.set_ylabel(channel_label(name, units).replace(" (", "\n(") + ("\nwrong" if wrong else ""))
    for panel in panels[:-1]:
        panel.tick_params(labelbottom=False)
    time.mark(panels)


def _pieces(one: Checked) -> list[slice]:
    edges = [0, *(at for at in one.restarts if 0 < at < len(one.log)), len(one.log)]
    return [slice(a, b) for a, b in pairwise(edges)]


def _stamps(log: Log) -> Array:
    return log["t"] if "t" in log else np.asarray(log.sample_time * np.arange(len(log)))


def _draw_values(axis: Any, names: Sequence[str], checked: Sequence[Checked]) -> None:
    if not names:
        nothing(axis, "no values to identify")
        return
    axis.axvspan(IDENTIFIED, WEAK, color="0.93", lw=0, zorder=0)
    drawn = set()
    for one in checked:
        for name, (share, grade) in relative_errors(one.result).items():
            mark = ">" if share >= BEYOND else "o"
            label = None if grade in drawn else "not identifiable" if grade == "not" else grade
            axis.plot([max(share, LEAST)], [names.index(name)], mark, color=_COLORS[grade], ms=7, label=label)
            drawn.add(grade)
    axis.set_xscale("log")
    axis.set_xlim(LEAST / 1.5, BEYOND * 1.5)
    axis.set_yticks(range(len(names)), [in_picture(name) for name in names])
    axis.set_ylim(len(names) - 0.5, -0.5)
    axis.grid(axis="y", color="0.9", lw=0.6)
    axis.set_xlabel(
        f"standard error (% of the value): identified below {IDENTIFIED:g} %, weak to {WEAK:g} %, then not identifiable"
    )
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.0, labelcolor=RESIDUAL)
