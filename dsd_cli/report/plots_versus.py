"""The picture of `dsd compare -c a.toml -c b.toml LOG --plot`: models side by side on one log."""

from __future__ import annotations

from pathlib import PurePath
from typing import Any

import numpy as np

from dsd_cli.identify.compare.versus import Contender, Versus
from dsd_cli.report.figure import (
    MODELS,
    RESIDUAL,
    binned_median,
    channel_label,
    cloud,
    headline,
    in_picture,
    legend_above,
    line,
    nothing,
    sheet,
    shortened,
)
from dsd_cli.report.names import force_error
from dsd_cli.report.timeline import TimedPiece, Timeline, timeline, zero
from dsd_cli.report.versus import verdict_line
from dsd_cli.report.views_comparison import bins_for
from dsd_cli.signals.log import Array
from dsd_cli.signals.units import Units


def draw(found: Versus, units: Units) -> Any:
    """The figure: u, the residual of each model on one scale, over speed and position, and block by block."""
    models = found.contenders
    figure = sheet(12.0, 5.6 + 1.5 * len(models))
    time = [f"residual {k}" for k in range(len(models))]
    axes = figure.subplot_mosaic(
        [["u"] * 3, *([name] * 3 for name in time), ["velocity", "position", "blocks"]],
        height_ratios=[0.7, *[1.0] * len(models), 1.7],
    )
    said = verdict_line(found)
    for one, name in zip(models, _named(models), strict=True):
        said = said.replace(one.name, name)
    headline(figure, f"{', '.join(shortened(PurePath(log).name) for log in found.logs)}: {said}", 115)
    line_of_time = timeline([TimedPiece(rows.name, rows.channels["t"]) for rows in found.rows])
    _draw_time(axes["u"], [axes[name] for name in time], found, line_of_time, units)
    for channel in ("velocity", "position"):
        _draw_over(axes[channel], channel, found, units)
    _draw_blocks(axes["blocks"], found, units)
    return figure


def _named(models: tuple[Contender, ...]) -> list[str]:
    """Names without their folders, where they differ all the same."""
    short = [PurePath(one.name).name for one in models]
    return [shortened(name, 30) for name in (short if len(set(short)) == len(short) else [m.name for m in models])]


def _draw_time(top: Any, panels: list[Any], found: Versus, time: Timeline, units: Units) -> None:
    line(top, *time.joined([rows.channels["u"] for rows in found.rows]), RESIDUAL)
    top.set_ylabel(channel_label("u", units))
    ends = np.cumsum([rows.channels["t"].size for rows in found.rows])[:-1]
    most = max(float(np.abs(one.residual).max()) for one in found.contenders)
    for panel, one, name, (color, _) in zip(
        panels, found.contenders, _named(found.contenders), MODELS * 9, strict=False
    ):
        panel.sharex(top)
        zero(panel)
        line(panel, *time.joined(np.split(one.residual, ends)), color)
        panel.set_ylim(-1.08 * most, 1.08 * most)
        panel.set_ylabel(f"residual{f' ({units.u})' if units.u else ''}")
        panel.set_title(
            f"{in_picture(name)}: {force_error(one.force.band_hz)} {one.force.rmse:.3g} {units.force}", loc="left"
        )
    for panel in (top, *panels[:-1]):
        panel.tick_params(labelbottom=False)
    time.mark([top, *panels])


def _draw_over(axis: Any, channel: str, found: Versus, units: Units) -> None:
    axis.set_xlabel(channel_label(channel, units))
    if any(channel not in rows.channels for rows in found.rows):
        nothing(axis, f"no {channel} in the log")
        return
    x, way = _joined(found, channel), np.zeros(0)
    if channel == "position" and all("velocity" in rows.channels for rows in found.rows):
        way = np.sign(_joined(found, "velocity"))
    zero(axis)
    for one, name, (color, style) in zip(found.contenders, _named(found.contenders), MODELS * 9, strict=False):
        cloud(axis, x, one.residual, color, alpha=0.2)
        parts = [way > 0.0, way < 0.0] if way.size else [np.ones(x.size, dtype=bool)]
        for k, part in enumerate(parts):
            curve = binned_median(x[part], one.residual[part], bins_for(x[part], fine=channel == "position"))
            axis.plot(
                *curve, color=color, ls=style, lw=1.7, alpha=0.6 if k else 1.0, label=None if k else in_picture(name)
            )
    medians = "medians, pale: backward" if way.size else "medians"
    axis.set_ylabel(f"residual, {medians}{f' ({units.u})' if units.u else ''}")
    legend_above(axis, 1 if len(found.contenders) > 2 else 2)


def _joined(found: Versus, channel: str) -> Array:
    return np.concatenate([rows.channels[channel] for rows in found.rows])


def _draw_blocks(axis: Any, found: Versus, units: Units) -> None:
    """What is below the line the other model does better; blocks, because neighbouring samples are no evidence."""
    first = found.contenders[0]
    names = _named(found.contenders)
    seen = np.concatenate([one.by_block for one in found.contenders])
    low, high = float(seen[seen > 0.0].min(initial=np.inf)), float(seen.max())
    if not low < high:
        nothing(axis, "the models leave the same")
        return
    axis.loglog([low / 1.2, high * 1.2], [low / 1.2, high * 1.2], color="0.6", lw=0.9)
    for one, name, (color, _) in list(zip(found.contenders, names, MODELS * 9, strict=False))[1:]:
        axis.loglog(first.by_block, one.by_block, "o", color=color, ms=4, alpha=0.7, mew=0, label=in_picture(name))
    axis.set_xlabel(f"{in_picture(names[0])}: rms of each block ({units.force})")
    other = names[1] if len(names) == 2 else "the others"
    axis.set_ylabel(f"{in_picture(other)}\nbetter below the line")
    if len(found.contenders) > 2:
        axis.legend(loc="best")
